"""Comparing techniques: at equal numbers of shadow rays, at equal time, against a reference that none of them made.

What a technique is, and how it takes a number of rays, is the business of :mod:`stratalux.techniques`; nothing here
knows one by name.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .metrics import Mask, flip, relative_mse, rmse, why_no_flip
from .reference import SEED, SEED_STEP, Reference, choose_estimator, find_reference, make_reference, pixels
from .rendering import RenderResult, render
from .techniques import Technique, Value, parse_technique

Progress = Callable[[float, str], None]
"""Told the fraction of the work that is done and what is going on."""

TIME_TOLERANCE = 0.1
"""How far from the time allowed a setting may be, by its trial run, to be taken as it is."""
_TRIALS = 3
_LEAST_SLOPE = 0.25
_LARGEST_STEP = 16
"""A trial is at most so many times longer than what has been seen before."""

FLOOR_MARGIN = 4
"""An error of less than so many times the reference's own is marked: the reference limits it."""

USUAL_MEAN = 0.2
"""The relative MSE is no longer relative in images that are much darker than this; a factor of 4 is worth a note."""

_MASK_SAMPLES = 32
_ROUNDS_OF_TRIALS = 3
"""What the trials of equal time cost, in renderings, as far as the progress bar is concerned."""


@dataclass(frozen=True)
class Entry:
    """One line of a comparison: a technique with what was ``given`` for it. ``stem`` is how its files begin."""

    name: str
    technique: Technique
    given: dict[str, Value]
    stem: str


@dataclass(frozen=True)
class Spread:
    """The values of the repeats, in order."""

    values: tuple[float, ...]

    @property
    def median(self) -> float:
        return float(np.median(self.values))

    @property
    def minimum(self) -> float:
        return float(np.min(self.values))

    @property
    def maximum(self) -> float:
        return float(np.max(self.values))


@dataclass(frozen=True)
class Errors:
    """Errors over one region of the image.

    ``rmse`` and ``relative_mse`` of each repeat; ``flip``, mean HDR-FLIP of the first repeat (NaN where FLIP is not
    defined, None where it is not installed). ``efficiency``: 1 / (seconds · relative MSE), of the medians.
    ``reference_limited``: the error is not well above that of the reference itself.
    """

    rmse: Spread
    relative_mse: Spread
    flip: float | None
    efficiency: float
    reference_limited: bool


@dataclass(frozen=True)
class Record:
    """One technique at one number of rays.

    ``rays``: what was asked for per shading point and base sample. ``integrator``: dictionary that Mitsuba loads.
    ``spp``: samples per pixel; each sends up to ``rays_per_sample`` rays from its shading point. ``seconds`` of the
    repeats without compilation and preparation, which the first, uncounted rendering reports as
    ``preparation_seconds`` and ``compile_seconds`` (Dr.Jit's cache on disk counts: a kernel of an earlier run is not
    compiled again). ``budget_seconds``: time allowed, at equal time. ``errors``: by region, ``surface`` and ``image``.
    ``image``: of the first repeat, (H, W, C), and ``stem`` the name of its files.
    """

    entry: Entry
    rays: int
    integrator: dict[str, Value]
    spp: int
    rays_per_sample: int
    pixels: int
    seconds: Spread
    preparation_seconds: float
    compile_seconds: float
    budget_seconds: float | None
    errors: dict[str, Errors]
    image: NDArray[np.float32]
    stem: str

    @property
    def rays_per_pixel(self) -> int:
        """Shadow rays in a pixel, at most."""
        return self.spp * self.rays_per_sample

    @property
    def camera_rays(self) -> int:
        return self.pixels * self.spp

    @property
    def shadow_rays(self) -> int:
        """In the whole image, at most: none is traced where nothing is hit."""
        return self.pixels * self.rays_per_pixel


