"""Polygons into triangles: the notches of concave ones stay open.

Convex polygons, which most are, become fans of triangles, all at once in NumPy. The others are projected onto their own
planes and cut by the ear clipping of mapbox-earcut.
"""

from __future__ import annotations

import numpy as np

from .model import Floats, Indices


def triangulated(points: Floats, sizes: Indices) -> tuple[Indices, int]:
    """Cut polygons in space into triangles.

    `points` (C, 3): the corners of all polygons one after the other; `sizes` (P,): how many corners each has. Polygons
    with less than three corners are left out. Returns the triangles as indices (T, 3) into `points`, in the order and
    the orientation of the polygons, and the number of polygons that cannot be filled without doubt, because their
    outlines cross themselves. The outline of a polygon may be concave, leave its plane a little, have corners on a
    straight line or twice at the same place, and touch itself.
    """
    sizes = np.asarray(sizes, dtype=np.int64)
    first = np.cumsum(sizes) - sizes
    if np.all(sizes == 3):
        return np.arange(3 * len(sizes)).reshape(-1, 3), 0
    triangles, owners, doubtful = [], [], 0
    for size in np.unique(sizes[sizes >= 3]):
        chosen = np.flatnonzero(sizes == size)
        cut, owner, crossing = _of_one_size(points, first[chosen, None] + np.arange(size))
        triangles.append(cut)
        owners.append(chosen[owner])
        doubtful += crossing
    if not triangles:
        return np.empty((0, 3), dtype=np.int64), 0
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.concatenate(triangles)[order], doubtful


def _of_one_size(points: Floats, index: Indices) -> tuple[Indices, Indices, int]:
    """The triangles (T, 3) of polygons (P, K), the polygon (T,) of each, and how many polygons are doubtful."""
    size = index.shape[1]
    steps = np.arange(1, size - 1)
    fans = index[:, np.stack([np.zeros_like(steps), steps, steps + 1], axis=1)]
    fits = np.ones(len(index), dtype=bool)
    if size > 3:
        # Area vectors are small differences of large coordinates, unless these are relative to one of the corners.
        local = points[index] - points[index[:, :1]]
        areas = np.cross(local[:, steps], local[:, steps + 1])
        normals = areas.sum(axis=1)
        # All triangles of a fan turn the same way if the polygon is seen whole from its first corner.
        along = np.einsum("pki,pi->pk", areas, normals)
        squared = np.sum(normals**2, axis=1)
        fits = (along.min(axis=1) >= -1e-12 * squared) & (squared > 0)
    triangles = [fans[fits].reshape(-1, 3)]
    owners = [np.repeat(np.flatnonzero(fits), size - 2)]
    doubtful = 0
    for polygon in np.flatnonzero(~fits):
        ears, crossing = _clipped(local[polygon], normals[polygon])
        triangles.append(index[polygon][ears] if len(ears) else fans[polygon])
        owners.append(np.full(len(triangles[-1]), polygon))
        doubtful += crossing
    return np.concatenate(triangles), np.concatenate(owners), doubtful


def _clipped(points: Floats, normal: Floats) -> tuple[Indices, bool]:
    """The ears (T, 3) of a polygon (K, 3) with its area vector, and whether its outline crosses itself."""
    import mapbox_earcut

    length = np.linalg.norm(normal)
    extent = np.ptp(points, axis=0).max()
    if not np.isfinite(length):
        return np.empty((0, 3), dtype=np.int64), False
    if length <= 1e-12 * extent**2:
        # No plane of its own: a line, or loops that cancel out. Only the latter have anything to show.
        fan = np.cross(points[1:-1], points[2:])
        return np.empty((0, 3), dtype=np.int64), bool(np.abs(fan).max() > 1e-9 * extent**2)
    axis = normal / length
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    flat = points @ np.stack([side, np.cross(axis, side)], axis=1)
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], dtype=np.uint32)).astype(np.int64)
    ears = ears.reshape(-1, 3)
    a, b, c = np.moveaxis(flat[ears], 1, 0)
    twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    # A simple polygon is covered once by its ears, all turned as it is: their areas add up to its own.
    return ears, bool(abs(twice.sum() - length) > 1e-3 * length)


def strip(count: int) -> Indices:
    """The triangles (T, 3) of a strip of `count` vertices: every other one is turned around."""
    first = np.arange(max(count - 2, 0))
    odd = first % 2
    return np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)


def fan(count: int) -> Indices:
    """The triangles (T, 3) of a fan of `count` vertices around the first."""
    second = np.arange(1, max(count - 1, 1))
    return np.stack([second, second + 1, np.zeros_like(second)], axis=1)
