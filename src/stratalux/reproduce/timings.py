"""The paper's timings: preprocessing, rendering, the visibility test, and the balance of N against M."""

from __future__ import annotations

import time
from statistics import median

from ..comparison.study import Fraction, Result, Study
from ..report.model import Block, Claim, Section, Table
from .balance import Balance, balance_work, balances, best_cell, heat_map, more_proposals_against_more_regions
from .buddha import diffuse_frame
from .item import Item
from .measure import Outcome, contest, contest_work
from .occlusion import bright_directions, hidden_share
from .pinned import importance, stratified, structured
from .scenes import Frame, Subject, Workbench
from .settings import Settings
from .verdicts import by_size, by_spread
from .visibility import Costs, visibility_costs

LIGHTS = 32
RAYS = 16
_SIDES = (stratified(LIGHTS), structured(LIGHTS))
_TIMED = (importance(RAYS), importance(RAYS, "independent"), stratified(RAYS), structured(RAYS))
_COST_RAYS = 64
_PAPER_RATIO = 7.36
_DIRECTIONS = 64
_DRASTICALLY = 10.0
"""Preprocessing is drastically cheaper beyond this ratio; the paper's is 200."""
_STRUCTURED_SECONDS = 1.5


def _preprocessing_work(settings: Settings) -> float:
    return (settings.rounds + 1) * _STRUCTURED_SECONDS


def _visibility_frames(settings: Settings) -> list[Frame]:
    return [Frame(Subject("buddha", "diffuse", n), settings.size) for n in (0, settings.subdivisions)]


def _visibility_work(frame: Frame, settings: Settings) -> float:
    loading = 1.0 + 4.0**frame.subject.subdivisions
    return loading + 3 * (_cost_rounds(settings) + 1) * stratified(_COST_RAYS).seconds * frame.lanes / 1e6


def _cost_rounds(settings: Settings) -> int:
    """More than of others: it is the differences that count."""
    return 2 * settings.rounds + 1


def work(settings: Settings) -> dict[str, float]:
    total = _preprocessing_work(settings) + balance_work(settings)
    total += contest_work(diffuse_frame(settings), _TIMED, settings.rounds)
    return {"timings": total + sum(_visibility_work(frame, settings) for frame in _visibility_frames(settings))}


def run(study: Study, bench: Workbench) -> Section:
    settings = bench.settings
    frame = diffuse_frame(settings)
    ready = study.step(
        "timings-preprocessing",
        bench.fingerprint(frame) | {"sides": [side.text for side in _SIDES], "rounds": settings.rounds},
        _preprocessing_work(settings),
        lambda fraction: _preprocessing(bench, frame, fraction),
    )["seconds"]
    rendered = contest(study, bench, "timings-render", frame, _TIMED, settings.rounds, keep=())
    costs = [_costs(study, bench, frame) for frame in _visibility_frames(settings)]
    found = balances(study, bench)
    claims = (
        _preprocessing_claim(ready),
        _visibility_claim(costs),
        _balance_claim(settings, found),
    )
    blocks: tuple[Block, ...] = (
        _render_table(rendered),
        _visibility_table(costs),
        *(heat_map(settings, balance) for balance in found),
    )
    return Section(
        "timings",
        ITEM.title,
        (
            f"Medians of {settings.rounds} rounds, the sides in turn after a warm-up; seconds of the kernels, without "
            f"compiling them. Diffuse Buddha, {frame.size[0]}x{frame.size[1]}, one camera ray for each pixel.",
        ),
        claims,
        blocks,
    )


def _preprocessing(bench: Workbench, frame: Frame, fraction: Fraction) -> Result:
    scene = bench.view(frame).scene
    seconds: list[list[float]] = [[] for _ in _SIDES]
    for k in range(bench.settings.rounds + 1):
        for side, mine in zip(_SIDES, seconds, strict=True):
            integrator = side.load()  # a new one: nothing is remembered from the round before
            start = time.perf_counter()
            integrator.prepare(scene)
            if k:
                mine.append(time.perf_counter() - start)
        fraction((k + 1) / (bench.settings.rounds + 1))
    return {"seconds": seconds}