@dataclass(frozen=True)
class Comparison:
    """All that a comparison found.

    ``equal_rays`` and ``equal_time``: a record for each number of rays and entry, in that order. ``surface``: mask
    (H, W) of the pixels that show nothing but surfaces. ``settings``: what it was run with. ``notes``: lines that a
    reader should see.
    """

    entries: tuple[Entry, ...]
    rays: tuple[int, ...]
    reference: Reference
    surface: Mask
    equal_rays: tuple[Record, ...]
    equal_time: tuple[Record, ...]
    settings: dict[str, Any]
    notes: list[str] = field(default_factory=list)

    @property
    def region(self) -> str:
        """The region whose figures are shown first: the surfaces, unless no pixel is all surface."""
        return "surface" if self.surface.any() else "image"

    def mask(self, region: str) -> Mask | None:
        """Mask of a region for the functions of :mod:`stratalux.metrics`."""
        return self.surface if region == "surface" else None

    def relative_to_best(self, record: Record, region: str | None = None) -> float:
        """Efficiency of ``record`` over the best at the same number of rays, in the same part of the comparison."""
        records = self.equal_rays if record.budget_seconds is None else self.equal_time
        region = region or self.region
        best = np.nanmax([other.errors[region].efficiency for other in records if other.rays == record.rays])
        mine = record.errors[region].efficiency
        return 1.0 if mine == best else float(mine / best)

    def write(self, folder: str | Path, *, force: bool = False) -> None:
        """Write images, ``results.json`` and curves; see :func:`stratalux.results.write_results`."""
        from .results import write_results

        write_results(self, folder, force=force)


