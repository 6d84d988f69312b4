"""How far an image is from a reference: RMSE, relative MSE, and HDR-FLIP.

Images are linear (H, W, C), of any floating-point type; sums are taken in double precision. A ``mask`` (H, W) restricts
the mean to its pixels. Whatever is not a number, or infinite, in an image makes the figure so too.
"""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .colour import LUMINANCE

Image = NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]

RELATIVE_EPSILON = 0.01
"""ε of :func:`relative_mse`; images are thought to be exposed so that a mean of about 0.2 is usual."""

_BLACK = 1e-5
"""HDR-FLIP finds no exposures for a reference whose maximum is below this, and ends the process."""


def rmse(image: Image, reference: Image, mask: Mask | None = None) -> float:
    """RMS error √mean (I − R)² over pixels and channels, in the unit of the image (Mei, Jaeger and Hu, section 4)."""
    return float(np.sqrt(np.mean((_selected(image, mask) - _selected(reference, mask)) ** 2)))


def relative_mse(image: Image, reference: Image, mask: Mask | None = None) -> float:
    """Mean of (I − R)² / (R² + ε) over pixels and channels, ε = 0.01: free of a unit, so that dark pixels count too.

    Rousselle, Knaus and Zwicker 2011, section 6.
    """
    truth = _selected(reference, mask)
    return float(np.mean((_selected(image, mask) - truth) ** 2 / (truth**2 + RELATIVE_EPSILON)))


def flip(image: Image, reference: Image, mask: Mask | None = None) -> float:
    """Mean of :func:`flip_map`; NaN where there is none."""
    differences = flip_map(image, reference)
    if differences is None:
        return float("nan")
    return float(np.mean(differences if mask is None else differences[mask], dtype=np.float64))


def flip_map(image: Image, reference: Image) -> NDArray[np.float32] | None:
    """HDR-FLIP (H, W) in [0, 1], a difference as a person would see it who flips between the two images.

    Andersson, Nilsson, Shirley and Akenine-Möller 2021, with NVIDIA's own package and defaults: 67 pixels per degree,
    ACES, exposures from the reference. Negative values count as 0, and one channel as grey. None where the reference
    is black, where FLIP is not defined, or an image is not finite. Raises :class:`ImportError` if :func:`why_no_flip`.
    """
    import flip_evaluator

    test, truth = (_colour(pixels) for pixels in (image, reference))
    if not (np.isfinite(test).all() and np.isfinite(truth).all()) or (truth @ LUMINANCE).max() < _BLACK:
        return None
    differences: NDArray[np.float32] = flip_evaluator.evaluate(truth, test, "HDR", applyMagma=False)[0][..., 0]
    return differences


def why_no_flip() -> str | None:
    """What to install for :func:`flip`, or None if it works."""
    if importlib.util.find_spec("flip_evaluator") is None:
        return "HDR-FLIP is left out: pip install 'stratalux[compare]' (or flip-evaluator) brings it"
    return None


def _selected(pixels: Image, mask: Mask | None) -> NDArray[np.float64]:
    return np.asarray(pixels if mask is None else pixels[mask], dtype=np.float64)


def _colour(pixels: Image) -> NDArray[np.float32]:
    """Non-negative RGB as FLIP wants it."""
    pixels = np.maximum(np.asarray(pixels, dtype=np.float32), 0)
    return np.ascontiguousarray(np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels)
