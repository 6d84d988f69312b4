"""The running of a comparison: contenders, rounds in which they take turns, and the judge of their images."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..images.metrics import Mask, flip, relative_mse, rmse
from ..integrators.techniques import Value
from ..rendering.passes import RenderResult, render
from .records import Entry, Errors, Record, Spread
from .reference import SEED, SEED_STEP, Reference, pixels

Progress = Callable[[float, str], None]
"""Told the fraction of the work that is done and what is going on."""

TIME_TOLERANCE = 0.1
"""How far from the time allowed a setting may be, by its trial run, to be taken as it is."""
_TRIALS = 3
_ROUNDS_OF_TRIALS = 3
"""What the trials of equal time cost, in renderings, as far as the progress bar is concerned."""
_LEAST_SLOPE = 0.25
_LARGEST_STEP = 16
"""A trial is at most so many times longer than what has been seen before."""

FLOOR_MARGIN = 4
"""An error of less than so many times the reference's own is marked: the reference limits it."""


class Contender:
    """An entry at one number of rays: its integrator, loaded once so that its tables stay, and its samples."""

    def __init__(
        self, scene: mi.Scene, sensor: int, entry: Entry, rays: int, properties: dict[str, Value], spp: int
    ) -> None:
        self.scene, self.sensor, self.entry, self.rays = scene, sensor, entry, rays
        self.rays_per_sample = entry.technique.shadow_rays(properties)
        self.description = entry.technique.integrator(properties)
        self.integrator = mi.load_dict(self.description)
        self.spp = self._possible(spp)
        self.preparation_seconds: float | None = None
        self.compile_seconds = 0.0

    @classmethod
    def at(cls, scene: mi.Scene, sensor: int, entry: Entry, rays: int, spp: int) -> Contender:
        properties, factor = entry.technique.with_rays(rays, entry.given)
        return cls(scene, sensor, entry, rays, properties, spp * factor)

    def render(self, seed: int) -> RenderResult:
        return render(self.scene, integrator=self.integrator, spp=self.spp, seed=seed, camera=self.sensor)

    def warm_up(self, seed: int) -> float:
        """Compile and prepare; the seconds that rendering took."""
        result = self.render(seed)
        if self.preparation_seconds is None:  # later renderings find the tables ready
            self.preparation_seconds = result.preparation_seconds
        self.compile_seconds = result.compile_seconds
        return result.seconds

    def fit(self, seconds: float, budget: float, seed: int, meter: Meter, work: float) -> None:
        """Choose the samples per pixel that take ``budget`` seconds, by trial: time has a part that is fixed.

        ``seconds``: what the present number of them takes. What was tried is warm when it is measured.
        """
        tried = [(self.spp, seconds)]
        while len(tried) <= _TRIALS and abs(tried[-1][1] - budget) > TIME_TOLERANCE * budget:
            spp, time = tried[-1]
            slope = time / spp
            if len(tried) > 1 and tried[-2][0] != spp:
                # With a fixed part, a sample costs less than the mean of all; noise must not make it absurdly little.
                secant = (tried[-2][1] - time) / (tried[-2][0] - spp)
                slope = min(max(secant, _LEAST_SLOPE * slope), slope)
            wanted = spp + (budget - time) / slope
            self.spp = self._possible(round(min(max(wanted, 1, spp / _LARGEST_STEP), spp * _LARGEST_STEP)))
            if any(self.spp == before for before, _ in tried):
                break
            # The quicker of two, as only a disturbance makes a rendering slower.
            tried.append((self.spp, min(self.warm_up(seed), self.render(seed).seconds)))
            meter.advance(work / _TRIALS, self.entry.name)
        meter.advance(work * (_TRIALS + 1 - len(tried)) / _TRIALS, self.entry.name)
        self.spp = min(tried, key=lambda trial: abs(math.log(max(trial[1], 1e-9) / max(budget, 1e-9))))[0]

    def _possible(self, spp: int) -> int:
        """Some samplers round the number of samples up, which has to be counted."""
        sampler = self.scene.sensors()[self.sensor].sampler().clone()
        sampler.set_sample_count(max(1, spp))
        return int(sampler.sample_count())


class Meter:
    """How much of the work is done. Its unit, about one ray in every pixel, only has to be fair."""

    def __init__(self, progress: Progress | None, total: float) -> None:
        self.progress, self.total, self.done = progress, total, 0.0

    def advance(self, work: float, what: str) -> None:
        self.done += work
        self.show(0, what)

    def show(self, more: float, what: str) -> None:
        if self.progress is not None:
            self.progress(min(1.0, (self.done + more) / self.total), what)


