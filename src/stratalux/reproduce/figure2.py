"""Figure 2: a diffuse teapot; banding of structured importance sampling against stratified sampling."""

from __future__ import annotations

import numpy as np

from ..comparison.study import Study
from ..images.metrics import rmse
from ..report.model import Claim, Crop, ImageSet, Picture, Section, Table
from .banding import STEEPEST, Quality, quality, step_share
from .facts import picture_facts
from .item import Item
from .measure import REFERENCE_PASSES as PASSES
from .measure import Judge, Outcome, contest, contest_work, make_reference, reference_work
from .pinned import Pinned, importance, stratified, structured
from .scenes import Frame, Subject, Workbench
from .settings import Settings
from .verdicts import SIGMAS, all_of, when

RATES = (16, 32)
SQUARE = (0.64, 0.64, 0.84, 0.94)
"""Left, top, right, bottom of the red square, parts of the image: the shadow of the spout on the ground."""
GRID = 2
BANDED = 1.5
"""Bands count as visible if the steepest pixels carry so many times the reference's share of the variation."""
VISIBLE_BIAS = 0.02
"""A wrong brightness counts as visible from this part of the mean on, about the eye's contrast threshold."""
_MASK_WORK = 0.5


def frames(settings: Settings) -> tuple[Frame, Frame]:
    """The whole picture and the square."""
    width, height = settings.band_size
    left, right = (round(x * width) for x in SQUARE[0::2])
    top, bottom = (round(y * height) for y in SQUARE[1::2])
    subject = Subject("teapot")
    return Frame(subject, settings.band_size, GRID), Frame(
        subject, settings.band_size, GRID, (left, top, right, bottom)
    )


def _techniques(rate: int) -> tuple[Pinned, Pinned, Pinned]:
    return structured(rate), structured(rate, jitter=True), stratified(rate)


def _sides(settings: Settings) -> list[tuple[str, list[Pinned], int]]:
    """Steps of the square: what takes random numbers is rendered with many seeds."""
    fixed = [_techniques(rate)[0] for rate in RATES]
    random = [technique for rate in RATES for technique in _techniques(rate)[1:]]
    return [("fig2-fixed", fixed, 1), ("fig2-random", random, settings.band_seeds)]


