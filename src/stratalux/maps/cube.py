"""Cube-face maps, as OpenEXR lays them out, to latitude-longitude.

Six square faces lie one below the other: +X, −X, +Y, −Y, +Z and −Z. Centres of the outer pixels are the edges of the
cube, so that neighbouring faces share them (OpenEXR's ``ImfEnvmap.h``). Its axes are those of :mod:`.geometry`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .geometry import direction

_POINTS = 3
"""In each texel, along each axis, whose mean it is."""
_LOOKUPS = 1 << 16
"""At a time: they stay in the cache."""

_AXES = ((2, 1, 1, -1), (2, 1, -1, -1), (0, 2, 1, -1), (0, 2, 1, 1), (0, 1, -1, -1), (0, 1, 1, -1))
"""For each face: the axes that its columns and its rows follow, and whether they do so forwards or backwards."""


def from_cube(faces: NDArray[np.float32]) -> NDArray[np.float32]:
    """The latitude-longitude map (2 N, 4 N, 3) of six ``faces`` (6 N, N, 3): as fine along the equator as they are.

    Each texel is the mean of the bilinear radiance of the cube over the directions around it.
    """
    side = faces.shape[1]
    height, width = max(2 * side, 4), 4 * side
    result = np.empty((height, width, faces.shape[2]), dtype=np.float32)
    within = (np.arange(_POINTS) + 0.5) / _POINTS - 0.5
    u = ((np.arange(width)[:, None] + 0.5 + within) / width).ravel()
    rows = max(1, _LOOKUPS // (width * _POINTS**2))
    for first in range(0, height, rows):
        last = min(first + rows, height)
        v = ((np.arange(first, last)[:, None] + within) / (height - 1)).ravel()  # beyond a pole is the other side of it
        d = direction(*np.broadcast_arrays(u, v[:, None]))
        radiance = look_up(faces, d.reshape(-1, 3)).reshape(last - first, _POINTS, width, _POINTS, -1)
        weight = np.abs(np.sin(np.pi * v)).reshape(-1, _POINTS, 1, 1)
        result[first:last] = (radiance.mean(axis=3) * weight).sum(axis=1) / weight.sum(axis=1)
    return result


def look_up(faces: NDArray[np.float32], d: NDArray[np.float64]) -> NDArray[np.float32]:
    """Bilinear radiance (K, C) of the ``faces`` (6 N, N, C) from the directions ``d`` (K, 3)."""
    side = faces.shape[1]
    length = np.abs(d)
    axis = length.argmax(axis=1)
    result = np.empty((len(d), faces.shape[2]), dtype=np.float32)
    for number, (across, down, forwards_x, forwards_y) in enumerate(_AXES):
        here = np.flatnonzero((axis == number // 2) & ((d[:, number // 2] < 0) == number % 2))
        if not len(here):
            continue
        largest = length[here, number // 2]
        x = (forwards_x * d[here, across] / largest + 1) / 2 * (side - 1)
        y = (forwards_y * d[here, down] / largest + 1) / 2 * (side - 1)
        column, row = (np.clip(t.astype(np.int64), 0, max(side - 2, 0)) for t in (x, y))
        s, t = ((a - b).astype(np.float32)[:, None] for a, b in ((x, column), (y, row)))
        face = faces[number * side : (number + 1) * side].reshape(side * side, -1)
        at, right, below = row * side + column, min(1, side - 1), side if side > 1 else 0
        upper, lower = face.take(at, axis=0), face.take(at + below, axis=0)
        upper += s * (face.take(at + right, axis=0) - upper)
        lower += s * (face.take(at + below + right, axis=0) - lower)
        result[here] = upper + t * (lower - upper)
    return result
