"""Latitude and longitude, as :mod:`..geometry` has them: the zenith in the first row, the middle at +z."""

from __future__ import annotations

import numpy as np

from ..geometry import direction, map_coordinates
from .layout import Floats, Indices, Layout


def _direction(face: int, s: Floats, t: Floats) -> Floats:
    return direction(s, t)


def _position(d: Floats) -> tuple[Indices, Floats, Floats]:
    u, v = map_coordinates(d)
    return np.zeros(u.shape, dtype=np.int64), u, v


def _density(face: int, s: Floats, t: Floats) -> Floats:
    inside = (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    return np.asarray(np.where(inside, 2 * np.pi**2 * np.sin(np.pi * t), 0.0))


LATLONG = Layout("latlong", _direction, _position, _density, wide=2, edges=(False, True), closed=True)
