"""Real spherical harmonics up to degree 2, as ambient light has them.

Y_00, Y_1−1, Y_10, Y_11, Y_2−2 … Y_22 of x, y, z, orthonormal, with positive signs: 0.282 · 1, 0.489 · (y, z, x),
1.093 · (xy, yz), 0.315 · (3z² − 1), 1.093 · xz, 0.546 · (x² − y²). These are those of Ramamoorthi and Hanrahan (2001),
and of three.js.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..maps.geometry import direction, texel_solid_angle
from ..maps.irradiance import irradiance_coefficients

_Float = NDArray[np.float64]

COSINE = np.pi * np.array([1] + 3 * [2 / 3] + 5 * [1 / 4])
"""A_l of the clamped cosine for each of the nine: irradiance is their product with the coefficients of radiance."""
_C = np.sqrt(np.array([1, 3, 3, 3, 15, 15, 5 / 4, 15, 15 / 4]) / (4 * np.pi))


def harmonics(omega: _Float) -> _Float:
    """The nine harmonics (..., 9) in the directions ``omega`` (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(omega, dtype=np.float64), -1, 0)
    values = [np.ones_like(x), y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y]
    return np.asarray(_C * np.stack(values, axis=-1))


def of_radiance(texels: NDArray[np.float32]) -> _Float:
    """The coefficients (9, 3) of a latitude-longitude map (H, W, 3), exact for its bilinear radiance."""
    found = irradiance_coefficients(texels)
    # There, Z is our y, X our −z and Y our x, and harmonics of odd order have the other sign.
    c = [found[k] / COSINE[k] for k in range(9)]
    r = np.sqrt(3) / 2
    across = [r * c[8] - c[6] / 2, -r * c[6] - c[8] / 2]
    return np.array([c[0], c[2], c[3], -c[1], -c[5], c[7], across[0], -c[4], across[1]])


def turned(coefficients: _Float, rotation: _Float) -> _Float:
    """The coefficients (9, 3) of what ``rotation`` (3, 3) has turned."""
    if not np.any(coefficients[1:]):
        return coefficients
    omega = _directions()
    # A degree stays a degree: enough directions tell its new coefficients exactly.
    basis, seen = harmonics(omega), harmonics(omega @ rotation) @ coefficients
    return np.asarray(np.linalg.lstsq(basis, seen, rcond=None)[0])


def ambient_map(coefficients: _Float, height: int = 32) -> NDArray[np.float32]:
    """The radiance of ``coefficients`` as a map (height, 2 · height, 3), for tools that have no harmonics.

    Where it is negative it becomes 0, and the rest is scaled so that the mean stays.
    """
    width = 2 * height
    u, v = (np.arange(width) + 0.5) / width, np.arange(height) / (height - 1)
    texels = harmonics(direction(*np.broadcast_arrays(u[None, :], v[:, None]))) @ coefficients
    weight = texel_solid_angle(height, width)[..., None]
    kept = np.maximum(texels, 0)
    wanted, there = np.maximum(np.sum(weight * texels, axis=(0, 1)), 0), np.sum(weight * kept, axis=(0, 1))
    return (kept * np.divide(wanted, there, out=np.zeros(3), where=there > 0)).astype(np.float32)


def _directions() -> _Float:
    k = np.arange(32) + 0.5
    z, φ = 1 - k / 16, k * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(φ), r * np.sin(φ), z], axis=-1)
