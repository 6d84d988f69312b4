"""Comparing techniques: at equal numbers of shadow rays, at equal time, against a reference that none of them made.

What a technique is, and how it takes a number of rays, is the business of :mod:`stratalux.integrators.techniques`;
nothing here knows one by name.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from statistics import median

import drjit as dr
import mitsuba as mi
import numpy as np

from ..errors import InputError
from ..images.metrics import Mask, why_no_flip
from ..integrators.techniques import parse_technique
from .contest import FLOOR_MARGIN, Contender, Judge, Meter, Progress, Rounds
from .findings import Findings
from .records import Entry, Record
from .reference import SEED_STEP, choose_estimator, find_reference, make_reference
from .results import write_results

USUAL_MEAN = 0.2
"""The relative MSE is no longer relative in images that are much darker than this; a factor of 4 is worth a note."""

_MASK_SAMPLES = 32
_ROUNDS_OF_TRIALS = 3
"""What the trials of equal time cost, in renderings, as far as the progress bar is concerned."""


class Comparison(Findings):
    """All that a comparison found, and how to keep it."""

    def write(self, folder: str | Path, *, force: bool = False) -> None:
        """Write a report, images, ``results.json`` and curves; see :func:`.results.write_results`."""
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
    fields = [[Contender.at(scene, sensor, entry, n, spp) for entry in contestants] for n in rays]
    estimator = choose_estimator({entry.technique.plugin for entry in contestants})

    truth = find_reference(scene, estimator, reference_spp, sensor=sensor, cache=cache)
    meter = Meter(progress, sum((2 * repeats + 1 + _ROUNDS_OF_TRIALS) * spp * n * len(contestants) for n in rays))
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
    judge = Judge(truth, surface_mask(scene, sensor), flip=no_flip is None)

    rounds = Rounds(seed, repeats, judge, meter)
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
