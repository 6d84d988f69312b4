"""The balance of regions N against proposals M at equal time, which the paper leaves open (section 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..comparison.study import Study
from ..report.model import HeatMap
from .buddha import masks, masks_work
from .measure import REFERENCE_PASSES, Judge, contest, contest_work, make_reference, reference_work
from .pinned import Pinned, importance_mis, stratified
from .scenes import ALPHA, SHINY_ALPHA, Frame, Subject, Workbench
from .settings import Settings

MATERIALS = {
    "diffuse": "diffuse",
    "glossy": f"glossy, roughness {ALPHA:.2f}",
    "shiny": f"shiny, roughness {SHINY_ALPHA}",
}


@dataclass(frozen=True)
class Balance:
    """``equal_time``: relative MSE on the Buddha at equal time, (N, M), NaN where nothing was measured.

    ``relmse`` and ``seconds``: of one rendering, seed by seed, (N, M, seeds).
    """

    material: str
    equal_time: NDArray[np.float64]
    relmse: NDArray[np.float64]
    seconds: NDArray[np.float64]


def _frame(settings: Settings, material: str) -> Frame:
    return Frame(Subject("buddha", material), settings.balance_size)


def _reference_technique(settings: Settings) -> Pinned:
    return importance_mis(settings.reference_samples // REFERENCE_PASSES)


def _cells(settings: Settings) -> dict[tuple[int, int], Pinned]:
    """The techniques by their row and column."""
    return {
        (i, j): stratified(n, m)
        for i, n in enumerate(settings.balance_strata)
        for j, m in enumerate(settings.balance_proposals)
        if n * m <= settings.balance_limit
    }


def balance_work(settings: Settings) -> float:
    total = 0.0
    for material in MATERIALS:
        frame = _frame(settings, material)
        total += masks_work() + reference_work(frame, _reference_technique(settings))
        total += contest_work(frame, list(_cells(settings).values()), settings.balance_seeds)
    return total


def balances(study: Study, bench: Workbench) -> list[Balance]:
    """Measure every cell of the heat maps: those of a map in turn, as their seconds are compared."""
    return [_measure(study, bench, material) for material in MATERIALS]


def _measure(study: Study, bench: Workbench, material: str) -> Balance:
    settings = bench.settings
    frame = _frame(settings, material)
    regions = masks(study, bench, frame)
    reference = make_reference(study, bench, f"balance-{material}-reference", frame, _reference_technique(settings))
    thing = regions.get("object", np.ones(reference.image.shape[:2], dtype=bool))
    judge = Judge(reference, {"object": thing})
    shape = (len(settings.balance_strata), len(settings.balance_proposals), settings.balance_seeds)
    relmse, seconds = np.full(shape, np.nan), np.full(shape, np.nan)
    cells = _cells(settings)
    techniques, seeds = list(cells.values()), settings.balance_seeds
    outcomes = contest(study, bench, f"balance-{material}", frame, techniques, seeds, judge, keep=())
    for cell, outcome in zip(cells, outcomes, strict=True):
        relmse[cell], seconds[cell] = outcome.relmse["object"], outcome.seconds
    # The quickest rendering, as only a disturbance makes one slower: small kernels are easily disturbed.
    error, time = np.median(relmse, axis=2), np.min(seconds, axis=2)
    # Renderings with more seeds average out: error times seconds is constant, and the budget only sets the unit.
    budget = float(np.nanmedian(time))
    return Balance(material, error * time / budget if budget > 0 else error, relmse, seconds)


def heat_map(settings: Settings, balance: Balance) -> HeatMap:
    return HeatMap(
        f"relMSE at equal time: {MATERIALS[balance.material]}",
        "proposals M",
        "regions N",
        tuple(str(m) for m in settings.balance_proposals),
        tuple(str(n) for n in settings.balance_strata),
        balance.equal_time,
        "relMSE",
        text="Error of as many averaged renderings as fit into one time, the same for all cells: relative MSE of a "
        "rendering on the Buddha, times its seconds, over the median of the cells' seconds.",
    )


def best_cell(settings: Settings, balance: Balance) -> tuple[int, int, float]:
    """N and M of the lowest error at equal time, and how many times lower it is than the best with M = 1."""
    cell = np.unravel_index(np.nanargmin(balance.equal_time), balance.equal_time.shape)
    single = np.nanmin(balance.equal_time[:, 0])
    strata, proposals = settings.balance_strata[cell[0]], settings.balance_proposals[cell[1]]
    return strata, proposals, float(single / balance.equal_time[cell])


def more_proposals_against_more_regions(balance: Balance) -> list[float]:
    """What doubling the effort is worth either way, over the cells that have both neighbours.

    For each cell (N, M): efficiency, 1 / (relative MSE · seconds), of the next M at the same N, over that of the next N
    at the same M. Above 1, raising M pays more.
    """
    efficiency = 1 / balance.equal_time
    ratios = efficiency[:-1, 1:] / efficiency[1:, :-1]
    return [float(r) for r in ratios.ravel() if np.isfinite(r)]
