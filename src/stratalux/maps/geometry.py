"""Latitude-longitude geometry: directions, lattice rows and solid angles.

Conventions are those of Mitsuba's ``envmap`` emitter, in the emitter's local frame, y up. A map has H rows and W
columns of texels. A direction has coordinates u = φ / 2π in [0, 1) and v = θ / π in [0, 1]:

    ω = (sin φ sin θ, cos θ, −cos φ sin θ)

Texel (i, j) is a *lattice point* at v = i / (H − 1), u = (j + ½) / W, and the radiance is bilinear between lattice
points. The map therefore consists of (H − 1) x W *cells*; cell (i, j) spans texel rows i, i + 1 and texel columns
j, j + 1 (mod W). Partitions are made of cells, not of texels, because that is where the lookup is one smooth piece.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def direction(u: FloatArray, v: FloatArray) -> FloatArray:
    """Unit vectors (..., 3) of the map coordinates ``u`` and ``v`` (each (...))."""
    phi, theta = 2 * np.pi * np.asarray(u), np.pi * np.asarray(v)
    sin_theta = np.sin(theta)
    return np.stack([np.sin(phi) * sin_theta, np.cos(theta), -np.cos(phi) * sin_theta], axis=-1)


def map_coordinates(omega: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Map coordinates (u, v) of unit vectors (..., 3); the inverse of :func:`direction`."""
    omega = np.asarray(omega)
    u = np.arctan2(omega[..., 0], -omega[..., 2]) / (2 * np.pi)
    return u - np.floor(u), np.arccos(np.clip(omega[..., 1], -1, 1)) / np.pi


def row_weights(height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Exact weights of the upper and the lower lattice row of each of the ``height`` − 1 rows of cells.

    With t in [0, 1] across a row of cells, upper = ∫ (1 − t) sin θ dθ and lower = ∫ t sin θ dθ, so that the
    integral over solid angle of the bilinear radiance in cell (i, j) is

        Δφ · (upper[i] · (L[i, j] + L[i, j + 1]) + lower[i] · (L[i + 1, j] + L[i + 1, j + 1])) / 2.

    Both are positive in every row, the polar ones included.
    """
    theta = np.linspace(0, np.pi, height)
    step = np.pi / (height - 1)
    mean_cos = np.diff(np.sin(theta)) / step
    return np.cos(theta[:-1]) - mean_cos, mean_cos - np.cos(theta[1:])


def cell_solid_angle(height: int, width: int) -> NDArray[np.float64]:
    """Solid angle in steradians of one cell of each row, shape (height − 1,)."""
    return 2 * np.pi / width * -np.diff(np.cos(np.linspace(0, np.pi, height)))


def texel_solid_angle(height: int, width: int) -> NDArray[np.float64]:
    """Solid angle in steradians that each texel stands for, (height, width), read-only; their sum is 4π.

    It is the integral of the texel's hat function, so that Σ L · weight over the texels is exactly the integral over
    solid angle of the bilinear radiance.
    """
    upper, lower = row_weights(height)
    rows = np.zeros(height)
    rows[:-1] += upper
    rows[1:] += lower
    return np.broadcast_to(2 * np.pi / width * rows[:, None], (height, width))
