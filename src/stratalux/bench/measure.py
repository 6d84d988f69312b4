"""The measurement of one case: reference, search, curves."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..assets import Assets
from ..comparison.records import Spread
from ..comparison.reference import SEED, SEED_STEP, Reference, find_reference, make_reference
from ..images.metrics import relative_mse
from ..integrators.techniques import parse_technique
from ..rendering.passes import render
from ..scenes.mitsuba_xml import DIRECT
from .candidates import Configuration, Trial, mitsuba_configurations, ours, search
from .cases import Case, Suite
from .race import Curve, envelope
from .records import CaseResult, CurveRecord, Point
from .scenes import Setting, load_setting

REFERENCE = {"type": "direct", "emitter_samples": 1, "bsdf_samples": 1}
"""With ``multijitter``, in passes of other seeds than any measurement has."""
_STEP = 4
"""From one budget to the next where a ladder is continued: a square's side doubles, as some samplers like it."""

Fraction = Callable[[float], None]


@dataclass(frozen=True)
class Shot:
    """One rendering: samples per pixel that it really took, seconds without compilation, pixels (H, W, 3)."""

    spp: int
    seconds: float
    image: NDArray[np.float32]


class Arena:
    """Renders configurations of either side in a setting, all through :func:`stratalux.render`.

    An integrator is loaded once, so that its tables stay; what they took is noted at its first rendering.
    """

    def __init__(self, setting: Setting) -> None:
        self.setting = setting
        self.seed = 0
        self.preparation: dict[Configuration, tuple[float, float]] = {}
        """Seconds of preparation and of compilation at the first rendering of a configuration."""
        self.shots: dict[tuple[Configuration, int], list[Shot]] = defaultdict(list)
        """What counts: the renderings of each configuration at each number of samples."""
        self._integrators: dict[Configuration, mi.Integrator] = {}

    def next_seed(self) -> int:
        """Far from all others of this setting and from those of the reference."""
        self.seed += SEED_STEP
        return self.seed % SEED

    def possible(self, configuration: Configuration, spp: int) -> int:
        """The samples per pixel that are taken where ``spp`` are asked for: some samplers round up."""
        sampler = self.setting.plain.sensors()[self.setting.cameras[configuration.sampler]].sampler().clone()
        sampler.set_sample_count(max(1, spp))
        return int(sampler.sample_count())

    def shoot(self, configuration: Configuration, spp: int, seed: int) -> Shot:
        if configuration not in self._integrators:
            technique, given = parse_technique(configuration.technique)
            self._integrators[configuration] = mi.load_dict(technique.integrator(given))
        result = render(
            self.setting.compensated if configuration.compensated else self.setting.plain,
            integrator=self._integrators[configuration],
            spp=spp,
            seed=seed,
            camera=self.setting.cameras[configuration.sampler],
        )
        self.preparation.setdefault(configuration, (result.preparation_seconds, result.compile_seconds))
        return Shot(result.spp, result.seconds, result.image)

    def rounds(self, jobs: Sequence[tuple[Configuration, int]], repeats: int, fraction: Fraction) -> None:
        """Render all jobs in turn, ``repeats`` times, so that what disturbs the machine disturbs both sides.

        A configuration that has not been rendered yet with that many samples is warmed up; every other round goes
        backwards, so that a drift of the machine's speed cancels.
        """
        for configuration, spp in jobs:
            if (configuration, spp) not in self.shots:
                self.shoot(configuration, min(spp, _WARM_UP_SPP), self.next_seed())
        for k in range(repeats):
            seed = self.next_seed()
            for n, (configuration, spp) in enumerate(jobs if k % 2 == 0 else jobs[::-1]):
                self.shots[configuration, spp].append(self.shoot(configuration, spp, seed))
                fraction((k + (n + 1) / len(jobs)) / repeats)


_WARM_UP_SPP = 16
"""At most: the kernel hardly depends on the number of samples, and compilation is not counted anyway."""