def work(settings: Settings) -> dict[str, float]:
    whole, square = frames(settings)
    total = contest_work(whole, [stratified(settings.picture_samples)], 1)
    total += reference_work(square, importance(settings.band_reference_samples // PASSES))
    total += sum(contest_work(square, techniques, seeds) for _, techniques, seeds in _sides(settings))
    return {"fig2": total + _MASK_WORK}


def run(study: Study, bench: Workbench) -> Section:
    settings = bench.settings
    whole, square = frames(settings)
    full = contest(study, bench, "fig2-picture", whole, [stratified(settings.picture_samples)], 1)[0]
    truth = make_reference(
        study, bench, "fig2-reference", square, importance(settings.band_reference_samples // PASSES)
    )
    hits = study.step(
        "fig2-ground",
        bench.fingerprint(square),
        _MASK_WORK,
        lambda fraction: {"ground": bench.view(square).hits().ground},
    )
    ground = hits["ground"]
    judge = Judge(truth, {"ground": ground})
    outcomes = {
        outcome.technique.text: outcome
        for name, techniques, seeds in _sides(settings)
        for outcome in contest(study, bench, name, square, techniques, seeds, judge, ("image", "mean", "variance"))
    }
    rated = [(rate, [outcomes[technique.text] for technique in _techniques(rate)]) for rate in RATES]
    return _section(settings, full, truth.image, truth.standard_error, ground, rated)


def _section(
    settings: Settings,
    full: Outcome,
    truth: np.ndarray,
    error: np.ndarray,
    ground: np.ndarray,
    rated: list[tuple[int, list[Outcome]]],
) -> Section:
    share = step_share(truth, ground)
    shares: dict[str, float] = {}
    qualities: dict[str, Quality] = {}
    rows = [("reference", f"{share:.3f}", "1.00", "-", "-", "-")]
    for _, outcomes in rated:
        for outcome in outcomes:
            text = outcome.technique.text
            shares[text] = step_share(outcome.mean, ground)
            qualities[text] = quality(
                outcome.mean, outcome.variance, len(outcome.seconds), truth, error, ground, SIGMAS
            )
            q = qualities[text]
            rows.append(
                (
                    outcome.technique.label,
                    f"{shares[text]:.3f}",
                    f"{shares[text] / share:.2f}",
                    f"{100 * q.bias:.2f} %" + ("" if q.bias_seen else " (chance)"),
                    f"{100 * q.noise:.2f} %",
                    f"{float(np.median(outcome.rmse['ground'])):.5f}",
                )
            )
    table = Table(
        "Bands and noise in the penumbra, apart",
        ("", "step share", "over reference", "bias", "noise", "RMSE"),
        tuple(rows),
        f"Ground pixels of the red square. Step share: part of the total variation of the expected image that the "
        f"steepest {100 * STEEPEST:.0f} % of neighbouring pixels carry; a smooth ramp has {STEEPEST}, a staircase 1. "
        f"Expected image: mean of {settings.band_seeds} renderings where random numbers are used. Bias: RMS difference "
        "of the expected image from the reference, noise: RMS standard deviation of a single rendering, both over the "
        "mean. RMSE: of a single rendering.",
    )
    fixed, jittered, ours = ([outcomes[i] for _, outcomes in rated] for i in range(3))
    claims = _claims(share, shares, qualities, fixed, jittered, ours)
    left, top, right, bottom = frames(settings)[1].crop or (0, 0, 0, 0)
    whole = ImageSet(
        "Teapot, stratified sampling",
        (Picture(full.technique.label, full.image, picture_facts(full)),),
        crops=(Crop("the red square", left, top, right, bottom),),
    )
    squares = tuple(
        ImageSet(
            f"The red square, {rate} samples per shading point",
            tuple(
                Picture(
                    outcome.technique.label,
                    outcome.image,
                    picture_facts(outcome) | {"RMSE": f"{rmse(outcome.image, truth):.5f}"},
                )
                for outcome in outcomes
            ),
            reference=Picture("reference", truth.astype(np.float32)),
        )
        for rate, outcomes in rated
    )
    return Section(
        "fig2",
        ITEM.title,
        (
            f"Diffuse teapot (reflectance 0.5) on a diffuse ground (0.4), {settings.band_size[0]}x"
            f"{settings.band_size[1]}, {GRID}x{GRID} fixed camera rays in each pixel, the same for every technique.",
        ),
        claims,
        (whole, *squares, table),
    )


def _claims(
    share: float,
    shares: dict[str, float],
    qualities: dict[str, Quality],
    fixed: list[Outcome],
    jittered: list[Outcome],
    ours: list[Outcome],
) -> tuple[Claim, ...]:
    def percent(outcomes: list[Outcome], what: str) -> str:
        values = (100 * getattr(qualities[outcome.technique.text], what) for outcome in outcomes)
        return " and ".join(f"{value:.2f} %" for value in values)

    def relative(outcomes: list[Outcome]) -> list[float]:
        return [shares[outcome.technique.text] / share for outcome in outcomes]

    def times(values: list[float]) -> str:
        return " and ".join(f"{value:.2f}" for value in values)

    best = [
        max(o.rmse["ground"]) < min(*f.rmse["ground"], *j.rmse["ground"])
        for o, f, j in zip(ours, fixed, jittered, strict=True)
    ]
    return (
        Claim(
            "Structured importance sampling shows bands near shadow boundaries at 16 and 32 lights",
            "picture only",
            f"step share {times(relative(fixed))} times the reference's",
            all_of([when(ratio > BANDED) for ratio in relative(fixed)]),
            f"Holds if the share is more than {BANDED} times the reference's at both rates.",
        ),
        Claim(
            "Jitter blurs the bands",
            "picture only",
            f"step share {times(relative(jittered))} times the reference's, against {times(relative(fixed))}",
            all_of([when(j < f) for j, f in zip(relative(jittered), relative(fixed), strict=True)]),
            "Holds if the share falls at both rates.",
        ),
        Claim(
            "Jitter fails to retrieve the correct shadow boundaries",
            "picture only",
            f"bias {percent(jittered, 'bias')} of the mean, against {percent(fixed, 'bias')} without jitter",
            all_of(
                [
                    when(q.bias_seen and q.bias > VISIBLE_BIAS)
                    for q in (qualities[outcome.technique.text] for outcome in jittered)
                ]
            ),
            f"Holds if the expected image is off by more than {100 * VISIBLE_BIAS:.0f} % of the mean and by more than "
            f"{SIGMAS:.0f} standard errors. A jittered light takes its stratum's light to a uniformly random texel of "
            "it; the paper does not say how its lights are jittered.",
        ),
        Claim(
            "Stratified sampling has the correct soft shadows",
            "picture only",
            f"step share {times(relative(ours))} times the reference's; bias {percent(ours, 'bias')}",
            all_of(
                [
                    when(ratio < BANDED and not qualities[outcome.technique.text].bias_seen)
                    for ratio, outcome in zip(relative(ours), ours, strict=True)
                ]
            ),
            f"Holds if no bands are visible and the expected image is within {SIGMAS:.0f} standard errors of the "
            "reference at both rates.",
        ),
        Claim(
            "Stratified sampling is better without much noise, even at 16 samples",
            "picture only",
            f"noise {percent(ours, 'noise')} of the mean; RMSE "
            + " and ".join(
                f"{np.median(o.rmse['ground']):.4f} (fixed {np.median(f.rmse['ground']):.4f}, jittered "
                f"{np.median(j.rmse['ground']):.4f})"
                for o, f, j in zip(ours, fixed, jittered, strict=True)
            ),
            all_of([when(better) for better in best]),
            "Holds if every rendering has a lower RMSE in the penumbra than every one of structured sampling, at 16 "
            "and at 32.",
        ),
    )


ITEM = Item(
    "fig2",
    "Figure 2: teapot, bands of structured against stratified sampling",
    ("grace", "teapot"),
    work,
    run,
)
