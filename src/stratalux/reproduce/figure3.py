"""Figure 3: a diffuse Buddha; importance sampling with low-discrepancy points against stratified sampling, 16 rays."""

from __future__ import annotations

from itertools import pairwise
from statistics import median

import numpy as np
from numpy.typing import NDArray

from ..comparison.study import Study
from ..images.metrics import Mask
from ..report.model import Claim, ImageSet, Picture, Section, Table
from .buddha import crops, diffuse_frame, diffuse_reference, diffuse_work, masks, nonempty
from .facts import picture_facts
from .flips import with_flip
from .item import Item
from .measure import Judge, Outcome, contest, contest_work
from .occlusion import BRIGHTEST, bright_directions, hidden_share
from .pinned import importance, stratified
from .scenes import Workbench
from .settings import Settings
from .verdicts import by_size, by_spread

RAYS = 16
TECHNIQUES = (importance(RAYS), stratified(RAYS), importance(RAYS, "independent"))
MOST = 0.5
"""Most bright lights are occluded at a point if more than this share of their energy is."""
_BINS = (0.0, 0.25, 0.5, 0.75, 0.9, 1.0)
_SIGNIFICANT = 1.2
"""Noise is significantly reduced if the RMSE of the other side is more than so many times as large."""
_PAPER_SECONDS = (161.4, 145.1)
_DIRECTIONS = 64
_OCCLUSION_WORK = 3.0


def work(settings: Settings) -> dict[str, float]:
    contests = contest_work(diffuse_frame(settings), TECHNIQUES, _seeds(settings))
    return diffuse_work(settings) | {"fig3": _OCCLUSION_WORK + contests}


def _seeds(settings: Settings) -> int:
    return max(settings.seeds, settings.rounds)


def run(study: Study, bench: Workbench) -> Section:
    frame = diffuse_frame(bench.settings)
    reference = diffuse_reference(study, bench)
    thing = masks(study, bench, frame).get("object", np.zeros(frame.size[::-1], dtype=bool))
    share = study.step(
        "fig3-occlusion",
        bench.fingerprint(frame) | {"directions": _DIRECTIONS, "brightest": BRIGHTEST},
        _OCCLUSION_WORK,
        lambda fraction: {"hidden": _hidden(bench)},
    )["hidden"]
    regions = regions_of(share, thing)
    judge = Judge(reference, regions)
    outcomes = contest(study, bench, "fig3", frame, TECHNIQUES, _seeds(bench.settings), judge)
    pictures = ImageSet(
        f"Buddha, {RAYS} samples per shading point",
        tuple(with_flip(Picture(o.technique.label, o.image, picture_facts(o)), reference.image) for o in outcomes[:2]),
        reference=Picture("reference", reference.image),
        crops=crops(thing),
        text="The reference has "
        f"{bench.settings.reference_samples:,} samples per shading point, by importance sampling as in the paper.",
    )
    shares = ImageSet(
        "Occlusion of the bright lights",
        (Picture("hidden share", np.repeat(np.nan_to_num(share)[..., None], 3, axis=2).astype(np.float32)),),
        text=f"Which part of the brightest texels that have {100 * BRIGHTEST:.0f} % of the map's energy sends no "
        "light; white: none does.",
    )
    return Section(
        "fig3",
        ITEM.title,
        (
            f"Diffuse Buddha (reflectance 0.5), {frame.size[0]}x{frame.size[1]}, one camera ray through the middle of "
            "each pixel, the same for every technique. Where the bright lights are occluded is found by tracing rays "
            f"from every visible point to {_DIRECTIONS} directions of the brightest texels.",
        ),
        _claims(outcomes, regions),
        (pictures, shares, _table(outcomes, regions)),
    )


def _hidden(bench: Workbench) -> NDArray[np.float64]:
    directions = bench.to_world(bright_directions(bench.environment, _DIRECTIONS))
    return hidden_share(bench.view(diffuse_frame(bench.settings)), directions)[0]


def regions_of(share: NDArray[np.float64], thing: Mask) -> dict[str, Mask]:
    """Pixels of the object by the hidden ``share``: where most bright lights are hidden, where not, and finer."""
    named = {"object": thing, "occluded": thing & (share > MOST), "open": thing & (share <= MOST)}
    for low, high in pairwise(_BINS):
        inside = (share >= low) & ((share < high) if high < 1 else (share <= high))
        named[f"{100 * low:.0f} to {100 * high:.0f} % hidden"] = thing & inside
    return nonempty(named)


