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
from scipy.ndimage import correlate, uniform_filter

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

    ``pilot``: (P, H, W, C), means of parts of the pilot, whose differences tell its error; those of neighbours do if
    P = 1. ``difference``, of the same shape: a control variate's integral less its estimate, of which any share can be
    added to the pilot. ``dim``: radiance below which errors count as if it were that bright. ``least``: samples of any
    pixel, a power of two, at most ``budget``. ``footprint``: radius in pixels of what a pixel's value depends on beyond
    its own samples (that of the reconstruction filter; 0 for a box).
    """
    error, variate = (np.moveaxis(part, -1, 0) for part in (pilot, difference))  # (C, P, H, W)
    level = error.mean(axis=(0, 1), dtype=np.float64)
    if len(pilot) > 1:
        error, variate = (part - part.mean(axis=1, keepdims=True, dtype=np.float32) for part in (error, variate))
    products = [(a * b).sum(axis=(0, 1)) for a, b in ((error, error), (error, variate), (variate, variate))]
    outer = _REACH + footprint
    neighbours = [*error[:, 0], *variate[:, 0]] if len(pilot) == 1 else []
    around = _around(np.stack([level, *products, *neighbours]).astype(np.float64), outer, footprint)
    variance, covariance, squares = around[1:4]
    if neighbours:
        mean, of_variate = around[4:].reshape(2, -1, *level.shape)
        variance = variance - (mean**2).sum(axis=0)
        covariance = covariance - (mean * of_variate).sum(axis=0)
        squares = squares - (of_variate**2).sum(axis=0)
    # The share c with the least variance of pilot + c · difference; of other pixels, as all that a pixel's value is
    # made of. Sums around the pixel come first, or it would have a part in the shares of those that it is judged by.
    share = np.clip(np.divide(-covariance, squares, out=np.zeros_like(squares), where=squares > 0), 0, 1)
    spread = np.maximum(variance + share * (2 * covariance + share * squares), 0)
    need = (spread / (around[0] ** 2 + dim**2 + 1e-30)) ** (1 / (1 + CONVERGENCE))
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


def _around(images: _Float, outer: int, inner: int) -> _Float:
    """Means (K, H, W) of ``images`` over squares around each pixel, without that of radius ``inner``.

    Half of the weight has the square of radius ``outer``, half the least one. Added up directly: a difference of sums,
    or running sums, would keep a trace of what is left out.
    """
    weights = np.zeros((2 * outer + 1, 2 * outer + 1))
    distance = np.abs(np.arange(-outer, outer + 1))
    distance = np.maximum(distance, distance[:, None])
    for radius in (inner + 1, outer):
        ring = (distance <= radius) & (distance > inner)
        weights[ring] += 0.5 / ring.sum()
    inside = correlate(np.ones(images.shape[1:]), weights, mode="constant")
    result: _Float = correlate(images, weights[None], mode="constant") / np.maximum(inside, 1e-30)
    return result
