"""What is known of colours: linear sRGB, its luminance, and what becomes of other primaries and curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

LUMINANCE = np.array([0.212671, 0.715160, 0.072169], dtype=np.float32)
"""Rec. 709 luminance weights, those of Mitsuba's ``luminance()``."""

REC709 = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
"""CIE x and y of red, green, blue and white (ITU-R BT.709; OpenEXR's default)."""
PRIMARIES = {
    "rec709": REC709,
    "p3d65": (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329),
    "rec2020": (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329),
    "adobergb": (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.329),
    "ap0": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767),
    "ap1": (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767),
    "ciexyzd65": (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.3127, 0.329),
}
"""By their names in the colour spaces of the Academy Software Foundation's Color Interop Forum: SMPTE RP 431-2, ITU-R
BT.2020, Adobe RGB (1998), SMPTE ST 2065-1 and S-2014-004."""
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
_SAME = 1e-3
"""Distance of coordinates from those of Rec. 709 that makes no difference."""
_ROWS = 64

_Matrix = NDArray[np.float64]


def to_rec709(primaries: Sequence[float]) -> _Matrix | None:
    """The matrix that makes linear Rec. 709 of colours with those ``primaries``; None where they are the same.

    ``primaries``: CIE x and y of red, green, blue and white. Other whites are adapted as Bradford's does it (Lindbloom,
    "Chromatic adaptation"). Raises :class:`ValueError` for what are no primaries.
    """
    given = np.asarray(primaries, dtype=np.float64)
    if given.shape != (8,) or not np.isfinite(given).all():
        raise ValueError("no eight numbers")
    if np.abs(given - REC709).max() < _SAME:
        return None
    return np.linalg.inv(_to_xyz(REC709)) @ _adaptation(given[6:]) @ _to_xyz(given)


def xyz_to_rec709(white: Sequence[float]) -> _Matrix:
    """The matrix that makes linear Rec. 709 of CIE XYZ, and (1, 1, 1) of the ``white`` (x, y) of luminance 1."""
    return np.linalg.inv(_to_xyz(REC709)) @ _adaptation(np.asarray(white, dtype=np.float64))


def transform(pixels: NDArray[np.float32], matrix: _Matrix) -> None:
    """Replace the colours of (H, W, 3) ``pixels`` by ``matrix`` times themselves."""
    for first in range(0, len(pixels), _ROWS):
        block = pixels[first : first + _ROWS]
        block[...] = np.einsum("ij,...j->...i", matrix, block, dtype=np.float64)


def decode(pixels: NDArray[np.floating[Any]], curve: str | float) -> None:
    """Make ``pixels`` linear that follow the ``srgb`` curve (IEC 61966-2-1) or are a power 1 / ``curve``; in place."""
    for first in range(0, len(pixels), _ROWS):
        block = pixels[first : first + _ROWS]
        if isinstance(curve, str):
            bright = np.power((np.maximum(block, 0.04045) + 0.055) / 1.055, 2.4)
            block[...] = np.where(block <= 0.04045, block / 12.92, bright)
        else:
            block[...] = np.sign(block) * np.power(np.abs(block), curve)


def luminance_weights(primaries: Sequence[float]) -> NDArray[np.float64]:
    """What red, green and blue of those ``primaries`` have a part of in the luminance, (3,)."""
    weights: NDArray[np.float64] = _to_xyz(np.asarray(primaries, dtype=np.float64))[1]
    return weights


def _to_xyz(primaries: Sequence[float] | NDArray[np.float64]) -> _Matrix:
    """CIE XYZ of red, green and blue, as columns; white has the luminance 1 (SMPTE RP 177)."""
    x, y = np.asarray(primaries, dtype=np.float64).reshape(4, 2).T
    columns = np.array([x[:3], y[:3], 1 - x[:3] - y[:3]])
    if abs(np.linalg.det(columns)) < 1e-6:
        raise ValueError("primaries on one line")
    xyz: _Matrix = columns * np.linalg.solve(columns, _white(x[3], y[3]))
    return xyz


def _white(x: float, y: float) -> NDArray[np.float64]:
    return np.array([x / y, 1, (1 - x - y) / y])


def _adaptation(white: NDArray[np.float64]) -> _Matrix:
    """XYZ under that ``white`` to XYZ under D65."""
    if not 0 < white[1] < 1 or not 0 < white[0] < 1:
        raise ValueError("a white without light")
    source, target = (_BRADFORD @ _white(*w) for w in (white, np.array(REC709[6:])))
    adapted: _Matrix = np.linalg.inv(_BRADFORD) @ np.diag(target / source) @ _BRADFORD
    return adapted
