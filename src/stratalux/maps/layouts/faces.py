"""Six faces around a cube, whatever their order and their turns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .layout import Floats, Indices

_EDGE = 1 + 1e-9


@dataclass(frozen=True)
class Face:
    """A face looks along an axis (0, 1, 2 for x, y, z) forwards (1) or backwards (-1); so do its columns, which go to
    the right, and its rows, which go down."""

    towards: tuple[int, int]
    right: tuple[int, int]
    down: tuple[int, int]


@dataclass(frozen=True)
class Cube:
    """What a :class:`.Layout` has to know of six faces."""

    faces: Sequence[Face]

    def direction(self, face: int, s: Floats, t: Floats) -> Floats:
        about = self.faces[face]
        d = np.empty((*np.broadcast_shapes(s.shape, t.shape), 3))
        d[..., about.towards[0]] = about.towards[1]
        d[..., about.right[0]] = about.right[1] * (2 * s - 1)
        d[..., about.down[0]] = about.down[1] * (2 * t - 1)
        return d / np.linalg.norm(d, axis=-1, keepdims=True)

    def position(self, d: Floats) -> tuple[Indices, Floats, Floats]:
        length = np.abs(d)
        largest = length.argmax(axis=-1)
        face, s, t = np.empty(largest.shape, dtype=np.int64), np.empty(largest.shape), np.empty(largest.shape)
        for number, about in enumerate(self.faces):
            axis, way = about.towards
            here = (largest == axis) & ((d[..., axis] > 0) == (way > 0))
            ahead = length[here, axis]
            face[here] = number
            s[here] = (about.right[1] * d[here, about.right[0]] / ahead + 1) / 2
            t[here] = (about.down[1] * d[here, about.down[0]] / ahead + 1) / 2
        return face, s, t

    def density(self, face: int, s: Floats, t: Floats) -> Floats:
        a, b = 2 * s - 1, 2 * t - 1
        inside = (np.abs(a) <= _EDGE) & (np.abs(b) <= _EDGE)
        return np.asarray(np.where(inside, 4 * (1 + a * a + b * b) ** -1.5, 0.0))