def compare(
    scene: mi.Scene,
    entries: Sequence[str],
    *,
    rays: Sequence[int] = (16, 32, 64, 128, 256),
    spp: int = 4,
    repeats: int = 3,
    seed: int = 0,
    reference_spp: int = 4096,
    sensor: int = 0,
    name: str = "scene",
    cache: Path | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Compare techniques on ``scene``.

    ``entries``: techniques as ``NAME`` or ``NAME:key=value,...``. A pixel gets ``spp`` camera samples, or more where a
    technique takes a number of ``rays`` per shading point only by more samples. ``repeats``: renderings with different
    seeds, the entries in turn; seeds from ``seed`` on. ``reference_spp``: samples of the reference.
    ``name``: of the scene, for titles. ``cache``: folder for the reference instead of the usual one.

    At each number of rays, every entry is first rendered with that many. Equal time then allows each the median of
    these times over the entries: the samples per pixel are scaled to it, at least 1, checked by trial runs, and
    rendered again.

    Errors are measured against a reference from an estimator none of the entries use, over pixels that are all
    surface (``surface``) and over the whole ``image``. Raises :class:`InputError` for bad input.
    """
    contestants = parse_entries(entries)
    rays = _numbers_of_rays(rays)
    for value, least, what in ((spp, 1, "spp"), (repeats, 1, "repeats"), (reference_spp, 1, "reference spp")):
        if value < least:
            raise InputError(f"{what}: {value} is too small; give at least {least}")
    if not 0 <= seed < SEED_STEP:
        raise InputError(f"seed: {seed} is out of range; give 0 to {SEED_STEP - 1}")
    if not 0 <= sensor < len(scene.sensors()):
        raise InputError(f"sensor {sensor}: the scene has {len(scene.sensors())}; add one or choose another")
    # All are loaded before any work is done: bad properties show at once.
    fields = [[_Contender.at(scene, sensor, entry, n, spp) for entry in contestants] for n in rays]
    estimator = choose_estimator({entry.technique.plugin for entry in contestants})

    truth = find_reference(scene, estimator, reference_spp, sensor=sensor, cache=cache)
    meter = _Meter(progress, sum((2 * repeats + 1 + _ROUNDS_OF_TRIALS) * spp * n * len(contestants) for n in rays))
    if truth is None:
        work = 3 * reference_spp
        meter.total += work
        truth = make_reference(
            scene,
            estimator,
            reference_spp,
            sensor=sensor,
            cache=cache,
            progress=lambda done: meter.show(done * work, "reference"),
        )
        meter.done += work
    no_flip = why_no_flip()
    judge = _Judge(truth, surface_mask(scene, sensor), flip=no_flip is None)

    rounds = _Rounds(seed, repeats, judge, meter)
    equal_rays: list[Record] = []
    equal_time: list[Record] = []
    for n, contenders in zip(rays, fields, strict=True):
        work = spp * n
        warm_up_seed = rounds.next_seed()
        for contender in contenders:
            contender.warm_up(warm_up_seed)
            meter.advance(work, contender.entry.name)
        records = rounds.run(contenders, work, budget=None)
        equal_rays += records
        budget = median(record.seconds.median for record in records)
        trial_seed = rounds.next_seed()
        for contender, record in zip(contenders, records, strict=True):
            contender.fit(record.seconds.median, budget, trial_seed, meter, work * _ROUNDS_OF_TRIALS)
        equal_time += rounds.run(contenders, work, budget)

    film = scene.sensors()[sensor].film()
    comparison = Comparison(
        entries=contestants,
        rays=rays,
        reference=truth,
        surface=judge.surface,
        equal_rays=tuple(equal_rays),
        equal_time=tuple(equal_time),
        settings={
            "scene": name,
            "variant": mi.variant(),
            "width": int(film.crop_size()[0]),
            "height": int(film.crop_size()[1]),
            "sampler": scene.sensors()[sensor].sampler().class_name(),
            "filter": film.rfilter().class_name(),
            "rays": list(rays),
            "spp": spp,
            "repeats": repeats,
            "seed": seed,
            "sensor": sensor,
        },
        notes=[no_flip] if no_flip else [],
    )
    mean = truth.mean(comparison.mask(comparison.region))
    if 0 < mean < USUAL_MEAN / 4 or mean > USUAL_MEAN * 4:
        comparison.notes.append(
            f"the mean of the reference is {mean:.2g}, while the relative MSE is made for about {USUAL_MEAN}; "
            f"light that is {USUAL_MEAN / mean:.2g} times as bright (--env-scale) brings it there"
        )
    limited = sum(r.errors[comparison.region].reference_limited for r in (*equal_rays, *equal_time))
    if limited:
        comparison.notes.append(
            f"{limited} error(s) are less than {FLOOR_MARGIN} times that of the reference itself, and look larger for "
            "it; raise the reference's samples per pixel"
        )
    return comparison


def parse_entries(texts: Sequence[str]) -> tuple[Entry, ...]:
    """Read the techniques of a comparison; raises :class:`InputError` for none, an unknown one, or one named twice."""
    entries: list[Entry] = []
    for text in texts:
        technique, given = parse_technique(text)
        stem = re.sub(r"[^A-Za-z0-9._-]+", "-", text).strip("-.")
        if any(entry.technique.name == technique.name and entry.given == given for entry in entries):
            raise InputError(f"technique '{text}' is given twice; leave one out")
        while any(entry.stem == stem for entry in entries):
            stem += "_"
        entries.append(Entry(text, technique, given, stem))
    if not entries:
        raise InputError("no technique to compare; name at least one")
    return tuple(entries)


def surface_mask(scene: mi.Scene, sensor: int = 0) -> Mask:
    """Pixels (H, W) in which nothing but surfaces is seen, as far as some camera rays in each can tell.

    Pixels in reach of the reconstruction filter count as seen.
    """
    camera = scene.sensors()[sensor]
    film = camera.film()
    width, height = (int(n) for n in film.crop_size())
    index = dr.arange(mi.UInt32, width * height)
    corner = mi.Vector2f(index % width, index // width)
    sampler = mi.load_dict({"type": "independent"})
    mask: Mask = np.ones((height, width), dtype=bool)
    for k in range(_MASK_SAMPLES):
        sampler.seed(k, width * height)
        position = (corner + sampler.next_2d()) / mi.Vector2f(width, height)
        ray, _ = camera.sample_ray(0, sampler.next_1d(), mi.Point2f(position), sampler.next_2d())
        mask &= scene.ray_test(ray).numpy().reshape(height, width)
    reach = int(np.ceil(film.rfilter().radius() - 0.5 - 1e-3))
    if reach > 0:
        # What is beyond the film's edge is not seen.
        padded = np.pad(mask, reach, constant_values=True)
        windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * reach + 1,) * 2)
        mask = np.asarray(windows.all(axis=(2, 3)))
    return mask


def _numbers_of_rays(rays: Sequence[int]) -> tuple[int, ...]:
    if not rays:
        raise InputError("rays: no number given; give for example 16,64,256")
    if min(rays) < 1:
        raise InputError(f"rays: {min(rays)} is too small; give at least 1")
    return tuple(sorted(set(rays)))


class _Contender:
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
    def at(cls, scene: mi.Scene, sensor: int, entry: Entry, rays: int, spp: int) -> _Contender:
        properties, factor = entry.technique.with_rays(rays, entry.given)
        return cls(scene, sensor, entry, rays, properties, spp * factor)

    def render(self, seed: int) -> RenderResult:
        return render(self.scene, integrator=self.integrator, spp=self.spp, seed=seed, sensor=self.sensor)

    def warm_up(self, seed: int) -> float:
        """Compile and prepare; the seconds that rendering took."""
        result = self.render(seed)
        if self.preparation_seconds is None:  # later renderings find the tables ready
            self.preparation_seconds = result.preparation_seconds
        self.compile_seconds = result.compile_seconds
        return result.seconds

    def fit(self, seconds: float, budget: float, seed: int, meter: _Meter, work: float) -> None:
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


class _Meter:
    """How much of the work is done. Its unit, about one ray in every pixel, only has to be fair."""

    def __init__(self, progress: Progress | None, total: float) -> None:
        self.progress, self.total, self.done = progress, total, 0.0

    def advance(self, work: float, what: str) -> None:
        self.done += work
        self.show(0, what)

    def show(self, more: float, what: str) -> None:
        if self.progress is not None:
            self.progress(min(1.0, (self.done + more) / self.total), what)


class _Judge:
    """Measures errors against the reference."""

    def __init__(self, reference: Reference, surface: Mask, *, flip: bool) -> None:
        self.reference, self.surface, self.flip = reference, surface, flip
        self.masks: dict[str, Mask | None] = {"surface": surface} if surface.any() else {}
        self.masks["image"] = None
        self.floors = {region: reference.relative_mse_floor(mask) for region, mask in self.masks.items()}

    def errors(self, images: Sequence[NDArray[Any]], seconds: Spread) -> dict[str, Errors]:
        return {region: self._errors(images, seconds, region) for region in self.masks}

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


class _Rounds:
    """Renders contenders in turn, so that what disturbs the machine disturbs all of them."""

    def __init__(self, seed: int, repeats: int, judge: _Judge, meter: _Meter) -> None:
        self.seed, self.repeats, self.judge, self.meter = seed, repeats, judge, meter

    def next_seed(self) -> int:
        """A seed for one round: the same for all contenders, far from those of other rounds and of the reference."""
        self.seed += SEED_STEP
        return self.seed % SEED

    def run(self, contenders: Sequence[_Contender], work: float, budget: float | None) -> list[Record]:
        results: list[list[tuple[float, NDArray[Any]]]] = [[] for _ in contenders]
        for _ in range(self.repeats):
            seed = self.next_seed()
            for contender, mine in zip(contenders, results, strict=True):
                result = contender.render(seed)
                mine.append((result.seconds, pixels(result)))
                self.meter.advance(work, contender.entry.name)
        return [self._record(c, mine, budget) for c, mine in zip(contenders, results, strict=True)]

    def _record(
        self, contender: _Contender, results: Sequence[tuple[float, NDArray[Any]]], budget: float | None
    ) -> Record:
        seconds = Spread(tuple(time for time, _ in results))
        images = [image for _, image in results]
        return Record(
            entry=contender.entry,
            rays=contender.rays,
            integrator=contender.description,
            spp=contender.spp,
            rays_per_sample=contender.rays_per_sample,
            pixels=images[0].shape[0] * images[0].shape[1],
            seconds=seconds,
            preparation_seconds=contender.preparation_seconds or 0.0,
            compile_seconds=contender.compile_seconds,
            budget_seconds=budget,
            errors=self.judge.errors(images, seconds),
            image=images[0].astype(np.float32),
            stem=f"{contender.entry.stem}-{contender.rays}{'' if budget is None else '-equal-time'}",
        )
