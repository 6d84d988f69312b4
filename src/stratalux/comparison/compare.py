"""Comparing techniques: at equal numbers of shadow rays, at equal time, against a reference that none of them made.

What a technique is, and how it takes a number of rays, is the business of :mod:`stratalux.integrators.techniques`;
nothing here knows one by name.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..errors import InputError
from ..images.metrics import Mask, why_no_flip
from ..integrators.large_map import as_mitsuba_has_them
from ..rendering.passes import activate
from ..rendering.settings import MachineSettings
from ..scenes.camera import own_camera
from ..scenes.load import load
from ..scenes.settings import CameraSettings, SceneSettings
from ..scenes.surroundings import shrunk
from ..settings import Settings, command_line, documented
from .contest import FLOOR_MARGIN, Contender, Judge, Meter, Progress, Rendered, at_rays, seed_of, work_at
from .findings import Findings
from .parts import Elsewhere, on_workers, why_not_elsewhere
from .records import parse_entries
from .reference import choose_estimator, find_reference, make_reference, reference_key
from .results import write_results
from .settings import ComparisonSettings

USUAL_MEAN = 0.2
"""The relative MSE is no longer relative in images that are much darker than this; a factor of 4 is worth a note."""

_MASK_SAMPLES = 32


class Comparison(Findings):
    """All that a comparison found, and how to keep it."""

    def write(self, folder: str | Path, *, force: bool = False) -> None:
        """Write a report, images, ``results.json`` and curves; see :func:`.results.write_results`."""
        write_results(self, folder, force=force)


@documented(ComparisonSettings, SceneSettings, CameraSettings, MachineSettings, without=("source", "techniques"))
def compare(
    scene: mi.Scene | str | Path | SceneSettings,
    entries: Sequence[str],
    *,
    name: str | None = None,
    cache: Path | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> Comparison:
    """Compare techniques on ``scene``, which is a loaded one, or what :func:`stratalux.load_scene` loads.

    ``entries``: techniques as ``NAME`` or ``NAME:key=value,...``. A pixel gets ``spp`` camera samples, or more where a
    technique takes a number of ``rays`` per shading point only by more samples. ``repeats``: renderings with different
    seeds, the entries in turn; seeds from ``seed`` on. ``reference_spp``: samples of the reference.
    ``name``: of the scene, for titles. ``cache``: folder for the reference instead of the usual one.

    At each number of rays, every entry is first rendered with that many. Equal time then allows each the median of
    these times over the entries: the samples per pixel are scaled to it, at least 1, checked by trial runs, and
    rendered again.

    Errors are measured against a reference from an estimator none of the entries use, over pixels that are all
    surface (``surface``) and over the whole ``image``. On a ``cluster``, all techniques at one number of rays are
    rendered in turn by one machine, and these have to be alike. Raises :class:`InputError` for bad input.
    """
    chosen = ComparisonSettings(techniques=tuple(entries), **_taken(ComparisonSettings, settings))
    camera = CameraSettings(**_taken(CameraSettings, settings))
    machine = MachineSettings(**_taken(MachineSettings, settings))
    shown = None
    if isinstance(scene, (str, os.PathLike)):
        shown = SceneSettings(os.fspath(scene), **_taken(SceneSettings, settings))
    if settings:
        raise InputError(
            f"setting '{min(settings)}': is unknown, or the scene is loaded already; give it to load_scene"
        )
    return run_comparison(shown or scene, chosen, camera, machine, name=name, cache=cache, progress=progress)


def run_comparison(
    asked: mi.Scene | SceneSettings,
    chosen: ComparisonSettings,
    camera: CameraSettings,
    machine: MachineSettings,
    *,
    name: str | None = None,
    cache: Path | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """The same from groups of settings; see :func:`compare`."""
    if machine.cluster is not None and (why := why_not_elsewhere(asked)):
        raise InputError(f"cluster: {why}")
    scene: Any = asked
    shown = asked if isinstance(asked, SceneSettings) else None
    if shown is not None:
        machine = activate(machine)
        parse_entries(chosen.techniques)  # before a large scene is loaded
        with as_mitsuba_has_them(True):
            loaded = load(shown, camera, machine.max_memory)
        scene, sensor = loaded.scene, loaded.camera
        name = name or Path(shown.source).stem
    else:
        sensor = own_camera(camera, scene)
    contestants = parse_entries(chosen.techniques)
    rays, spp, repeats, seed = chosen.rays, chosen.spp, chosen.repeats, chosen.seed
    reference_spp = chosen.reference_spp
    # All are loaded before any work is done: bad properties show at once.
    fields = [[Contender.at(scene, sensor, entry, n, spp) for entry in contestants] for n in rays]
    estimator = choose_estimator({entry.technique.plugin for entry in contestants})

    truth = find_reference(scene, estimator, reference_spp, sensor=sensor, cache=cache)
    rendered: list[tuple[list[Rendered], list[Rendered]]]
    if machine.cluster is not None and shown is not None:
        elsewhere = Elsewhere(shown, camera, chosen, machine, reference_key(scene, estimator, reference_spp, sensor))
        rendered, truth = on_workers(elsewhere, estimator, truth, cache, progress)
    else:
        meter = Meter(progress, sum(work_at(n, spp, repeats) * len(contestants) for n in rays))
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
        rendered = [
            at_rays(contenders, seed_of(seed, repeats, k), repeats, spp * n, meter)
            for k, (n, contenders) in enumerate(zip(rays, fields, strict=True))
        ]
    no_flip = why_no_flip()
    judge = Judge(truth, surface_mask(scene, sensor), flip=no_flip is None)
    equal_rays, equal_time = (
        tuple(
            judge.record(entry, n, found)
            for n, parts in zip(rays, rendered, strict=True)
            for entry, found in zip(contestants, parts[part], strict=True)
        )
        for part in (0, 1)
    )

    film = scene.sensors()[sensor].film()
    comparison = Comparison(
        entries=contestants,
        rays=rays,
        reference=truth,
        surface=judge.surface,
        equal_rays=equal_rays,
        equal_time=equal_time,
        settings={
            "scene": name or "scene",
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
            **_remembered(shown, chosen, camera, machine),
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
    return shrunk(mask, film)


def _taken(group: type[Settings], settings: dict[str, Any]) -> dict[str, Any]:
    """Take what belongs to ``group`` out of ``settings``."""
    return {field.name: settings.pop(field.name) for field in fields(group) if field.name in settings}


def _remembered(
    shown: SceneSettings | None, chosen: ComparisonSettings, camera: CameraSettings, machine: MachineSettings
) -> dict[str, Any]:
    """All that the comparison was asked for, and the command that asks for it again, where one can."""
    try:
        command = shown and command_line("stratalux", "compare", shown, camera, chosen, machine)
    except InputError:
        command = None
    return {
        "asked": {
            "scene": shown and shown.to_json(),
            "camera": camera.to_json(),
            "comparison": chosen.to_json(),
            "machine": machine.to_json(),
        },
        "command": command,
    }