def _ratios(theirs: Outcome, ours: Outcome, region: str) -> list[float]:
    """RMSE of ``theirs`` over that of ``ours``, seed by seed."""
    pairs = zip(theirs.rmse.get(region, [np.nan]), ours.rmse.get(region, [np.nan]), strict=True)
    return [a / b if b > 0 else float("nan") for a, b in pairs]


def _claims(outcomes: list[Outcome], regions: dict[str, Mask]) -> tuple[Claim, ...]:
    theirs, ours, independent = outcomes
    if "occluded" not in regions or "open" not in regions:
        gone = Claim(
            "Stratified sampling reduces the error where bright lights are occluded",
            "picture only",
            "no such point in view",
            "not tested",
        )
        return (gone, _time_claim(theirs, ours))
    inside, outside = _ratios(theirs, ours, "occluded"), _ratios(theirs, ours, "open")
    noisier = [a / b for a, b in zip(theirs.relmse["occluded"], theirs.relmse["open"], strict=True)]
    random = _ratios(independent, ours, "occluded")
    share = regions["occluded"].sum() / regions["object"].sum()
    span = f"{min(inside):.2f} to {max(inside):.2f}"
    return (
        Claim(
            "Importance sampling is noisy where most bright lights are occluded",
            "picture only",
            f"relMSE there {median(noisier):.2f} times that of the rest of the Buddha "
            f"({median(theirs.relmse['occluded']):.4f} against {median(theirs.relmse['open']):.4f})",
            by_spread(noisier),
            f"{100 * share:.1f} % of the Buddha's pixels have more than {100 * MOST:.0f} % of the bright light hidden. "
            "Holds if every rendering has a larger relative MSE there.",
        ),
        Claim(
            "Stratified sampling significantly reduces the noise there",
            "picture only",
            f"RMSE of importance sampling {median(inside):.2f} times that of stratified ({span})",
            by_size(inside, _SIGNIFICANT),
            f"Holds if every rendering's ratio is above {_SIGNIFICANT}, partly if their median is above 1. With "
            f"independent points in place of low-discrepancy ones the ratio is {median(random):.2f}.",
        ),
        Claim(
            "The gain comes from the occluded places (sample clumping)",
            "picture only",
            f"RMSE ratio {median(inside):.2f} where occluded, {median(outside):.2f} elsewhere",
            by_spread([a / b for a, b in zip(inside, outside, strict=True)]),
            "Holds if every rendering gains more where the bright lights are occluded.",
        ),
        _time_claim(theirs, ours),
    )


def _time_claim(theirs: Outcome, ours: Outcome) -> Claim:
    ratios = [a / b for a, b in zip(theirs.seconds, ours.seconds, strict=True)]
    paper = _PAPER_SECONDS[0] / _PAPER_SECONDS[1]
    return Claim(
        "Stratified sampling is slightly faster than importance sampling",
        f"{_PAPER_SECONDS[0]} s against {_PAPER_SECONDS[1]} s, {paper:.2f} : 1",
        f"{theirs.time:.3g} s against {ours.time:.3g} s, {ours.time and theirs.time / ours.time:.2f} : 1",
        by_spread(ratios),
        "Medians of renderings in turn, compilation and preparation apart. Holds if importance sampling is slower in "
        "every round. Its low-discrepancy points need the inversion of a two-dimensional CDF over the whole map.",
    )


def _table(outcomes: list[Outcome], regions: dict[str, Mask]) -> Table:
    rows = []
    for name, mask in regions.items():
        errors = [median(outcome.relmse[name]) for outcome in outcomes]
        ratios = _ratios(outcomes[0], outcomes[1], name)
        rows.append(
            (
                name,
                str(int(mask.sum())),
                *(f"{error:.5f}" for error in errors),
                f"{median(ratios):.2f}",
                f"{min(ratios):.2f} to {max(ratios):.2f}",
            )
        )
    return Table(
        "Relative MSE by the share of bright light that is hidden",
        ("pixels", "number", *(o.technique.label for o in outcomes), "RMSE ratio, first to second", "range"),
        tuple(rows),
        "Object pixels. Median over renderings with different seeds.",
    )


ITEM = Item(
    "fig3",
    "Figure 3: Buddha, importance against stratified sampling with 16 rays",
    ("grace", "buddha"),
    work,
    run,
)
