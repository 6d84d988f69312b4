"""Who takes part: our estimator as it is, and every way of running Mitsuba's that may be its best; the search for that.

The search screens all configurations at a low budget and the best of them at a higher one, as convergence
differs with the sampler. What is best at either budget goes on to have its whole curve measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..scenes.mitsuba_xml import DIRECT
from ..scenes.stage import SAMPLERS
from .cases import Suite

SPLITS = ((1, 0), (1, 1), (4, 0), (4, 4), (0, 1))
"""Emitter and BSDF samples of ``direct``."""

CONVERGENCE = 1.25
"""Between independent samples, 1, and what stratification over a pixel may reach; trials differ little in time."""


@dataclass(frozen=True)
class Configuration:
    """A technique as ``NAME[:key=value,...]``, the ``sampler`` of its camera, and what the map is told.

    ``compensated``: the ``mis_compensation`` of Mitsuba's ``envmap``. ``label``: for tables. ``rays`` that a camera
    sample sends, as far as the spacing of budgets is concerned.
    """

    technique: str
    sampler: str
    label: str
    rays: int = 2
    compensated: bool = False

    def spp(self, budget: int) -> int:
        """Samples per pixel that cost about ``budget`` samples of two rays each."""
        return max(1, budget * 2 // max(2, self.rays))


OURS = Configuration("stratified", "multijitter", "stratified")
"""The default of the package: nothing but the samples per pixel is chosen by the benchmark."""


def ours(depth: int) -> Configuration:
    """Ours, for paths of so many segments."""
    if depth == DIRECT:
        return OURS
    return Configuration(f"path-stratified:max_depth={depth}", OURS.sampler, f"path-stratified, depth {depth}")


def mitsuba_configurations(depth: int = DIRECT) -> tuple[Configuration, ...]:
    """Every split of ``direct`` with every sampler, and with the map's compensation wherever that is unbiased.

    Compensation takes density away from where the map is dark, which only BSDF samples can make good, and it has no
    effect where the map is not sampled: it goes with both kinds of samples. For more segments than those of direct
    light, ``path`` with every sampler, with compensation and without.
    """
    if depth != DIRECT:
        return tuple(
            Configuration(
                f"path:max_depth={depth}",
                sampler,
                f"path, depth {depth}{' compensated' if compensated else ''}, {sampler}",
                compensated=compensated,
            )
            for sampler in SAMPLERS
            for compensated in (False, True)
        )
    return tuple(
        Configuration(
            f"direct:emitter_samples={emitter},bsdf_samples={bsdf}",
            sampler,
            f"direct {emitter}+{bsdf}{' compensated' if compensated else ''}, {sampler}",
            emitter + bsdf,
            compensated,
        )
        for sampler in SAMPLERS
        for emitter, bsdf in SPLITS
        for compensated in ((False, True) if emitter and bsdf else (False,))
    )


@dataclass(frozen=True)
class Trial:
    """A configuration as screened: samples per ``budget`` asked for, ``spp`` rendered, ``seconds`` and ``error``."""

    configuration: Configuration
    budget: int
    spp: int
    seconds: float
    error: float

    @property
    def cost(self) -> float:
        """To choose by."""
        return cost(self.seconds, self.error)


def cost(seconds: float, error: float) -> float:
    """What the time to a given error is proportional to, if error ∝ time^−:data:`CONVERGENCE`."""
    return float(seconds * error ** (1 / CONVERGENCE))


def search(
    configurations: Sequence[Configuration], suite: Suite, measure: Callable[[Configuration, int], Trial]
) -> tuple[list[Trial], list[Configuration]]:
    """All trials, and the finalists, best first.

    ``measure``: renders a configuration at a budget. Every configuration is tried at the lowest budget of the suite's
    ladder, the best of them also at the second. Finalists are the best of the second and the best of the first.
    """
    low, high = suite.ladder[:2]
    first = _ranked([measure(configuration, low) for configuration in configurations])
    second = _ranked([measure(trial.configuration, high) for trial in first[: suite.screened]])
    order = [*second[: suite.finalists - 1], first[0], *second[suite.finalists - 1 :]]
    finalists = list(dict.fromkeys(trial.configuration for trial in order))[: suite.finalists]
    return first + second, finalists


def _ranked(trials: Sequence[Trial]) -> list[Trial]:
    return sorted(trials, key=lambda trial: trial.cost)
