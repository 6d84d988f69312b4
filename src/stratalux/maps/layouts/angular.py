"""The angular map of light probes: the middle of the map in the middle, and what is behind all around the rim.

The distance from the middle is the angle from there, in proportion. Source: P. Debevec, "Light Probe Image Gallery",
whose axes are ours turned by 180 degrees about y.
"""

from __future__ import annotations

import numpy as np

from .layout import Floats, Indices, Layout

_LEAST = 1e-30


def _direction(face: int, s: Floats, t: Floats) -> Floats:
    a, b = 2 * s - 1, 2 * t - 1
    θ = np.pi * np.hypot(a, b)
    # sin θ over the distance, which is 0 in the middle.
    slope = np.pi * np.sinc(θ / np.pi)
    return np.stack([-a * slope, -b * slope, np.cos(θ)], axis=-1)


def _position(d: Floats) -> tuple[Indices, Floats, Floats]:
    x, y, z = np.moveaxis(d, -1, 0)
    x = np.where((x == 0) & (y == 0), -_LEAST, x)  # what is exactly behind is all of the rim: one point of it
    sin_θ = np.maximum(np.hypot(x, y), _LEAST)
    stretch = np.arctan2(sin_θ, z) / np.pi / sin_θ
    return np.zeros(x.shape, dtype=np.int64), (1 - x * stretch) / 2, (1 - y * stretch) / 2


def _density(face: int, s: Floats, t: Floats) -> Floats:
    r = np.hypot(2 * s - 1, 2 * t - 1)
    return np.asarray(np.where(r <= 1, 4 * np.pi**2 * np.sinc(r), 0.0))


ANGULAR = Layout("angular", _direction, _position, _density, disc=True, rows=0.5)