class Judge:
    """Measures errors against the reference."""

    def __init__(self, reference: Reference, surface: Mask, *, flip: bool) -> None:
        self.reference, self.surface, self.flip = reference, surface, flip
        self.masks: dict[str, Mask | None] = {"surface": surface} if surface.any() else {}
        self.masks["image"] = None
        self.floors = {region: reference.relative_mse_floor(mask) for region, mask in self.masks.items()}

    def errors(self, images: Sequence[NDArray[Any]], seconds: Spread) -> dict[str, Errors]:
        return {region: self._errors(images, seconds, region) for region in self.masks}

    def record(self, entry: Entry, rays: int, found: Rendered) -> Record:
        """What an ``entry`` has rendered at a number of ``rays``, with its errors."""
        budget, images = found.budget_seconds, found.images
        return Record(
            entry=entry,
            rays=rays,
            integrator=found.integrator,
            spp=found.spp,
            rays_per_sample=found.rays_per_sample,
            pixels=images[0].shape[0] * images[0].shape[1],
            seconds=found.seconds,
            preparation_seconds=found.preparation_seconds,
            compile_seconds=found.compile_seconds,
            budget_seconds=budget,
            errors=self.errors(images, found.seconds),
            image=images[0].astype(np.float32),
            stem=f"{entry.stem}-{rays}{'' if budget is None else '-equal-time'}",
        )

    def _errors(self, images: Sequence[NDArray[Any]], seconds: Spread, region: str) -> Errors:
        truth, mask = self.reference.image, self.masks[region]
        relative = Spread(tuple(relative_mse(image, truth, mask) for image in images))
        cost = seconds.median * relative.median
        return Errors(
            rmse=Spread(tuple(rmse(image, truth, mask) for image in images)),
            relative_mse=relative,
            flip=flip(images[0], truth, mask) if self.flip else None,
            efficiency=1 / cost if cost > 0 else float("inf"),
            reference_limited=relative.median < FLOOR_MARGIN * self.floors[region],
        )


@dataclass(frozen=True)
class Rendered:
    """What a contender has rendered in its turns; see :class:`.records.Record`."""

    integrator: dict[str, Value]
    spp: int
    rays_per_sample: int
    preparation_seconds: float
    compile_seconds: float
    budget_seconds: float | None
    seconds: Spread
    images: tuple[NDArray[np.float64], ...]


def work_at(rays: int, spp: int, repeats: int) -> float:
    """Of one contender at a number of rays, as :class:`Meter` counts it."""
    return (2 * repeats + 1 + _ROUNDS_OF_TRIALS) * spp * rays


def seed_of(seed: int, repeats: int, k: int) -> int:
    """That with which the ``k``-th number of rays begins: after those of all rounds before."""
    return seed + k * (2 + 2 * repeats) * SEED_STEP


def at_rays(
    contenders: Sequence[Contender], seed: int, repeats: int, work: float, meter: Meter
) -> tuple[list[Rendered], list[Rendered]]:
    """All of them in turn, at equal rays and at equal time."""
    rounds = Rounds(seed, repeats, meter)
    warm_up_seed = rounds.next_seed()
    for contender in contenders:
        contender.warm_up(warm_up_seed)
        meter.advance(work, contender.entry.name)
    equal_rays = rounds.run(contenders, work, budget=None)
    budget = median(found.seconds.median for found in equal_rays)
    trial_seed = rounds.next_seed()
    for contender, found in zip(contenders, equal_rays, strict=True):
        contender.fit(found.seconds.median, budget, trial_seed, meter, work * _ROUNDS_OF_TRIALS)
    return equal_rays, rounds.run(contenders, work, budget)


class Rounds:
    """Renders contenders in turn, so that what disturbs the machine disturbs all of them."""

    def __init__(self, seed: int, repeats: int, meter: Meter) -> None:
        self.seed, self.repeats, self.meter = seed, repeats, meter

    def next_seed(self) -> int:
        """A seed for one round: the same for all contenders, far from those of other rounds and of the reference."""
        self.seed += SEED_STEP
        return self.seed % SEED

    def run(self, contenders: Sequence[Contender], work: float, budget: float | None) -> list[Rendered]:
        results: list[list[tuple[float, NDArray[Any]]]] = [[] for _ in contenders]
        for _ in range(self.repeats):
            seed = self.next_seed()
            for contender, mine in zip(contenders, results, strict=True):
                result = contender.render(seed)
                mine.append((result.seconds, pixels(result)))
                self.meter.advance(work, contender.entry.name)
        return [
            Rendered(
                integrator=contender.description,
                spp=contender.spp,
                rays_per_sample=contender.rays_per_sample,
                preparation_seconds=contender.preparation_seconds or 0.0,
                compile_seconds=contender.compile_seconds,
                budget_seconds=budget,
                seconds=Spread(tuple(time for time, _ in mine)),
                images=tuple(image for _, image in mine),
            )
            for contender, mine in zip(contenders, results, strict=True)
        ]
