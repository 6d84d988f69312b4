"""How many samples each pixel gets, from what a few samples of every pixel have shown, without bias (Dr.Jit, NumPy).

A pilot gives every pixel a few samples, and the rest goes where the error is. To count the samples of a pixel by its
own pilot would be biased: a pixel whose pilot has missed a highlight would count as finished, and be darker than it is.
So a pixel's count follows from the pilots of *other* pixels around, and from a scale that it has no part in either. It
is independent of the pixel's own samples, whose mean is then unbiased, pilot included, and they can go on with one
nested set of strata.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ...sampling.recording import recorded

CONVERGENCE = 2.0
"""c of error² ∝ n^−c with n samples of a pixel: the least sum of all has n ∝ (error²)^(1 / (1 + c)). Measured is 1.3,
which would be best if errors were known; those that a few samples tell are followed less closely."""

_CHANNELS = 3
_TINY = 1e-30
_MOST = 5
"""Doublings of the mean count, at most."""
_LAST = 31
"""Doublings of one sample: those of a pixel are numbered in 32 bits."""
_STEPS = 64
"""Of the logarithm of what a pixel needs, for each doubling."""
_APART, _UNLIKE = 0.05, 0.01
"""Squared distance of marks at which a pixel counts half for another, and what any counts at least."""
_DOUBT = 3.0
"""Variance of a part of the pilot over the square of its mean, beyond whose inverse a pixel's share shrinks."""
_REACH = 2
"""Pixels around that tell what a pixel needs."""


@dataclass(frozen=True)
class Plan:
    """``counts`` (H, W): samples of each pixel, powers of two. ``level``: mean of the channels around each pixel.

    ``share``: of the control variate's difference that is to be added to each pixel, in [0, 1].
    """

    counts: NDArray[np.int64]
    level: mi.Float
    share: mi.Float


def plan_samples(
    pilot: mi.TensorXf,
    difference: mi.TensorXf,
    dim: float,
    budget: float,
    least: int,
    footprint: int = 0,
    marks: Sequence[mi.Float] = (),
    costs: Sequence[mi.Float] = (),
) -> Plan:
    """Share ``budget`` samples per pixel, on average and about, so that the sum of relative errors is least.

    ``pilot``: (C, P, H, W), means of P parts of the pilot, whose differences tell its error; those of neighbours do if
    P = 1. ``difference``, of the same shape: a control variate's integral less its estimate, of which any share can be
    added to the pilot. ``dim``: radiance below which errors count as if it were that bright. ``least``: samples of any
    pixel, a power of two, at most ``budget``. ``footprint``: radius in pixels of what a pixel's value depends on beyond
    its own samples (that of the reconstruction filter; 0 for a box). ``marks``: coordinates of each pixel that do not
    depend on samples; those around that have nearly the same ones tell what it needs. ``costs``: of the samples
    of each pixel, in any unit, where they differ: where they are dear, there are fewer.
    """
    _, parts, *size = pilot.shape
    outer = _REACH + footprint
    height, width = (dr.opaque(mi.UInt32, side) for side in size)
    pixel = dr.arange(mi.UInt32, size[0] * size[1])
    dr.eval(pixel)
    pictures = pilot.array, difference.array
    unit = 2.0 ** round(math.log2(dim)) if dim > 0 else 1.0  # in which squares stay within single precision
    scale, dim = dr.opaque(mi.Float, 1 / unit), dr.opaque(mi.Float, dim / unit)
    given = *pictures, list(marks), list(costs), pixel, width, height, scale, dim
    need, level, share = _needs(*given, parts, outer, footprint)
    steps = need.numpy().reshape(size).astype(np.int64)
    return Plan(_counts(steps, budget, least, outer + footprint), level * dr.opaque(mi.Float, unit), share)


@recorded
def _needs(
    pilot: mi.Float,
    difference: mi.Float,
    marks: list[mi.Float],
    costs: list[mi.Float],
    pixel: mi.UInt32,
    width: mi.UInt32,
    height: mi.UInt32,
    scale: mi.Float,
    dim: mi.Float,
    parts: int,
    outer: int,
    inner: int,
) -> tuple[mi.Int32, mi.Float, mi.Float]:
    """What each pixel needs, as a logarithm in ``_STEPS``, the level around it, and its share of the variate.

    ``scale``: what the pictures are multiplied by before anything else; ``dim`` and the level are so already.
    """
    pixels = width * height

    def own(image: mi.Float, c: int, part: int) -> mi.Float:
        return scale * dr.gather(mi.Float, image, pixel + (c * parts + part) * pixels)

    level, products = mi.Float(0), [mi.Float(0)] * 3
    neighbours = []
    for c in range(_CHANNELS):
        error, variate = ([own(image, c, part) for part in range(parts)] for image in (pilot, difference))
        level += sum(error) / (_CHANNELS * parts)
        if parts == 1:
            neighbours += [error[0], variate[0]]
        else:
            error, variate = ([x - sum(values) / parts for x in values] for values in (error, variate))
        for a, b in zip(error, variate, strict=True):
            products = [x + y for x, y in zip(products, (a * a, a * b, b * b), strict=True)]
    values = [level, *products, *costs, *neighbours]
    dr.eval(values)

    level, around = _around(values, marks, pixel, width, height, outer, inner)
    mean, variance, covariance, squares, *neighbours = around
    cost = neighbours.pop(0) if costs else mi.Float(1)
    for error, variate in zip(neighbours[::2], neighbours[1::2], strict=True):
        variance -= error * error
        covariance -= error * variate
        squares -= variate * variate
    # The share c with the least variance of pilot + c · difference; of other pixels, as all that a pixel's value is
    # made of. Sums around the pixel come first, or it would have a part in the shares of those that it is judged by.
    best = -covariance / squares
    share = dr.select((squares > 0) & dr.isfinite(best), dr.clip(best, 0, 1), 0)
    spread = dr.maximum(variance + share * (2 * covariance + share * squares), 0)
    known = spread < dr.inf  # else a square has overflowed: there, as much is needed as anywhere
    # Where much is left beside the mean, light is mostly shadow. A full share would leave some pixels below zero there.
    share *= dr.select(known, dr.minimum(1, mean * mean / (_DOUBT * spread + _TINY)), 0)
    relative = dr.select(known, spread / (mean * mean + dim * dim + _TINY), dr.inf)
    need = dr.log2(dr.clip(relative / cost, _TINY, 1 / _TINY)) / (1 + CONVERGENCE)
    return mi.Int32(dr.round(_STEPS * need)), level, share


