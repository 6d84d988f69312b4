"""The unshadowed light on a matte surface of any orientation, from spherical harmonics of the map (NumPy).

Ramamoorthi and Hanrahan (2001): the irradiance E(n) = ∫ L(ω) max(0, n·ω) dω is a convolution, so the coefficients of
the map times those of the clamped cosine are its own. Cut off after :data:`DEGREES`, the sum is no approximation of
another integral: it is ∫ L(ω) P(n·ω) dω, exactly, with the polynomial P that the clamped cosine has become.

Coordinates: (X, Y, Z) = (−z, x, y) of the map's frame, so that Z is the map's axis and Y/X the tangent of its φ.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import NDArray
from scipy.special import eval_legendre, lpmv

DEGREES = (0, 1, 2, 4, 6)
"""Of the other odd degrees, the clamped cosine has nothing."""
_ROWS = 64
"""Of a block that stays in the cache."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)

_Float = NDArray[np.float64]


def zonal_coefficients() -> _Float:
    """A_l of max(0, t) = Σ_l (2l + 1) / 4π · A_l P_l(t), for :data:`DEGREES`; A_0 = π."""
    nodes, weights = np.polynomial.legendre.leggauss(32)
    t, weight = (nodes + 1) / 2, weights / 2  # from 0 to 1, where the function is smooth
    return np.array([2 * np.pi * np.sum(weight * t * eval_legendre(degree, t)) for degree in DEGREES])


def clamped_cosine() -> _Float:
    """Coefficients of P, the powers of t from 0 up: what max(0, t) is without the other degrees."""
    series = np.zeros(max(DEGREES) + 1)
    for degree, A in zip(DEGREES, zonal_coefficients(), strict=True):
        series[degree] = (2 * degree + 1) / (4 * np.pi) * A
    return np.asarray(np.polynomial.legendre.leg2poly(series), dtype=np.float64)


def irradiance_coefficients(texels: NDArray[np.float32]) -> dict[int, _Float]:
    """A_l L_lm of a map (H, W, C), each (C,), by the index l (l + 1) + m of the real harmonic; exact.

    The radiance is that of the lookup, bilinear between texels (see :mod:`stratalux.geometry`), and so its integrals
    are sums over the texels, with weights for each row times weights for each column.
    """
    height, width, channels = texels.shape
    pairs = [(degree, m) for degree in DEGREES for m in range(degree + 1)]
    rows = np.stack([_row_weights(height, degree, m) for degree, m in pairs]).astype(np.float32)
    by_column = np.zeros((len(pairs), width, channels))
    for first in range(0, height, _ROWS):
        block = texels[first : first + _ROWS]
        by_column += (rows[:, first : first + _ROWS] @ block.reshape(len(block), -1)).reshape(by_column.shape)
    phi = 2 * np.pi * (np.arange(width) + 0.5) / width
    A = dict(zip(DEGREES, zonal_coefficients(), strict=True))
    result = {}
    for (degree, m), columns in zip(pairs, by_column, strict=True):
        hat = 2 * np.pi / width * np.sinc(m / width) ** 2  # of the hat function around a column
        for sign, wave in ((1, np.cos), (-1, np.sin)):
            if m or sign > 0:
                result[degree * (degree + 1) + sign * m] = A[degree] * hat * (wave(m * phi) @ columns)
    return result


def _row_weights(height: int, degree: int, m: int) -> _Float:
    """∫ hat(θ) K P_lm(cos θ) sin θ dθ around each row of texels, (H,); K makes the harmonic orthonormal."""
    norm = (2 * degree + 1) / (4 * np.pi) * factorial(degree - m) / factorial(degree + m) * (2 if m else 1)
    step = np.pi / (height - 1)
    t = (_NODES + 1) / 2
    theta = step * (np.arange(height - 1)[:, None] + t)
    values = np.sqrt(norm) * lpmv(m, degree, np.cos(theta)) * np.sin(theta) * _WEIGHTS * step / 2
    weights = np.zeros(height)
    weights[:-1] += values @ (1 - t)
    weights[1:] += values @ t
    return weights
