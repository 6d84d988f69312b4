#!/usr/bin/env python3
"""Compute the correction table of the light rig `penrose`; about a minute, the same result every time.

For each importance index the points of a constant importance, that of the middle of its bin, are relaxed by Lloyd's
algorithm. The displacement of each point in units of its tile's scale, turned into the frame of the tile, is averaged
over the points with the same structural index: that is an entry. Points so corrected are the start of the next pass.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Voronoi

import stratalux.rigs
from stratalux.rigs.penrose import BINS, DENSITY, PHI, correction_frame, root_scale, tiling_points

SIDE = 256
"""Texels along the square map that is filled with points."""
PASSES = 8
RELAXATIONS = 4
"""Rounds of Lloyd's algorithm in each pass."""
PERIOD = 11
"""Integral part of the importance's logarithm to the base φ²: 1800 to 4700 points."""
MARGIN = 0.08
"""Fraction of the side in which points do not move, and beside it another in which they do not count."""


def cell_centroids(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Centroid of the Voronoi cell of each point (P, 2), garbage where it is unbounded."""
    diagram = Voronoi(points)
    bounded = np.array([-1 not in ridge for ridge in diagram.ridge_vertices])
    pair = diagram.ridge_points[bounded]
    start, end = diagram.vertices[np.array([r for r in diagram.ridge_vertices if -1 not in r])].transpose(1, 0, 2)
    area, moment = np.zeros(len(points)), np.zeros((len(points), 2))
    for side in pair.T:  # a cell is made of the triangles between its point and its edges
        first, second = start - points[side], end - points[side]
        triangle = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
        np.add.at(area, side, triangle)
        np.add.at(moment, side, triangle[:, None] * (start + end + points[side]) / 3)
    return moment / np.maximum(area, 1e-12)[:, None]


def column(phase: int) -> NDArray[np.float64]:
    """Entries (structural index, 2) for one importance index."""
    shape = (SIDE + 1, SIDE)
    root = root_scale(shape)
    rank = (PHI ** (2 * (PERIOD + (phase + 0.5) / BINS)) - 1) / np.sqrt(5)
    density = np.full(shape, DENSITY * rank / root**2)
    points = tiling_points(density, 1.0)
    structure, found, frame = correction_frame(points, np.full(len(points), rank), root)
    assert np.all(found == phase)
    to_frame = np.linalg.inv(frame.transpose(0, 2, 1))

    edge = np.minimum(points.origin, SIDE - points.origin).min(axis=1) / SIDE
    moves, counts = edge > MARGIN, edge > 2 * MARGIN
    size = np.maximum(np.bincount(structure[counts], minlength=BINS), 1)
    entries = np.zeros((BINS, 2))
    for _ in range(PASSES):
        corrected = points.origin + np.einsum("pk,pkc->pc", entries[structure], frame)
        relaxed = corrected
        for _ in range(RELAXATIONS):
            relaxed = np.where(moves[:, None], cell_centroids(relaxed), corrected)
        shift = np.einsum("pkc,pc->pk", to_frame, relaxed - points.origin)
        entries = np.stack([np.bincount(structure[counts], shift[counts, k], BINS) for k in range(2)], axis=1)
        entries /= size[:, None]
    return entries


def main() -> None:
    table = np.stack([column(phase) for phase in range(BINS)], axis=1)
    rows = [json.dumps(row) for row in np.round(table, 4).tolist()]
    path = Path(stratalux.rigs.__path__[0]) / "penrose_table.json"
    path.write_text("[" + ",\n ".join(rows) + "]\n")
    print(f"{path}: displacements up to {np.abs(table).max():.3f} of a tile's scale")


if __name__ == "__main__":
    main()
