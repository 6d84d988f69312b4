"""Whether stratified sampling is unbiased, as the paper says: its mean against an integrator of Mitsuba's own."""

from __future__ import annotations

import numpy as np
from scipy import stats

from ..comparison.study import Study
from ..report.model import Claim
from .measure import contest, contest_work
from .pinned import mitsuba_direct, stratified
from .scenes import Frame, Subject, Workbench
from .settings import Settings
from .verdicts import SIGMAS, when

_TECHNIQUES = (stratified(16), stratified(16, 4), mitsuba_direct(8))
_OUTLIERS = 3.0
"""The share of pixels off by more than 3 sigma may be so many times what a normal distribution has."""


def _frame(settings: Settings) -> Frame:
    return Frame(Subject("buddha"), settings.unbiased_size)


def unbiased_work(settings: Settings) -> float:
    return contest_work(_frame(settings), _TECHNIQUES, settings.unbiased_seeds)


def unbiased_claim(study: Study, bench: Workbench) -> Claim:
    settings = bench.settings
    *ours, truth = contest(
        study,
        bench,
        "fig4-unbiased",
        _frame(settings),
        _TECHNIQUES,
        settings.unbiased_seeds,
        keep=("mean", "variance"),
    )
    found, sound = [], True
    count = settings.unbiased_seeds
    for outcome in ours:
        mean, off = deviations(outcome.mean, outcome.variance, truth.mean, truth.variance, count)
        sound &= abs(mean) < SIGMAS and off < _OUTLIERS
        found.append(f"{outcome.technique.label}: mean off by {mean:+.2f} standard errors, outliers {off:.2f}")
    return Claim(
        "Stratified sampling is unbiased",
        "unbiased (abstract)",
        "; ".join(found),
        when(sound),
        f"Against Mitsuba's direct, {count} renderings of each. Holds if the image's mean is within {SIGMAS:.0f} "
        "standard errors and the share of pixels beyond three of their own is less than "
        f"{_OUTLIERS:.0f} times what chance gives.",
    )


def deviations(
    mean: np.ndarray, variance: np.ndarray, truth: np.ndarray, truth_variance: np.ndarray, count: int
) -> tuple[float, float]:
    """Difference of the image's mean in standard errors, and the share of values beyond three over the expected share.

    ``mean`` and ``variance`` (H, W, 3) of ``count`` renderings each; values without any variance are left out. Welch's
    statistic, which has about 2 (count - 1) degrees of freedom.
    """
    difference = np.asarray(mean, dtype=np.float64) - truth
    squared = (np.asarray(variance, dtype=np.float64) + truth_variance) / count
    known = squared > 0
    if not known.any():
        return 0.0, 0.0
    # The channels of a pixel are drawn together: a channel's mean over pixels has the error, not that of all values.
    whole = difference.sum(axis=(0, 1)) / np.sqrt(np.maximum(squared.sum(axis=(0, 1)), 1e-300))
    expected = 2 * stats.t.sf(3.0, 2 * (count - 1))
    off = np.mean(np.abs(difference[known]) > 3.0 * np.sqrt(squared[known])) / expected
    return float(whole[np.argmax(np.abs(whole))]), float(off)
