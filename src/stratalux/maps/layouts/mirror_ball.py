"""A mirror ball, as a camera far away sees it that looks at the middle of the map: what is behind is in the middle.

The rim is the middle of the map, all around, and hardly has any texels. Areas are in proportion to solid angles.
"""

from __future__ import annotations

import numpy as np

from .layout import Floats, Indices, Layout

_LEAST = 1e-30


def _direction(face: int, s: Floats, t: Floats) -> Floats:
    # The normal of the ball is (−a, −b, −√(1 − r²)), and reflects −z, the way to the camera.
    a, b = 2 * s - 1, 2 * t - 1
    r2 = np.minimum(a * a + b * b, 1)
    slope = -2 * np.sqrt(1 - r2)
    return np.stack([a * slope, b * slope, 2 * r2 - 1], axis=-1)


def _position(d: Floats) -> tuple[Indices, Floats, Floats]:
    x, y, z = np.moveaxis(d, -1, 0)
    x = np.where((x == 0) & (y == 0), -_LEAST, x)  # what is exactly ahead is all of the rim: one point of it
    sin_θ = np.maximum(np.hypot(x, y), _LEAST)
    # The distance from the middle over sin θ, without the cancellation that each has at one end.
    stretch = np.where(z > 0, np.sqrt(np.maximum(1 + z, 0) / 2) / sin_θ, 1 / np.sqrt(2 - 2 * np.minimum(z, 0)))
    return np.zeros(x.shape, dtype=np.int64), (1 - x * stretch) / 2, (1 - y * stretch) / 2


def _density(face: int, s: Floats, t: Floats) -> Floats:
    return np.asarray(np.where(np.hypot(2 * s - 1, 2 * t - 1) <= 1, 16.0, 0.0))


MIRROR_BALL = Layout("mirror-ball", _direction, _position, _density, disc=True, rows=0.8)
