"""The unshadowed light on a matte surface of any orientation, from spherical harmonics of the map (NumPy).

Ramamoorthi and Hanrahan (2001): the irradiance E(n) = ∫ L(ω) max(0, n·ω) dω is a convolution, so the coefficients of
the map times those of the clamped cosine are its own. Cut off after :data:`DEGREES`, the sum is no approximation of
another integral: it is ∫ L(ω) P(n·ω) dω, exactly, with the polynomial P that the clamped cosine has become.

Coordinates: (X, Y, Z) = (−z, x, y) of the map's frame, so that Z is the map's axis and Y/X the tangent of its φ.
"""

from __future__ import annotations

from functools import cache, lru_cache
from math import factorial
from typing import Any

import numpy as np
from numpy.polynomial.legendre import leg2poly, leggauss, legval
from numpy.polynomial.polynomial import polyder
from numpy.typing import NDArray

from ..images.half import single

DEGREES = (0, 1, 2, 4, 6)
"""Of the other odd degrees, the clamped cosine has nothing."""
_PAIRS = [(degree, m) for degree in DEGREES for m in range(degree + 1)]
"""Degrees and orders of the harmonics, without those that differ from them in the sign of the order."""
_ROWS, _COLUMNS = 64, 192
"""Of a product so small that OpenBLAS takes one thread: others would go on to spin, where cores are needed."""
_MANY_ROWS = 256
"""From there on, two nodes between rows are as exact as single precision asks for."""
_NODES = 2048
"""Along a circle of latitude, at least, to integrate over a hemisphere, whose rim has a kink."""

_Float = NDArray[np.float64]


@cache
def zonal_coefficients() -> _Float:
    """A_l of max(0, t) = Σ_l (2l + 1) / 4π · A_l P_l(t), for :data:`DEGREES`; A_0 = π."""
    nodes, weights = leggauss(32)
    t, weight = (nodes + 1) / 2, weights / 2  # from 0 to 1, where the function is smooth
    return np.array([2 * np.pi * np.sum(weight * t * legval(t, [0] * degree + [1])) for degree in DEGREES])


def clamped_cosine() -> _Float:
    """Coefficients of P, the powers of t from 0 up: what max(0, t) is without the other degrees."""
    series = np.zeros(max(DEGREES) + 1)
    for degree, A in zip(DEGREES, zonal_coefficients(), strict=True):
        series[degree] = (2 * degree + 1) / (4 * np.pi) * A
    return np.asarray(leg2poly(series), dtype=np.float64)


def irradiance_coefficients(texels: NDArray[Any]) -> dict[int, _Float]:
    """A_l L_lm of a map (H, W, C), each (C,), by the index l (l + 1) + m of the real harmonic; exact.

    The radiance is that of the lookup, bilinear between texels (see :mod:`.maps.geometry`), and so its integrals
    are sums over the texels, with weights for each row times weights for each column.
    """
    height, width, channels = texels.shape
    rows = _row_weights(height)
    by_column: NDArray[np.float64] = np.zeros((len(_PAIRS), width * channels))
    whole = width * channels // _COLUMNS * _COLUMNS
    for first in range(0, height, _ROWS):
        weights = rows[:, first : first + _ROWS]
        block = single(texels[first : first + _ROWS]).reshape(-1, width * channels)
        parts = block[:, :whole].reshape(len(block), -1, _COLUMNS).swapaxes(0, 1)
        by_column[:, :whole] += (weights @ parts).swapaxes(0, 1).reshape(len(_PAIRS), whole)
        by_column[:, whole:] += weights @ block[:, whole:]
    by_column = by_column.reshape(len(_PAIRS), width, channels)
    phi = 2 * np.pi * (np.arange(width) + 0.5) / width
    orders = np.arange(max(DEGREES) + 1)
    hat = 2 * np.pi / width * np.sinc(orders / width) ** 2  # ∫ of the hat function around a column, times a wave
    cosines, sines = (hat[:, None] * wave(orders[:, None] * phi) for wave in (np.cos, np.sin))
    even, odd = cosines @ by_column, sines @ by_column  # (pairs, orders, C)
    A = dict(zip(DEGREES, zonal_coefficients(), strict=True))
    result = {}
    for pair, (degree, m) in enumerate(_PAIRS):
        result[degree * (degree + 1) + m] = A[degree] * even[pair, m]
        if m:
            result[degree * (degree + 1) - m] = A[degree] * odd[pair, m]
    return result


def irradiance(texels: NDArray[Any], normal: NDArray[np.float64]) -> _Float:
    """E(n) = ∫ L(ω) max(0, n·ω) dω of a map (H, W, C) for one ``normal`` of its frame, (C,).

    The cosine is the real one. By the midpoint rule between texels, where the radiance is bilinear; exact to 10⁻⁵ of
    what the map sends in all.
    """
    height, width, channels = texels.shape
    nodes = -(-_NODES // width)
    t = (np.arange(nodes) + 0.5) / nodes
    phi = 2 * np.pi / width * (np.arange(width)[:, None] + 0.5 + t).ravel()
    around = normal[0] * np.sin(phi) - normal[2] * np.cos(phi)
    step = np.pi / (height - 1) / nodes
    E = np.zeros(channels)
    for first in range(height - 1):
        theta = (first + t) * step * nodes
        sin_θ, cos_θ = np.sin(theta)[:, None], np.cos(theta)[:, None]
        cells = (np.maximum(normal[1] * cos_θ + sin_θ * around, 0) * sin_θ).reshape(nodes, width, nodes)
        left = cells @ (1 - t)
        weights = left + np.roll(cells.sum(axis=2) - left, 1, axis=1)  # of each column, (nodes, W)
        upper, lower = single(texels[first : first + 2])
        E += ((1 - t) @ weights) @ upper + (t @ weights) @ lower
    return E * step * (2 * np.pi / width / nodes)


@lru_cache(maxsize=4)
def _row_weights(height: int) -> NDArray[np.float32]:
    """∫ hat(θ) K P_lm(cos θ) sin θ dθ around each row of texels, (pairs, H); K makes the harmonic orthonormal."""
    degree, m = np.array(_PAIRS).T
    nodes, weight = leggauss(4 if height < _MANY_ROWS else 2)
    t, step = (nodes + 1) / 2, np.pi / (height - 1)
    theta = step * (np.arange(height - 1)[:, None] + t)
    below, above = (np.array([factorial(n) for n in numbers.tolist()]) for numbers in (degree - m, degree + m))
    K = np.sqrt((2 * degree + 1) / (4 * np.pi) * below / above * np.where(m, 2, 1))
    x, sin_θ = np.cos(theta), np.sin(theta)
    measure = sin_θ * weight * step / 2
    powers = np.cumprod([measure, *[-sin_θ] * max(DEGREES)], axis=0)
    derivatives = np.array([K * _derivative(*pair) for K, *pair in zip(K, degree.tolist(), m.tolist(), strict=True)])
    values = np.tensordot(derivatives, np.cumprod([np.ones_like(x), *[x] * max(DEGREES)], axis=0), 1) * powers[m]
    weights = np.zeros((len(m), height))
    weights[:, :-1] += values @ (1 - t)
    weights[:, 1:] += values @ t
    return weights.astype(np.float32)


@cache
def _derivative(degree: int, m: int) -> _Float:
    """The m-th derivative of the Legendre polynomial, which makes P_lm with (−sin θ)^m: its powers, from 0 up."""
    coefficients = np.zeros(max(DEGREES) + 1)
    derivative = polyder(leg2poly([0] * degree + [1]), m)
    coefficients[: len(derivative)] = derivative
    return coefficients
