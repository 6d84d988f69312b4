"""An octahedron, unfolded: the upper half in the diamond around the middle, the lower one in the four corners.

Source: Z. H. Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors" (2014). Here +y is in
the middle, +x to the right and +z down, as seen from above.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .layout import Floats, Indices, Layout


def folded(s: Floats, t: Floats) -> tuple[Floats, Floats]:
    """Points of the square as numbers from −1 to 1; those beyond an edge go on at its other half, turned around."""
    x, y = 2 * s - 1, 2 * t - 1
    for _ in range(2):
        over = np.abs(x) > 1
        x, y = np.where(over, np.copysign(2, x) - x, x), np.where(over, -y, y)
        x, y = y, x
    return x, y


def _unfolded(s: Floats, t: Floats) -> Floats:
    """The point of the octahedron |x| + |y| + |z| = 1, (..., 3)."""
    x, z = folded(s, t)
    y = 1 - np.abs(x) - np.abs(z)
    below = y < 0
    return np.stack(
        [
            np.where(below, np.copysign(1 - np.abs(z), x), x),
            y,
            np.where(below, np.copysign(1 - np.abs(x), z), z),
        ],
        axis=-1,
    )


def _direction(face: int, s: Floats, t: Floats) -> Floats:
    d = _unfolded(s, t)
    return np.asarray(d / np.linalg.norm(d, axis=-1, keepdims=True))


def _position(d: Floats) -> tuple[Indices, Floats, Floats]:
    x, y, z = np.moveaxis(d / np.abs(d).sum(axis=-1, keepdims=True), -1, 0)
    below = y < 0
    s = np.where(below, np.copysign(1 - np.abs(z), x), x)
    t = np.where(below, np.copysign(1 - np.abs(x), z), z)
    return np.zeros(s.shape, dtype=np.int64), (s + 1) / 2, (t + 1) / 2


def within(s: Floats, t: Floats) -> NDArray[np.bool_]:
    """Whether points are in the square."""
    return np.asarray((s >= 0) & (s <= 1) & (t >= 0) & (t <= 1))


def _density(face: int, s: Floats, t: Floats) -> Floats:
    # A triangle of the octahedron is 1/√3 away and √3 times as large as its shadow on the plane of x and z.
    return np.asarray(np.where(within(s, t), 4 * np.linalg.norm(_unfolded(s, t), axis=-1) ** -3, 0.0))


OCTAHEDRAL = Layout("octahedral", _direction, _position, _density)
