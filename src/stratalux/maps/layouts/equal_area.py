"""The square of equal areas that pbrt-v4 has for its maps, here for NumPy, and its formulas for others.

The square [0, 1]² is mapped to the sphere by folding an octahedron (P. Clarberg, *Fast equal-area mapping of the
(hemi)sphere using SIMD*, 2008). With p = 2s − 1 and d = 1 − |p_x| − |p_y|, the diamond d ≥ 0 is the upper hemisphere
and the four corners beyond it fold down to the lower one, and with r = 1 − |d|, the distance from the pole,

    cos θ = ±(1 − r²),    φ = (π / 2) t  in the first quadrant,    t = |p_y| / r above, (1 − |p_x|) / r below.

The part of the square within r of a pole has area r² / 2 of its total of 1, the cap of the sphere 2π r² of its 4π, and
t is proportional to the area on both: areas are in proportion everywhere, so a density per unit of the square is 4π
times the density per steradian. (θ, φ) are those of :mod:`..geometry`, y up. That is how pbrt-v4's ``imgtool
makeequiarea`` makes one of latitude and longitude: its axes (x, y, z) are our (−z, x, y).
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from .layout import Floats, Indices, Layout
from .octahedral import folded, within

Array = Any
"""Of NumPy, or of another library."""


def _ratio(a: Floats, b: Floats) -> Floats:
    return np.divide(a, b, out=np.zeros_like(b), where=b > 0)


NUMPY = SimpleNamespace(
    abs=np.abs,
    arctan2=np.arctan2,
    copysign=np.copysign,
    ratio=_ratio,
    rsqrt=lambda x: 1 / np.sqrt(x),
    sincos=lambda x: (np.sin(x), np.cos(x)),
    sqrt=np.sqrt,
    where=np.where,
)
"""The functions of a library of arrays that the formulas need; ``ratio``: a / b, and 0 where b is not above 0."""


def fold(x: Array, y: Array, of: SimpleNamespace = NUMPY) -> tuple[Array, Array, Array]:
    """(t, r, whether d ≥ 0) of |p_x| and |p_y|."""
    upper = x + y <= 1
    r = of.where(upper, x + y, (1 - x) + (1 - y))
    return of.ratio(of.where(upper, y, 1 - x), r), r, upper


def to_direction(x: Array, y: Array, of: SimpleNamespace = NUMPY) -> tuple[Array, Array, Array]:
    """The unit direction of p_x and p_y, from −1 to 1."""
    t, r, upper = fold(of.abs(x), of.abs(y), of)
    sin, cos = of.sincos(0.5 * np.pi * t)
    sin_theta = r * of.sqrt(2 - r * r)
    return (
        of.copysign(sin, y) * sin_theta,
        of.where(upper, 1, -1) * (1 - r * r),
        -of.copysign(cos, x) * sin_theta,
    )


def to_square(x: Array, y: Array, z: Array, of: SimpleNamespace = NUMPY) -> tuple[Array, Array]:
    """s_x and s_y, from 0 to 1, of a unit direction; the inverse of :func:`to_direction`."""
    sin_theta = of.sqrt(x * x + z * z)
    r = sin_theta * of.rsqrt(1 + of.abs(y))  # = √(1 − |cos θ|), without its cancellation
    t = of.arctan2(of.abs(x), of.abs(z)) * (2 / np.pi)
    upper = y >= 0
    a = of.where(upper, (1 - t) * r, 1 - t * r)
    b = of.where(upper, t * r, 1 - (1 - t) * r)
    return 0.5 * of.copysign(a, -z) + 0.5, 0.5 * of.copysign(b, x) + 0.5


def _direction(face: int, s: Floats, t: Floats) -> Floats:
    return np.stack(to_direction(*folded(s, t)), axis=-1)


def _position(d: Floats) -> tuple[Indices, Floats, Floats]:
    s, t = to_square(*np.moveaxis(d, -1, 0))
    return np.zeros(s.shape, dtype=np.int64), s, t


def _density(face: int, s: Floats, t: Floats) -> Floats:
    return np.asarray(np.where(within(s, t), 4 * np.pi, 0.0))


EQUAL_AREA = Layout("equal-area", _direction, _position, _density)
