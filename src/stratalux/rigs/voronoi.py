"""Voronoi cells on the sphere, made of texels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..maps.geometry import direction

_AT_A_TIME = 1 << 20
COINCIDENT = 1e-12
"""Directions with 1 − cos of the angle below this (1.4 µrad) are one: the texels of a polar row are, up to rounding."""


def texel_directions(height: int, width: int) -> NDArray[np.float64]:
    """Unit direction of each texel, (height · width, 3), row by row."""
    u = (np.arange(width) + 0.5) / width
    v = np.arange(height) / (height - 1)
    points = direction(*np.broadcast_arrays(u[None, :], v[:, None]))
    return points.reshape(-1, 3).astype(np.float64)


class TexelDirections:
    """The same, some at a time: of a large map, all of them take eight times as much memory as its half floats."""

    def __init__(self, height: int, width: int) -> None:
        self._height, self._width = height, width

    def __len__(self) -> int:
        return self._height * self._width

    def __getitem__(self, some: slice) -> NDArray[np.float64]:
        row, column = np.divmod(np.arange(*some.indices(len(self))), self._width)
        return direction((column + 0.5) / self._width, row / (self._height - 1)).astype(np.float64)


def slices(count: int) -> list[slice]:
    """Of so many points, a million at a time."""
    return [slice(first, min(first + _AT_A_TIME, count)) for first in range(0, count, _AT_A_TIME)]


def nearest(sites: NDArray[np.float64], points: NDArray[np.float64] | TexelDirections) -> NDArray[np.int32]:
    """Index of the site (N, 3) nearest to each of the unit vectors ``points`` (P, 3).

    Chords order like angles, so the cells are Voronoi cells on the sphere.
    """
    from scipy.spatial import cKDTree  # not before it is needed: SciPy takes half a second

    tree, found = cKDTree(sites), np.empty(len(points), dtype=np.int32)
    for some in slices(len(points)):
        found[some] = tree.query(points[some])[1]
    return found


def centroids(
    points: NDArray[np.float64] | TexelDirections,
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
    sums = np.zeros((2, 4, n))
    for some in slices(len(points))[::-1]:
        ours, which = points[some], label[some]
        result[which[::-1]] = ours[::-1]  # the first point is written last
        for total, w in zip(sums, (fallback[some], weight[some]), strict=True):
            total += [np.bincount(which, values, n) for values in (w, *(w * ours[:, c] for c in range(3)))]
    for total, *moments in sums:
        moment = np.stack(moments, axis=1)
        length = np.linalg.norm(moment, axis=1)
        sound = length > 1e-9 * total
        result[sound] = moment[sound] / length[sound, None]
    return result
