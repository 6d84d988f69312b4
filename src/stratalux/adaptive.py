"""How many samples each pixel gets, from what a few samples of every pixel have shown, without bias (NumPy).

A pilot gives every pixel a few samples, and the rest goes where the error is. To count the samples of a pixel by its
own pilot would be biased: a pixel whose pilot has missed a highlight would count as finished, and be darker than it is.
So a pixel's count follows from the pilots of *other* pixels around, and from a scale that it has no part in either. It
is independent of the pixel's own samples, whose mean is then unbiased, pilot included, and they can go on with one
nested set of strata.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d, uniform_filter

CONVERGENCE = 1.3
"""c of error² ∝ n^−c with n samples of a pixel, as measured; the least sum of all has n ∝ (error²)^(1 / (1 + c))."""

_MOST = 5
"""Doublings of the mean count, at most."""
_REACH = 2
"""Pixels around that tell what a pixel needs."""

_Float = NDArray[np.float64]


@dataclass(frozen=True)
class Plan:
    """``counts`` (H, W): samples of each pixel, powers of two. ``level`` (H, W): mean of the channels around it.

    ``share`` (H, W): of the control variate's difference that is to be added to each pixel, in [0, 1].
    """

    counts: NDArray[np.int64]
    level: _Float
    share: _Float


def plan_samples(
    pilot: NDArray[np.floating],
    difference: NDArray[np.floating],
    dim: float,
    budget: float,
    least: int,
    footprint: int = 0,
) -> Plan:
    """Share ``budget`` samples per pixel, on average and about, so that the sum of relative errors is least.

    ``pilot``: (P ≥ 2, H, W, C), means of parts of the pilot, whose differences tell its error. ``difference``, of the
    same shape: a control variate's integral less its estimate, of which any share can be added to the pilot. ``dim``:
    radiance below which errors count as if it were that bright. ``least``: samples of any pixel, a power of two, at
    most ``budget``. ``footprint``: radius in pixels of what a pixel's value depends on beyond its own samples (that of
    the reconstruction filter; 0 for a box).
    """
    outer = _REACH + footprint

    def around(values: _Float) -> _Float:
        return (_ring(values, footprint + 1, footprint) + _ring(values, outer, footprint)) / 2

    grey = pilot.mean(axis=0, dtype=np.float32)
    level = grey.mean(axis=-1, dtype=np.float64)
    error, variate = pilot - grey, difference - difference.mean(axis=0, dtype=np.float32)
    # The share c with the least variance of pilot + c · difference; of other pixels, as all that a pixel's value is
    # made of. Sums around the pixel come first, or it would have a part in the shares of those that it is judged by.
    variance, covariance, squares = (
        around((a * b).sum(axis=(0, -1), dtype=np.float64))
        for a, b in ((error, error), (error, variate), (variate, variate))
    )
    share = np.clip(np.divide(-covariance, squares, out=np.zeros_like(squares), where=squares > 0), 0, 1)
    spread = np.maximum(variance + share * (2 * covariance + share * squares), 0)
    need = (spread / (_ring(level, outer, footprint) ** 2 + dim**2 + 1e-30)) ** (1 / (1 + CONVERGENCE))
    counts = _counts(need, budget, least, outer + footprint)
    return Plan(counts, uniform_filter(level, 2 * _REACH + 1, mode="nearest"), share)


def _counts(need: _Float, budget: float, least: int, reach: int) -> NDArray[np.int64]:
    """Powers of two near a multiple of ``need``: on each half of a checkerboard, the multiple that suits the other.

    ``reach``: how far the need of one pixel depends on the samples of another. Fields keep that distance.
    """
    side = 2 * reach + 8
    (field_y, y), (field_x, x) = (np.divmod(np.arange(length), side) for length in need.shape)
    odd = (field_y[:, None] + field_x) % 2
    inside_y, inside_x = ((t >= reach) & (t < side - reach) for t in (y, x))
    apart = inside_y[:, None] & inside_x
    logarithm = np.log2(np.maximum(need, 1e-30))
    lowest = np.log2(least)
    highest = lowest + np.ceil(np.log2(budget / least)) + _MOST
    counts = np.empty(need.shape, dtype=np.int64)
    for parity in (0, 1):
        others = logarithm[apart & (odd != parity)]
        if others.size == 0:
            others = np.zeros(1)  # too small to tell what is needed without bias: all get the same
            logarithm[odd == parity] = 0
        low, high = lowest - others.max() - 1, highest - others.min() + 1
        for _ in range(16):
            middle = (low + high) / 2
            enough = np.exp2(np.clip(np.rint(others + middle), lowest, highest)).mean() <= budget
            low, high = (middle, high) if enough else (low, middle)
        exponents = np.clip(np.rint(logarithm[odd == parity] + low), lowest, highest)
        counts[odd == parity] = np.left_shift(1, exponents.astype(np.int64))
    return counts


def _ring(values: _Float, outer: int, inner: int) -> _Float:
    """Mean over the square of radius ``outer`` around each pixel without that of ``inner``, as far as in the image.

    Added up directly: a difference of sums, or running sums, would keep a trace of what is left out.
    """
    full, hole = np.ones(2 * outer + 1), np.ones(2 * inner + 1)
    sides = full.copy()
    sides[outer - inner : outer + inner + 1] = 0

    def total(image: _Float) -> _Float:
        rows = correlate1d(correlate1d(image, full, axis=1, mode="constant"), sides, axis=0, mode="constant")
        return rows + correlate1d(correlate1d(image, sides, axis=1, mode="constant"), hole, axis=0, mode="constant")

    result: _Float = total(values) / np.maximum(total(np.ones_like(values)), 1)
    return result
