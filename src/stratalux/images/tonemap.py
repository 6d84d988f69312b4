"""From radiance to a picture that is looked at: exposure, holes, a view (:mod:`.views`), and whole numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .colour import LUMINANCE
from .views import VIEWS, encode

_MIDDLE = 0.18
_BRIGHTEST = 1e6
"""After exposure: far above what any view shows."""


@dataclass
class Meter:
    """Meters one picture, or several that get one exposure: the mean logarithm of the luminance of all pixels."""

    total: float = 0.0
    weight: float = 0.0

    def add(self, pixels: NDArray[np.float32], weight: NDArray[np.floating[Any]] | None = None) -> None:
        """Take (H, W, 3) linear ``pixels`` into account; ``weight`` (H, W): how much each counts, all the same unless
        given. Pixels that are black, below zero or not finite do not count."""
        luminance = pixels @ LUMINANCE
        lit = np.isfinite(luminance) & (luminance > 0)
        logarithms = np.log2(luminance[lit].astype(np.float64))
        weights = np.ones(logarithms.shape) if weight is None else np.asarray(weight, dtype=np.float64)[lit]
        self.total += float((weights * logarithms).sum())
        self.weight += float(weights.sum())

    @property
    def stops(self) -> float:
        """The exposure that brings the mean to middle grey; 0 where all is black."""
        return float(np.log2(_MIDDLE)) - self.total / self.weight if self.weight > 0 else 0.0


def auto_exposure(pixels: NDArray[np.float32], weight: NDArray[np.floating[Any]] | None = None) -> float:
    """Exposure in stops that brings the geometric mean of the luminance of (H, W, 3) linear pixels to 0.18.

    ``weight`` (H, W): how much each pixel counts, the coverage of an object for instance.
    """
    meter = Meter()
    meter.add(pixels, weight)
    return meter.stops


def tonemap(pixels: NDArray[np.float32], exposure: float | None = None, view: str = "reinhard") -> NDArray[np.uint8]:
    """Linear RGB (H, W, 3) to 8-bit sRGB; see :func:`view_codes`."""
    codes: NDArray[np.uint8] = whole(view_codes(pixels, exposure, view), 8)
    return codes


def view_codes(
    pixels: NDArray[np.float32], exposure: float | None = None, view: str = "reinhard"
) -> NDArray[np.floating[Any]]:
    """Linear RGB (H, W, 3) as codes of sRGB, 1 for the largest: exposure in stops (None: automatic), then a ``view``.

    Pixels below zero are filled, see :func:`filled`. What is no number is black.
    """
    if exposure is None:
        exposure = auto_exposure(pixels)
    factor = 2.0**exposure
    linear = np.clip(np.nan_to_num(filled(pixels.astype(np.float32))), 0, _BRIGHTEST / factor) * factor
    return VIEWS[view](linear)


def srgb(linear: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Linear values, 1 for white, as 8-bit sRGB (IEC 61966-2-1), clipped to what that has."""
    codes: NDArray[np.uint8] = whole(encode(linear), 8)
    return codes


def whole(codes: NDArray[np.floating[Any]], bits: int) -> NDArray[Any]:
    """Codes from 0 to 1, cut off to that, as the nearest whole numbers of 8 or 16 ``bits``."""
    most = (1 << bits) - 1
    return (np.clip(codes, 0, 1) * most + 0.5).astype(np.uint8 if bits == 8 else np.uint16)


def filled(pixels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Linear RGB (H, W, 3) with the mean of the pixels around in place of each that has a channel below zero.

    Unbiased estimates may end below zero where light is mostly shadow. A viewer would see a black hole in grey noise.
    Where all eight around are below zero too, or none is there, the channels below zero are 0.
    """
    below: NDArray[np.bool_] = np.asarray((pixels < 0).any(axis=2))
    if not below.any():
        return pixels
    sound = np.where(below[..., None], 0, pixels)
    values, weights = (np.pad(a, ((1, 1), (1, 1), (0, 0))) for a in (sound, (~below)[..., None].astype(np.float32)))
    height, width = below.shape
    corners = [(y, x) for y in range(3) for x in range(3)]
    total, count = (sum(a[y : y + height, x : x + width] for y, x in corners) for a in (values, weights))
    around = np.where(count > 0, total / np.maximum(count, 1), np.maximum(pixels, 0))
    return np.where(below[..., None], around, pixels).astype(np.float32)
