"""Voronoi cells on the sphere, made of texels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..maps.geometry import direction

COINCIDENT = 1e-12
"""Directions with 1 − cos of the angle below this (1.4 µrad) are one: the texels of a polar row are, up to rounding."""


def texel_directions(height: int, width: int) -> NDArray[np.float64]:
    """Unit direction of each texel, (height · width, 3), row by row."""
    u = (np.arange(width) + 0.5) / width
    v = np.arange(height) / (height - 1)
    points = direction(*np.broadcast_arrays(u[None, :], v[:, None]))
    return points.reshape(-1, 3).astype(np.float64)


def nearest(sites: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Index of the site (N, 3) nearest to each of the unit vectors ``points`` (P, 3).

    Chords order like angles, so the cells are Voronoi cells on the sphere.
    """
    from scipy.spatial import cKDTree  # not before it is needed: SciPy takes half a second

    return cKDTree(sites).query(points)[1]


def centroids(
    points: NDArray[np.float64],
    weight: NDArray[np.float64],
    fallback: NDArray[np.float64],
    label: NDArray[np.integer],
    n: int,
) -> NDArray[np.float64]:
    """Unit direction of Σ weight · point over the points (P, 3) of each of ``n`` labels, (n, 3).

    Where that sum vanishes (no weight, or opposite points in balance) the weights ``fallback`` count, and where these
    vanish too, the first point of the label does. Every label must have a point.
    """
    result = np.empty((n, 3))
    result[label[::-1]] = points[::-1]  # the first point is written last
    for w in (fallback, weight):
        total = np.bincount(label, w, n)
        moment = np.stack([np.bincount(label, w * points[:, c], n) for c in range(3)], axis=1)
        length = np.linalg.norm(moment, axis=1)
        sound = length > 1e-9 * total
        result[sound] = moment[sound] / length[sound, None]
    return result