class Truth:
    """The reference of a setting, and errors against it by region."""

    def __init__(self, case: Case, setting: Setting, reference: Reference) -> None:
        self.reference = reference
        self.masks = {"surface": setting.surface} if setting.surface.any() else {}
        self.masks["image"] = np.ones_like(setting.surface)
        self.region = case.region if case.region in self.masks else "image"
        """The one that the search goes by."""
        self.floors = {region: reference.relative_mse_floor(mask) for region, mask in self.masks.items()}

    def errors(self, image: NDArray[np.float32]) -> dict[str, float]:
        return {region: relative_mse(image, self.reference.image, mask) for region, mask in self.masks.items()}

    def point(self, shots: Sequence[Shot]) -> Point:
        errors = [self.errors(shot.image) for shot in shots]
        return Point(
            shots[0].spp,
            Spread(tuple(shot.seconds for shot in shots)),
            {region: Spread(tuple(error[region] for error in errors)) for region in self.masks},
        )

    def record(self, arena: Arena, configuration: Configuration) -> CurveRecord:
        """All points of a configuration so far."""
        counts = sorted(spp for other, spp in arena.shots if other == configuration)
        return CurveRecord(configuration, tuple(self.point(arena.shots[configuration, spp]) for spp in counts))

    def curve(self, arena: Arena, configuration: Configuration) -> Curve:
        return self.record(arena, configuration).curve(self.region, self.floors[self.region])


def measure_case(
    case: Case, suite: Suite, assets: Assets, *, cache: Path | None = None, fraction: Fraction = lambda _: None
) -> CaseResult:
    """Measure ``case``. ``cache``: folder for references instead of the usual one."""
    setting = load_setting(case, suite, assets)
    arena = Arena(setting)
    reference = reference_of(setting, suite.reference_spp, cache, lambda done: fraction(0.4 * done), suite.depth)
    truth = Truth(case, setting, reference)

    mine = ours(suite.depth)
    configurations = mitsuba_configurations(suite.depth)
    total, tried = len(configurations) + suite.screened * _STEP, 0

    def screen(configuration: Configuration, budget: int) -> Trial:
        nonlocal tried
        spp = configuration.spp(budget)
        # The first compiles; of the others, only a disturbance makes one slower.
        renderings = 3 if budget == suite.ladder[0] else 2
        shots = [arena.shoot(configuration, spp, arena.next_seed()) for _ in range(renderings)]
        tried += 1 if budget == suite.ladder[0] else _STEP
        fraction(0.4 + 0.2 * min(1.0, tried / total))
        error = median(truth.errors(shot.image)[truth.region] for shot in shots) - truth.floors[truth.region]
        seconds = min(shot.seconds for shot in shots[1:])
        return Trial(configuration, budget, shots[0].spp, seconds, max(error, 0.0))

    trials, finalists = search(configurations, suite, screen)
    best = next(trial for trial in reversed(trials) if trial.configuration == finalists[0])
    ladder = our_ladder(_cost(arena, mine), [best.seconds * budget / best.budget for budget in suite.ladder])
    jobs: list[tuple[Configuration, int]] = []
    for spp, budget in zip(ladder, suite.ladder, strict=True):
        asked = [(mine, spp), *((finalist, finalist.spp(budget)) for finalist in finalists)]
        jobs += [(configuration, arena.possible(configuration, count)) for configuration, count in asked]
    arena.rounds(jobs, suite.repeats, lambda done: fraction(0.6 + 0.3 * done))
    left = 0.1
    while jobs := _continuation(truth, arena, finalists, suite):
        left /= 2  # how many more there will be is not known
        arena.rounds(jobs, suite.repeats, lambda done: fraction(1 - 2 * left + left * done))  # noqa: B023

    preparation, compilation = arena.preparation[mine]
    return CaseResult(
        case=case,
        size=setting.size,
        scale=setting.scale,
        surface_fraction=float(setting.surface.mean()),
        means={region: reference.mean(mask) for region, mask in truth.masks.items()},
        floors=truth.floors,
        reference=about_reference(reference),
        trials=tuple(trials),
        ours=truth.record(arena, mine),
        theirs=tuple(truth.record(arena, finalist) for finalist in finalists),
        preparation_seconds=preparation,
        compile_seconds=compilation,
    )


