"""Colours of lights as tools store them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_LEAST_CODE = 160
"""Of the largest component: below, the others have less to choose from, too."""


def encoded(linear: Sequence[float]) -> list[float]:
    """Linear components between 0 and 1 through the curve of sRGB (IEC 61966-2-1)."""
    return [12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055 for c in linear]


def decoded(codes: NDArray[np.integer]) -> NDArray[np.float64]:
    """Linear components of whole numbers up to 255."""
    e = np.asarray(codes, dtype=np.float64) / 255
    return np.where(e <= 0.04045, e / 12.92, ((e + 0.055) / 1.055) ** 2.4)


def eight_bits(colour: NDArray[np.float64]) -> tuple[list[int], float]:
    """A colour (3,) as three bytes of sRGB and the strength that, times them, is the light.

    Where a tool keeps 8 bits, a rounded component may be off by 0.5 per cent of the largest one. The strength is free,
    so of all codes that the largest component can have, the one is taken for which the others are met best.
    """
    largest = float(colour.max())
    if not largest:
        return [255, 255, 255], 0.0
    top = np.arange(255, _LEAST_CODE - 1, -1)
    tint = colour / largest * decoded(top)[:, None]
    steps = decoded(np.arange(256))
    above = np.clip(np.searchsorted(steps, tint), 1, 255)
    codes = np.where(tint - steps[above - 1] < steps[above] - tint, above - 1, above)
    off = np.abs(steps[codes] / decoded(top)[:, None] - colour / largest).max(axis=1)
    best = int(np.argmin(off))
    return codes[best].tolist(), largest / float(decoded(top)[best])
