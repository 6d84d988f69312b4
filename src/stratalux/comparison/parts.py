"""A comparison on a cluster: its parts, each made by one machine.

All techniques at one number of rays take turns on one machine, as their times are compared. The passes of the
reference, which nobody times, are dealt out. Errors are measured where the comparison was asked for.
"""

from __future__ import annotations

import gc
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..integrators.large_map import as_mitsuba_has_them
from ..rendering.cluster import check_packages
from ..rendering.settings import MachineSettings
from ..rendering.variants import choose_variant
from ..scenes.load import load
from ..scenes.settings import CameraSettings, SceneSettings
from .contest import Contender, Meter, Rendered, at_rays, seed_of
from .provenance import check_machine, machine
from .records import parse_entries
from .reference import PASSES, Reference, reference_key, reference_of, render_passes_of
from .settings import ComparisonSettings

_TOGETHER = 4
"""Passes of a reference that one machine makes: a scene is loaded for each part."""

Field = tuple[list[Rendered], list[Rendered]]
"""Of the contenders at one number of rays: at equal rays, and at equal time."""


@dataclass(frozen=True)
class Elsewhere:
    """What is compared; ``key`` is that of its reference, see :func:`.reference.reference_key`."""

    scene: SceneSettings
    camera: CameraSettings
    comparison: ComparisonSettings
    machine: MachineSettings
    key: str


@dataclass(frozen=True)
class _Part:
    """``k``: of the number of rays, or else ``passes`` of the reference, by its ``estimator``. ``here``: the machine
    that others have to be like."""

    asked: Elsewhere
    estimator: dict[str, Any]
    here: str
    k: int | None = None
    passes: tuple[int, ...] = ()


def why_not_elsewhere(asked: Any) -> str:
    """Why other machines cannot load that scene, or nothing."""
    if not isinstance(asked, SceneSettings):
        return "the scene was loaded by a program; give its file instead"
    if not isinstance(asked.environment, (str, type(None))):
        return "the map was made by a program; give its file instead"
    return ""


def on_workers(
    asked: Elsewhere,
    estimator: dict[str, Any],
    truth: Reference | None,
    cache: Path | None,
    progress: Callable[[float, str], None] | None,
) -> tuple[list[Field], Reference]:
    """What the contenders have rendered at each number of rays, and the reference, which is made if there is none."""
    check_packages()
    from ..rendering.cluster.parts import timed

    where, variant = str(asked.machine.cluster), str(asked.machine.variant)
    asked = replace(asked, machine=replace(asked.machine, cluster=None))
    one = _Part(asked, estimator, machine(gpu=variant.startswith("cuda")))
    # Those that take longest first
    parts = [replace(one, k=k) for k in reversed(range(len(asked.comparison.rays)))]
    if truth is None:
        parts += [replace(one, passes=tuple(range(PASSES)[k : k + _TOGETHER])) for k in range(0, PASSES, _TOGETHER)]
    fields: dict[int, Field] = {}
    images: dict[int, NDArray[np.float64]] = {}
    seconds = 0.0
    for done, (part, found) in enumerate(timed(where, variant, _made, parts), 1):
        if part.k is None:
            made, took = found
            images |= dict(zip(part.passes, made, strict=True))
            seconds += took
        else:
            fields[part.k] = found
        if progress is not None:
            progress(done / len(parts), f"{done} of {len(parts)} parts")
    if truth is None:
        passes = (images[k] for k in range(PASSES))
        truth = reference_of(passes, estimator, asked.comparison.reference_spp, lambda: seconds, asked.key, cache=cache)
    return [fields[k] for k in sorted(fields)], truth


def _made(part: _Part) -> Any:
    """What a worker makes of it: a :data:`Field`, or images and the seconds that they took.

    Raises :class:`InputError` on another kind of machine, and where the scene is another one.
    """
    asked = part.asked
    check_machine(part.here, gpu=choose_variant(asked.machine.variant).startswith("cuda"))
    gc.collect()  # kernels are compiled for all scenes that live
    with as_mitsuba_has_them(True):
        loaded = load(asked.scene, asked.camera, asked.machine.max_memory)
    scene, camera, chosen = loaded.scene, loaded.camera, asked.comparison
    if reference_key(scene, part.estimator, chosen.reference_spp, camera) != asked.key:
        raise InputError(
            f"cluster: the worker on {socket.gethostname()} has another scene, map or version; install and mount the "
            "same there"
        )
    mi.set_log_level(mi.LogLevel.Error)
    if part.k is None:
        start = time.perf_counter()
        images = list(render_passes_of(scene, part.estimator, chosen.reference_spp, part.passes, camera))
        return images, time.perf_counter() - start
    rays = chosen.rays[part.k]
    contenders = [Contender.at(scene, camera, entry, rays, chosen.spp) for entry in parse_entries(chosen.techniques)]
    seed = seed_of(chosen.seed, chosen.repeats, part.k)
    return at_rays(contenders, seed, chosen.repeats, chosen.spp * rays, Meter(None, 1))