def _costs(study: Study, bench: Workbench, frame: Frame) -> Costs:
    technique, rounds = stratified(_COST_RAYS), _cost_rounds(bench.settings)

    def compute(fraction: Fraction) -> Result:
        view = bench.view(frame)
        everywhere = bench.to_world(bright_directions(bench.environment, _DIRECTIONS, share=1.0))
        _, above = hidden_share(view, everywhere)
        return vars(visibility_costs(view, technique, above, rounds, fraction))

    name = f"timings-visibility-{frame.subject.subdivisions}"
    settings = bench.fingerprint(frame) | {"technique": technique.text, "rounds": rounds, "directions": _DIRECTIONS}
    return Costs(**study.step(name, settings, _visibility_work(frame, bench.settings), compute))


def _preprocessing_claim(seconds: list[list[float]]) -> Claim:
    ours, theirs = (median(side) for side in seconds)
    return Claim(
        f"Preprocessing of stratified sampling ({LIGHTS} regions) is drastically cheaper than that of structured",
        "0.10 s against 20 s, 1 : 200",
        f"{ours:.3f} s against {theirs:.2f} s, 1 : {theirs / ours:.0f}",
        by_size([b / a for a, b in zip(*seconds, strict=True)], _DRASTICALLY),
        "Cut, CDFs and upload against thresholding, placing the lights and assigning texels to them. Holds if it is "
        f"more than {_DRASTICALLY:.0f} times as fast in every round. The structured side is vectorised here.",
    )


def _visibility_claim(costs: list[Costs]) -> Claim:
    ratios = [cost.ratio for cost in costs]
    return Claim(
        "A visibility test costs much more than the generation of a sample",
        f"{_PAPER_RATIO} : 1 (kd-tree, 1M triangles)",
        "; ".join(f"{cost.ratio:.2f} : 1 ({cost.ratio_with_surface:.2f} : 1 with the BSDF)" for cost in costs)
        + " on the mesh and on its subdivision",
        by_size(ratios, _PAPER_RATIO / 2),
        "Holds if the ratio is more than half of the paper's on both meshes, partly if it is above 1. Rays have become "
        "much cheaper since the kd-trees of 2006, while a sample still needs scattered reads of a CDF and of the map.",
    )


def _balance_claim(settings: Settings, found: list[Balance]) -> Claim:
    best = [(balance, *best_cell(settings, balance)) for balance in found]
    glossy = next(balance for balance in found if balance.material == "glossy")
    trades = more_proposals_against_more_regions(glossy)
    return Claim(
        "Raising M might be more effective than raising N, as samples are cheaper than visibility tests",
        "no figure (sections 4 and 5)",
        "best at equal time: "
        + "; ".join(f"{balance.material} N = {n}, M = {m} ({gain:.2f} times M = 1)" for balance, n, m, gain in best),
        by_spread(trades) if trades else "not tested",
        f"On the glossy Buddha, the next M in place of the next N is worth {median(trades):.2f} times the efficiency "
        f"({min(trades):.2f} to {max(trades):.2f} over the cells). Holds if it is worth more than 1 in every cell, "
        "partly if in the median of the cells."
        if trades
        else "Too few cells.",
    )


def _render_table(rendered: list[Outcome]) -> Table:
    rows = tuple(
        (
            outcome.technique.label,
            f"{outcome.time:.4f}",
            f"{min(outcome.seconds):.4f} to {max(outcome.seconds):.4f}",
            f"{outcome.preparation_seconds:.3f}",
            f"{outcome.compile_seconds:.2f}",
        )
        for outcome in rendered
    )
    header = ("", "seconds", "range", "preparation, s", "compilation, s")
    return Table(
        f"Render time with {RAYS} rays for a shading point",
        header,
        rows,
        "The paper has 161.4 s for importance sampling and 145.1 s for stratified sampling; the claim is among those "
        "of figure 3.",
    )


def _visibility_table(costs: list[Costs]) -> Table:
    rows = []
    for what, cost in zip(("the mesh as it is", "subdivided"), costs, strict=True):
        figures = (f"{value:.1f}" for value in (cost.sample, cost.surface, cost.test))
        rows.append(
            (what, *figures, f"{100 * cost.tests:.0f} %", f"{cost.ratio:.2f}", f"{cost.ratio_with_surface:.2f}")
        )
    header = (
        "Buddha",
        "sample, ns",
        "BSDF, ns",
        "visibility test, ns",
        "samples tested",
        "test : sample",
        "test : both",
    )
    return Table(
        "What a light sample and a visibility test cost",
        header,
        tuple(rows),
        "Nanoseconds of wall time on all cores: the same loop with and without the test, and with and without the "
        "BSDF. Samples below the surface are not tested.",
    )


ITEM = Item(
    "timings",
    "Timings: preprocessing, rendering, visibility, and N against M",
    ("grace", "buddha"),
    work,
    run,
)
