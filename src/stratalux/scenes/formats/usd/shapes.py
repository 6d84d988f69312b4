"""The basic shapes of UsdGeom as polygons: cubes, planes, and what turns around an axis."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...model import Floats, Indices

_SEGMENTS, _RINGS = 64, 32


class Polygons(NamedTuple):
    """Points (V, 3), the points (C,) at the corners of all polygons, the sizes (P,) of these, and normals (V, 3)."""

    points: Floats
    corners: Indices
    sizes: Indices
    normals: Floats


def cube(size: float) -> Polygons:
    """A cube around the origin."""
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    points, normals = np.empty((6, 4, 3)), np.empty((6, 4, 3))
    for side in range(6):
        axis, sign = side // 2, 1 - 2 * (side % 2)
        # Seen from the other side, the corners go round the other way.
        points[side, :, (axis + 1) % 3], points[side, :, (axis + 2) % 3] = square[::sign].T
        points[side, :, axis] = sign
        normals[side] = sign * np.eye(3)[axis]
    return Polygons(points.reshape(-1, 3) * size / 2, np.arange(24), np.full(6, 4), normals.reshape(-1, 3))


def plane(width: float, length: float, axis: str) -> Polygons:
    """A rectangle that faces along an axis."""
    along = {"X": (2, 1), "Y": (0, 2), "Z": (0, 1)}[axis]
    points = np.zeros((4, 3))
    points[:, along[0]] = np.array([-1, 1, 1, -1]) * width / 2
    points[:, along[1]] = np.array([-1, -1, 1, 1]) * length / 2
    normal = np.eye(3)["XYZ".index(axis)]
    turned = np.cross(points[1] - points[0], points[2] - points[0]) @ normal < 0
    corners = np.array([3, 2, 1, 0] if turned else [0, 1, 2, 3])
    return Polygons(points, corners, np.array([4]), np.tile(normal, (4, 1)))


def sphere(radius: float) -> Polygons:
    """A sphere around the origin."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, _RINGS + 1)
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return _turned(radius * normals, normals, "Z")


def cylinder(height: float, bottom: float, top: float, axis: str) -> Polygons:
    """A cylinder, or a part of a cone, around the origin, with both of its ends; one may be a point."""
    half = height / 2
    slope = np.array([height, bottom - top]) / np.hypot(height, bottom - top) if height else np.array([1.0, 0.0])
    profile = np.array([[0, -half], [bottom, -half], [bottom, -half], [top, half], [top, half], [0, half]])
    return _turned(profile, np.array([[0, -1], [0, -1], slope, slope, [0, 1], [0, 1]]), axis)


def capsule(height: float, radius: float, axis: str) -> Polygons:
    """A cylinder of that height with half a sphere on each of its ends."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, _RINGS + 2)
    angles[_RINGS // 2 : _RINGS // 2 + 2] = 0
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    profile = radius * normals
    profile[:, 1] += np.where(np.arange(len(angles)) <= _RINGS // 2, -height / 2, height / 2)
    return _turned(profile, normals, axis)


def _turned(profile: Floats, normals: Floats, axis: str) -> Polygons:
    """The surface of a profile (R, 2) of distances from the axis and heights, from below, with its normals (R, 2)."""
    angles = np.arange(_SEGMENTS) * 2 * np.pi / _SEGMENTS

    def around(pairs: Floats) -> Any:
        distance, height = pairs[:, :1], np.repeat(pairs[:, 1:], _SEGMENTS, axis=1)
        points = np.stack([distance * np.cos(angles), distance * np.sin(angles), height], axis=2).reshape(-1, 3)
        # Cyclic, as that does not mirror.
        return np.roll(points, {"X": 1, "Y": 2, "Z": 0}[axis], axis=1)

    first = np.arange(_SEGMENTS)
    rows = np.arange(len(profile) - 1)[:, None] * _SEGMENTS
    next_ = np.roll(first, -1)
    quads = np.stack([rows + first, rows + next_, rows + _SEGMENTS + next_, rows + _SEGMENTS + first], axis=2)
    count = rows.size * _SEGMENTS
    return Polygons(around(profile), quads.reshape(-1), np.full(count, 4), around(normals))
