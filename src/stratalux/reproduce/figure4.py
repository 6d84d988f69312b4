"""Figure 4: RMS error against sampling rate for the three techniques, on the diffuse Buddha."""

from __future__ import annotations

from statistics import median

import numpy as np

from ..comparison.reference import Reference
from ..comparison.study import Study
from ..report.model import Chart, Claim, Curve, Section, Table
from .buddha import diffuse_frame, diffuse_reference, diffuse_work, masks
from .item import Item
from .measure import Judge, Outcome, contest, contest_work
from .pinned import Pinned, importance, stratified, structured
from .scenes import Workbench
from .settings import Settings
from .unbiased import unbiased_claim, unbiased_work
from .verdicts import all_of, by_spread

NAMES = ("structured", "importance", "stratified")
REGIONS = {"object": "the Buddha", "surface": "the Buddha and his open ground"}
"""The paper does not say what its figure is over: its reasoning is about the object, its error that of an image."""


def _techniques(rate: int) -> list[Pinned]:
    return [structured(rate), importance(rate), stratified(rate)]


def work(settings: Settings) -> dict[str, float]:
    frame = diffuse_frame(settings)
    contests = sum(contest_work(frame, _techniques(rate), settings.seeds) for rate in settings.rates)
    return diffuse_work(settings) | {"fig4": contests + unbiased_work(settings)}


def run(study: Study, bench: Workbench) -> Section:
    settings = bench.settings
    frame = diffuse_frame(settings)
    reference = diffuse_reference(study, bench)
    judge = Judge(reference, masks(study, bench, frame))
    outcomes = [
        contest(study, bench, f"fig4-{rate}", frame, _techniques(rate), settings.seeds, judge, keep=())
        for rate in settings.rates
    ]
    sides = [[row[i] for row in outcomes] for i in range(len(NAMES))]
    return Section(
        "fig4",
        ITEM.title,
        (
            f"Diffuse Buddha on a diffuse ground, {frame.size[0]}x{frame.size[1]}, one fixed camera ray in each pixel, "
            f"{settings.seeds} renderings of each. The reference has {settings.reference_samples:,} samples per "
            "shading point, by importance sampling as in the paper. Structured sampling needs no random numbers: its "
            "error is all bias.",
        ),
        (
            *(claim for region in judge.masks for claim in _claims(settings.rates, region, sides)),
            unbiased_claim(study, bench),
        ),
        (
            *(chart for region in judge.masks for chart in _charts(settings.rates, region, sides, reference, judge)),
            _table(settings.rates, sides),
        ),
    )


def ratios(theirs: Outcome, ours: Outcome, region: str) -> list[float]:
    """RMSE of ``theirs`` over that of ``ours``, seed by seed; inf where ours has no error."""
    pairs = zip(theirs.rmse[region], ours.rmse[region], strict=True)
    return [a / b if b > 0 else float("inf") for a, b in pairs]


def _claims(rates: tuple[int, ...], region: str, sides: list[list[Outcome]]) -> list[Claim]:
    claims = []
    where = REGIONS[region]
    sis, importance_, ours = sides
    for name, theirs in (("structured importance sampling", sis), ("importance sampling", importance_)):
        by_rate = [ratios(a, b, region) for a, b in zip(theirs, ours, strict=True)]
        claims.append(
            Claim(
                f"Stratified sampling has a lower RMS error than {name} at all rates, over {where}",
                "picture only",
                ", ".join(f"{rate}: {median(r):.2f}" for rate, r in zip(rates, by_rate, strict=True)),
                all_of([by_spread(r) for r in by_rate]),
                "RMSE of the other technique over that of stratified sampling, by rate. Holds if every rendering's "
                "ratio is above 1 at every rate.",
            )
        )
        # Low and high: the two rates at either end.
        low, high = (float(np.mean([median(r) for r in half])) for half in (by_rate[:2], by_rate[-2:]))
        spread = [r / h for rs, hs in zip(by_rate[:2], by_rate[-2:], strict=True) for r in rs for h in hs]
        claims.append(
            Claim(
                f"The gain over {name} is larger at low rates, over {where}",
                "picture only",
                f"RMSE ratio {low:.2f} at the two lowest rates, {high:.2f} at the two highest",
                by_spread(spread),
                "Holds if the ratio of every rendering at the two lowest rates is above that at the two highest.",
            )
        )
    return claims


def _charts(
    rates: tuple[int, ...], region: str, sides: list[list[Outcome]], reference: Reference, judge: Judge
) -> tuple[Chart, ...]:
    mask, where = judge.masks[region], REGIONS[region]

    def curves(measure: str, over_time: bool) -> tuple[Curve, ...]:
        return tuple(
            Curve(
                name,
                tuple(
                    (outcome.time if over_time else float(rate), median(values), min(values), max(values))
                    for rate, outcome in zip(rates, side, strict=True)
                    for values in (getattr(outcome, measure)[region],)
                ),
                dashed=side[0].technique.biased,
            )
            for name, side in zip(NAMES, sides, strict=True)
        )

    rms = (reference.rmse_floor(mask), "error of the reference itself")
    relative = (reference.relative_mse_floor(mask), "error of the reference itself")
    rate = "samples per shading point"
    return (
        Chart(f"RMS error over sampling rate, {where}", rate, "RMSE", curves("rmse", False), floor=rms),
        Chart(f"Relative MSE over sampling rate, {where}", rate, "relMSE", curves("relmse", False), floor=relative),
        Chart(f"RMS error over time, {where}", "seconds", "RMSE", curves("rmse", True), floor=rms),
    )


def _table(rates: tuple[int, ...], sides: list[list[Outcome]]) -> Table:
    kinds = ("RMSE on the Buddha", "RMSE with the ground", "seconds")
    header = ("rate", *(f"{name}, {kind}" for kind in kinds for name in NAMES))
    rows = []
    for i, rate in enumerate(rates):
        row = [side[i] for side in sides]
        cells = [f"{median(o.rmse[r]):.5f}" if r in o.rmse else "-" for r in REGIONS for o in row]
        cells += [f"{o.time:.3g}" for o in row]
        rows.append((str(rate), *cells))
    return Table("RMS error and render time", header, tuple(rows), "Medians over the renderings.")


ITEM = Item("fig4", "Figure 4: RMS error against sampling rate", ("grace", "buddha"), work, run)
