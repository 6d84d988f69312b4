"""Shading normals for triangles that have none: smooth, but sharp where an edge bends too much."""

from __future__ import annotations

import numpy as np

from .model import Floats, Indices

CREASE_DEGREES = 40.0
"""Edges that bend more than this stay sharp when a file brings no normals of its own."""


def smooth_normals(vertices: Floats, faces: Indices, crease_degrees: float) -> tuple[Indices, Indices, Floats]:
    """Normals for the corners of triangles, split where an edge bends more than `crease_degrees`.

    Vertices at the same place count as one, so that a triangle soup comes out smooth too. Corners around
    a vertex share a normal (the mean of their faces', weighted by the corner angles) when they are
    connected through smooth edges; each such group becomes one vertex of the result. Returns the old vertices (W,)
    that the new ones are at, the new faces (F, 3), and unit normals (W, 3).
    """
    faces = faces.astype(np.int64)
    points = vertices.astype(np.float64)[faces]
    face_normals = unit(cross(points))
    group = _smooth_groups(_welded(vertices)[faces], face_normals, np.cos(np.radians(crease_degrees)))

    _, first, index = np.unique(group, return_index=True, return_inverse=True)
    weighted = (face_normals[:, None, :] * _corner_angles(points)[:, :, None]).reshape(-1, 3)
    normals: Floats = np.column_stack([np.bincount(index, weights, len(first)) for weights in weighted.T])
    # The faces of a needle can cancel out; any of their own normals is then as good as another.
    cancelled = np.linalg.norm(normals, axis=1) < 1e-9
    normals[cancelled] = face_normals[first[cancelled] // 3]
    return faces.ravel()[first], index.reshape(-1, 3), unit(normals)


def _welded(vertices: Floats) -> Indices:
    """For each of the (V, 3) vertices a number that is the same for all vertices at its place."""
    order = np.lexsort(vertices.T)
    new = np.any(np.diff(vertices[order], axis=0) != 0, axis=1)
    place = np.empty(len(vertices), dtype=np.int64)
    place[order] = np.concatenate([[0], np.cumsum(new)])
    return place


def _smooth_groups(corners: Indices, face_normals: Floats, cosine: float) -> Indices:
    """For each of the 3F corners (welded vertices, (F, 3)) the lowest corner that it shares a normal with."""
    low = np.minimum(corners, np.roll(corners, -1, axis=1))
    high = np.maximum(corners, np.roll(corners, -1, axis=1))
    start = np.arange(corners.size).reshape(-1, 3)
    end = np.roll(start, -1, axis=1)
    at_low, at_high = np.where(corners == low, [start, end], [end, start]).reshape(2, -1)
    edge = (low * (corners.max() + 1) + high).ravel()
    order = np.argsort(edge, kind="stable")
    links = []
    # An edge has two sides; four where surfaces touch or every face comes twice, once per orientation.
    for step in (1, 2, 3):
        a, b = order[:-step], order[step:]
        bend = np.einsum("ij,ij->i", face_normals[a // 3], face_normals[b // 3])
        keep = (edge[a] == edge[b]) & (bend > cosine)
        a, b = a[keep], b[keep]
        links += [np.stack([at_low[a], at_low[b]]), np.stack([at_high[a], at_high[b]])]
    return _components(corners.size, np.concatenate(links, axis=1))


def _components(count: int, links: Indices) -> Indices:
    """The lowest member of the connected component of each of `count` nodes, given (2, L) links."""
    root = np.arange(count)
    while True:
        ends = root[links]
        lowest = ends.min(axis=0)
        if np.array_equal(lowest, ends.max(axis=0)):
            return root
        # Hang the higher root below the lower one, then flatten: a logarithmic number of rounds.
        np.minimum.at(root, ends.max(axis=0), lowest)
        while not np.array_equal(root, root[root]):
            root = root[root]


def _corner_angles(points: Floats) -> Floats:
    """The angles (F, 3) in radians at the corners of triangles given by their points (F, 3, 3)."""
    ahead = unit(np.roll(points, -1, axis=1) - points)
    cosines = -np.einsum("fij,fij->fi", ahead, np.roll(ahead, 1, axis=1))
    return np.asarray(np.arccos(np.clip(cosines, -1, 1)))


def cross(points: Floats) -> Floats:
    """Twice the area vectors (F, 3) of triangles given by their points (F, 3, 3)."""
    return np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])


def unit(vectors: Floats) -> Floats:
    """The vectors (..., 3) scaled to length one; zero vectors stay zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1))