@dr.syntax
def _around(
    values: list[mi.Float],
    marks: list[mi.Float],
    pixel: mi.UInt32,
    width: mi.UInt32,
    height: mi.UInt32,
    outer: int,
    inner: int,
) -> tuple[mi.Float, list[mi.Float]]:
    """Mean of the first of ``values`` over the square of radius ``_REACH`` around each pixel, and means of all of them
    over squares without that of radius ``inner``.

    Half of the weight has the square of radius ``outer``, half the least one; in both, pixels with other ``marks`` have
    hardly any. Added up directly: a difference of sums, or running sums, would keep a trace of what is left out.
    """
    row = pixel // width
    x, y = mi.Int32(pixel - row * width), mi.Int32(row)
    side = 2 * outer + 1
    near, far = (0.5 / ((2 * radius + 1) ** 2 - (2 * inner + 1) ** 2) for radius in (inner + 1, outer))
    level, pixels = mi.Float(0), mi.Float(0)
    sums, weights = [mi.Float(0) for _ in values], mi.Float(0)
    own = [dr.gather(mi.Float, mark, pixel) for mark in marks]
    k = mi.Int32(0)
    while k < side * side:
        dy = k // side - outer
        dx = k - (dy + outer) * side - outer
        distance = dr.maximum(dr.abs(dx), dr.abs(dy))
        at_x, at_y = x + dx, y + dy
        inside = (at_x >= 0) & (at_x < mi.Int32(width)) & (at_y >= 0) & (at_y < mi.Int32(height))
        weight = dr.select(distance > inner, far, 0) + dr.select(distance == inner + 1, near, 0)
        weight = dr.select(inside, weight, 0)
        at = mi.UInt32(at_y * mi.Int32(width) + at_x)
        weight *= _likeness(own, [dr.gather(mi.Float, mark, at, inside) for mark in marks])
        some = [dr.gather(mi.Float, value, at, inside) for value in values]
        sums = _plus(sums, weight, some)
        weights += weight
        close = inside & (distance <= _REACH)
        level += dr.select(close, some[0], 0)
        pixels += dr.select(close, 1, 0)
        k += 1
    return level / pixels, [s / dr.maximum(weights, _TINY) for s in sums]


def _likeness(one: list[mi.Float], other: list[mi.Float]) -> mi.Float:
    """Of two pixels with these marks: from 1 down to :data:`_UNLIKE`."""
    if not one:
        return mi.Float(1)
    apart = sum(dr.square(a - b) for a, b in zip(one, other, strict=True)) / _APART
    return _UNLIKE + dr.rcp(1 + apart * apart)


def _plus(sums: list[mi.Float], weight: mi.Float, values: list[mi.Float]) -> list[mi.Float]:
    """``sums`` with the weighted ``values``; those of no weight, which may be infinite, leave no trace."""
    return [
        dr.select(weight > 0, dr.fma(weight, value, total), total) for total, value in zip(sums, values, strict=True)
    ]


def _counts(steps: NDArray[np.int64], budget: float, least: int, reach: int) -> NDArray[np.int64]:
    """Powers of two near a multiple of the need: on each half of a checkerboard, the multiple that suits the other.

    ``reach``: how far the need of one pixel depends on the samples of another. Fields keep that distance.
    """
    side = 2 * reach + 8
    (field_y, y), (field_x, x) = (np.divmod(np.arange(length), side) for length in steps.shape)
    odd = (field_y[:, None] + field_x) % 2
    inside_y, inside_x = ((t >= reach) & (t < side - reach) for t in (y, x))
    apart = inside_y[:, None] & inside_x
    lowest = int(np.log2(least))
    highest = min(lowest + int(np.ceil(np.log2(budget / least))) + _MOST, _LAST)
    exponents = np.empty_like(steps)
    for parity in (0, 1):
        others = steps[apart & (odd != parity)]
        if others.size == 0:
            others = np.zeros(1, dtype=np.int64)  # too small to tell what is needed without bias: all get the same
            steps[odd == parity] = 0
        first = others.min()
        pixels = np.bincount(others - first)
        values = first + np.arange(len(pixels))
        low, high = _STEPS * (lowest - 1) - values[-1], _STEPS * (highest + 1) - first
        while high - low > 1:
            middle = (low + high) // 2
            enough = pixels @ np.exp2(_exponents(values + middle, lowest, highest)) <= budget * others.size
            low, high = (middle, high) if enough else (low, middle)
        exponents[odd == parity] = _exponents(steps[odd == parity] + low, lowest, highest)
    return np.left_shift(1, exponents)


def _exponents(steps: NDArray[np.int64], lowest: int, highest: int) -> NDArray[np.int64]:
    return np.clip((steps + _STEPS // 2) // _STEPS, lowest, highest)
