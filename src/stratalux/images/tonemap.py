"""From radiance to a picture that is looked at: exposure, a shoulder, holes, and the curve of sRGB."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .colour import LUMINANCE


def auto_exposure(pixels: NDArray[np.float32]) -> float:
    """Exposure in stops that brings the geometric mean of the luminance of (H, W, 3) linear pixels to 0.18."""
    luminance = pixels @ LUMINANCE
    luminance = luminance[np.isfinite(luminance) & (luminance > 0)]
    if not luminance.size:
        return 0.0
    return float(np.log2(0.18) - np.log2(luminance.astype(np.float64)).mean())


def tonemap(pixels: NDArray[np.float32], exposure: float | None = None) -> NDArray[np.uint8]:
    """Linear RGB (H, W, 3) to 8-bit sRGB: exposure in stops (None: automatic), then a soft shoulder.

    The shoulder is Reinhard's extended operator on luminance (Reinhard et al. 2002, equation 4) with its white point
    16 times above middle white, so colours keep their hue. Pixels below zero are filled, see :func:`filled`.
    """
    if exposure is None:
        exposure = auto_exposure(pixels)
    linear = np.clip(np.nan_to_num(filled(pixels.astype(np.float32))) * 2.0**exposure, 0, 1e6)
    luminance = (linear @ LUMINANCE)[..., None]
    white = 16.0
    linear = linear * (1 + luminance / white**2) / (1 + luminance)
    # Middle grey keeps its brightness: undo what the shoulder takes from it.
    return srgb(linear * 1.18)


def srgb(linear: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Linear values, 1 for white, as 8-bit sRGB (IEC 61966-2-1), clipped to what that has."""
    linear = np.clip(linear, 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(encoded * 255 + 0.5).astype(np.uint8)


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