def our_ladder(cost: tuple[float, float], targets: Sequence[float]) -> list[int]:
    """Samples per pixel, powers of two at least one apart, that take about the ``targets``, in seconds.

    ``cost``: seconds of a rendering without any sample, and of a sample per pixel.
    """
    fixed, each = cost
    ladder: list[int] = []
    for seconds in targets:
        spp = 1 << max(0, round(float(np.log2(max(1.0, (seconds - fixed) / each)))))
        ladder.append(max(spp, 2 * ladder[-1]) if ladder else spp)
    return ladder


def _cost(arena: Arena, mine: Configuration) -> tuple[float, float]:
    """Fixed seconds of ours, and seconds of a sample per pixel, from two short renderings."""
    few, many = 1, 4
    seconds = {}
    for spp in (few, many):
        arena.shoot(mine, spp, arena.next_seed())  # compiles
        shots = [arena.shoot(mine, spp, arena.next_seed()) for _ in range(2)]
        seconds[spp] = min(shot.seconds for shot in shots)
    each = max((seconds[many] - seconds[few]) / (many - few), seconds[many] / (4 * many))
    return max(0.0, seconds[few] - each), each


def _continuation(
    truth: Truth, arena: Arena, finalists: Sequence[Configuration], suite: Suite
) -> list[tuple[Configuration, int]]:
    """What to render so that our errors lie within theirs: another budget of the best of them, beside ours again."""
    mine = ours(suite.depth)
    curves = {finalist.label: truth.curve(arena, finalist) for finalist in finalists}
    curves = {label: curve for label, curve in curves.items() if curve.points}
    front = truth.curve(arena, mine).front
    if not front or not curves:
        return []
    by_label = {finalist.label: finalist for finalist in finalists}
    counts: dict[Configuration, list[int]] = defaultdict(list)
    for configuration, spp in arena.shots:
        counts[configuration].append(spp)
    jobs: list[tuple[Configuration, int]] = []
    for _, error in (front[0], front[-1]):
        label, reach = envelope(curves, error)
        best = by_label[label]
        if not reach.outside:
            continue
        above = error > curves[label].front[0][1]
        spp = min(counts[best]) // _STEP if above else max(counts[best]) * _STEP
        if not 1 <= spp <= best.spp(suite.most):
            continue
        spp = arena.possible(best, spp)
        if spp not in counts[best]:
            jobs += [(mine, min(counts[mine]) if above else max(counts[mine])), (best, spp)]
    return jobs


def reference_of(setting: Setting, spp: int, cache: Path | None, progress: Fraction, depth: int = DIRECT) -> Reference:
    sensor = setting.cameras["multijitter"]
    estimator = REFERENCE if depth == DIRECT else {"type": "path", "max_depth": depth}
    found = find_reference(setting.plain, estimator, spp, sensor=sensor, cache=cache)
    return found or make_reference(setting.plain, estimator, spp, sensor=sensor, cache=cache, progress=progress)


def about_reference(reference: Reference) -> dict[str, Any]:
    """How it was made, as in the results' format."""
    return {name: getattr(reference, name) for name in ("estimator", "spp", "passes", "seconds", "key")}


def settings_of(case: Case, suite: Suite) -> dict[str, Any]:
    """What the result of a case depends on, besides the code and the machine."""
    names = ("reference_spp", "ladder", "most", "screened", "finalists", "repeats")
    return {
        "case": case.name,
        "size": suite.preview_size if case.scene == "matpreview" else suite.size,
        **{name: getattr(suite, name) for name in names},
        **({} if suite.depth == DIRECT else {"depth": suite.depth}),
    }
