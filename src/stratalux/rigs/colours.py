"""Colours of lights as tools store them."""

from __future__ import annotations

from collections.abc import Sequence


def encoded(linear: Sequence[float]) -> list[float]:
    """Linear components between 0 and 1 through the curve of sRGB (IEC 61966-2-1)."""
    return [12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055 for c in linear]
