"""Banding, apart from noise: what the mean of many renderings looks like, and what a single one adds to it.

Where a technique replaces a soft light by a few directions, the penumbra becomes a staircase: the changes of brightness
that the true image spreads over many pixels are found in a few.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.colour import LUMINANCE
from ..images.metrics import Mask

STEEPEST = 0.05
"""The share of neighbouring pixels, the steepest, whose part in the total variation is measured."""


def step_share(image: NDArray[np.floating], mask: Mask, steepest: float = STEEPEST) -> float:
    """How much of the total variation of the luminance of ``image`` (H, W, 3) the steepest pixels carry, in [0, 1].

    Of all differences between horizontal and vertical neighbours inside ``mask`` (H, W), the largest ``steepest`` part
    is summed up, over the sum of all. A smooth ramp gives ``steepest``, a few steps 1. NaN for an even image.
    """
    luminance = np.asarray(image, dtype=np.float64) @ LUMINANCE
    across = np.abs(np.diff(luminance, axis=1))[mask[:, 1:] & mask[:, :-1]]
    down = np.abs(np.diff(luminance, axis=0))[mask[1:] & mask[:-1]]
    differences = np.sort(np.concatenate([across, down]))
    total = differences.sum()
    if total == 0:
        return float("nan")
    count = max(1, round(steepest * len(differences)))
    return float(differences[-count:].sum() / total)


@dataclass(frozen=True)
class Quality:
    """Of a technique, over a mask, both relative to the reference's mean.

    ``bias``: RMS difference of the expected image from the reference. ``bias_seen``: whether that is more than chance.
    ``noise``: RMS standard deviation of a single rendering.
    """

    bias: float
    bias_seen: bool
    noise: float


def quality(
    mean: NDArray[np.floating],
    variance: NDArray[np.floating],
    count: int,
    reference: NDArray[np.floating],
    standard_error: NDArray[np.floating],
    mask: Mask,
    sigmas: float = 3.0,
) -> Quality:
    """Bias and noise from the ``mean`` and the ``variance`` (H, W, 3) of ``count`` renderings.

    (mean - reference)² has the expected value bias² + variance / count + standard_error²: what chance contributes is
    taken off. ``bias_seen``: the rest is more than ``sigmas`` of its own standard errors, as the pixels scatter.
    """
    m, v, r, s = (np.asarray(a[mask], dtype=np.float64) for a in (mean, variance, reference, standard_error))
    squares = ((m - r) ** 2 - v / count - s**2).mean(axis=1)  # the channels of a pixel are not independent
    level = r.mean()
    bias = squares.mean()
    error = squares.std() / np.sqrt(len(squares))
    return Quality(
        bias=float(np.sqrt(max(0.0, bias)) / level),
        bias_seen=bool(bias > sigmas * error),
        noise=float(np.sqrt(v.mean()) / level),
    )
