"""Maps out of focus: convolved with a round kernel on the sphere, by spherical harmonics.

Source of the transform: Driscoll and Healy, "Computing Fourier transforms and convolutions on the 2-sphere" (1994);
of the recurrence of the normalised Legendre functions: Holmes and Featherstone (2002), equations 11 and 12.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .geometry import texel_solid_angle

LEAST_DEGREES, MOST_DEGREES = 1.0, 180.0
_REACH = 4.0
"""Harmonics are kept up to so many over the kernel's width, which leaves exp(-8) of them."""
_ROWS = 64

Floats = NDArray[np.float64]


def blurred(texels: NDArray[np.float32], degrees: float) -> NDArray[np.float32]:
    """A latitude-longitude map (H, W, 3) convolved with the heat kernel of the sphere.

    `degrees`: the kernel's standard deviation along any one direction, from 1 to 180; less or more are taken for these.
    Returns a map as large as what is left needs, float32, without negative numbers. The light of all the sphere stays
    the same to 0.2 %.
    """
    width = np.radians(np.clip(degrees, LEAST_DEGREES, MOST_DEGREES))
    order = max(int(np.ceil(_REACH / width)), 6)
    height = 4 * order + 1
    texels = _at_least(texels, height)
    rows, columns = texels.shape[:2]
    waves = _waves(texels, min(order, columns // 2))
    theta = np.concatenate([np.linspace(0, np.pi, rows), np.linspace(0, np.pi, height)])
    # Columns are at the middles of texels: of both maps, (k + 1/2) of their width.
    result = np.zeros((height, height + 1, 3), dtype=np.complex128)
    for m, legendre in enumerate(_legendre(order, theta, waves.shape[1])):
        degree = np.arange(m, order + 1)
        content = np.exp(-degree * (degree + 1) * width**2 / 2)[:, None] * (legendre[:, :rows] @ waves[:, m])
        shift = np.exp(1j * np.pi * m * (1 / (2 * height) - 1 / columns))
        result[:, m] = legendre[:, rows:].T @ content * shift * (2 * height)
    return np.maximum(np.fft.irfft(result, n=2 * height, axis=1), 0).astype(np.float32)


def _at_least(texels: NDArray[np.float32], height: int) -> NDArray[np.float32]:
    """A map of at least `height` rows, and twice as many columns: what lies between texels is interpolated."""
    rows, columns = texels.shape[:2]
    if rows < height:
        at = np.linspace(0, rows - 1, height)
        low = np.minimum(at.astype(np.int64), rows - 2)
        share = (at - low).astype(np.float32)[:, None, None]
        texels = texels[low] * (1 - share) + texels[low + 1] * share
    if columns < 2 * height:
        at = (np.arange(2 * height) + 0.5) * columns / (2 * height) - 0.5
        low = np.floor(at).astype(np.int64)
        share = (at - low).astype(np.float32)[:, None]
        texels = texels[:, low % columns] * (1 - share) + texels[:, (low + 1) % columns] * share
    return texels


def _waves(texels: NDArray[np.float32], order: int) -> NDArray[np.complex128]:
    """The Fourier transform along each row of energies, up to `order`, (H, order + 1, 3)."""
    weights = texel_solid_angle(*texels.shape[:2])
    found = np.empty((len(texels), order + 1, 3), dtype=np.complex128)
    for first in range(0, len(texels), _ROWS):
        rows = slice(first, first + _ROWS)
        energies = texels[rows] * np.broadcast_to(weights, texels.shape[:2])[rows, :, None]
        found[rows] = np.fft.rfft(energies, axis=1)[:, : order + 1]
    return found


def _legendre(order: int, theta: Floats, count: int) -> Iterator[Floats]:
    """For m = 0 to `count` - 1 the functions of degrees m to `order` at N angles, (order + 1 - m, N).

    They are normalised: their squares, over the sphere, are 1.
    """
    x, sine = np.cos(theta), np.sin(theta)
    first = np.full_like(theta, np.sqrt(1 / (4 * np.pi)))
    for m in range(count):
        if m:
            first = first * np.sqrt((2 * m + 1) / (2 * m)) * sine
        functions = np.empty((order + 1 - m, len(theta)))
        functions[0] = first
        if m < order:
            functions[1] = np.sqrt(2 * m + 3) * x * first
        for k in range(2, order + 1 - m):
            degree = m + k
            a = np.sqrt((4 * degree**2 - 1) / (degree**2 - m**2))
            b = np.sqrt(
                ((2 * degree + 1) * (degree - 1 + m) * (degree - 1 - m)) / ((2 * degree - 3) * (degree**2 - m**2))
            )
            functions[k] = a * x * functions[k - 1] - b * functions[k - 2]
        yield functions
