"""From a loaded scene and settings to the steps of a picture."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from ..errors import InputError, SceneWarning
from ..integrators import mitsuba_own
from ..integrators.large_map import as_mitsuba_has_them
from ..integrators.sums import UNLIMITED
from ..integrators.techniques import Technique, Value, parse_technique
from ..scenes.load import Loaded, load
from ..scenes.mitsuba_xml import DIRECT, dark_behind
from .settings import USUAL_DEPTH, PictureSettings, SamplingSettings
from .steps import Steps


@dataclass(frozen=True)
class Ready:
    """A picture that can begin.

    ``picture``: its settings, with what the scene says where they leave something open. ``about``: the technique and
    its properties by name. ``rays_per_sample``: shadow rays for a camera sample. ``spp``: as many as are asked for.
    """

    steps: Steps
    integrator: mi.Integrator
    camera: mi.Sensor
    picture: PictureSettings
    about: dict[str, Value]
    rays_per_sample: int
    spp: int
    preparation_seconds: float


def loaded_for(picture: PictureSettings) -> Loaded:
    """The scene of a ``picture``; with integrators of Mitsuba's, maps have Mitsuba's emitter."""
    assert picture.scene is not None
    technique = (picture.sampling.technique or "").partition(":")[0]
    with as_mitsuba_has_them(technique in {own.name for own in mitsuba_own.TECHNIQUES}):
        return load(picture.scene, picture.camera, picture.machine.max_memory)


def ready(loaded: Loaded, picture: PictureSettings, integrator: mi.Integrator | None = None) -> Ready:
    """Choose the integrator, unless there is one, and prepare it. Raises :class:`InputError`."""
    scene = loaded.scene
    if loaded.integrator and loaded.integrator.get("hide_emitters"):
        picture = replace(picture, sampling=replace(picture.sampling, hide_emitters=True))
    if mi.variant() is None or mi.variant().startswith("scalar"):
        raise InputError(
            f"variant {mi.variant()}: rendering needs a vectorised one; mitsuba.set_variant('llvm_ad_rgb')"
        )
    camera = scene.sensors()[loaded.camera]
    sampling = picture.sampling
    about: dict[str, Value] = {}
    rays_per_sample = 2
    if integrator is None:
        integrator, about, rays_per_sample = _integrator(sampling, loaded)
    spp = sampling.spp
    if spp == 0:
        limited = sampling.time is not None or sampling.target_error is not None
        spp = UNLIMITED if limited else camera.sampler().sample_count()
    picture = replace(
        picture, sampling=replace(sampling, spp=spp % UNLIMITED), machine=replace(picture.machine, variant=mi.variant())
    )
    if hasattr(integrator, "max_memory"):
        integrator.max_memory = picture.machine.max_memory
    start = time.perf_counter()
    with dr.suspend_grad():  # there are none of what is rendered so
        if hasattr(integrator, "prepare") and integrator.prepare(scene) is None:
            rays_per_sample = 0
        preparation = time.perf_counter() - start
        rays = max(1, rays_per_sample * max(1, getattr(integrator, "proposals", 1) // 4))
        steps = Steps(integrator, scene, camera, sampling.seed, spp, rays, picture.machine.max_memory)
    return Ready(steps, integrator, camera, picture, about, rays_per_sample, spp, preparation)


def _integrator(sampling: SamplingSettings, loaded: Loaded) -> tuple[mi.Integrator, dict[str, Value], int]:
    """The integrator of a technique, its properties by name, and its shadow rays for a camera sample."""
    technique, given = technique_of(sampling, loaded.integrator)
    depth = int(given.get("max_depth", -1)) if "max_depth" in technique.properties else DIRECT
    if names := dark_behind(loaded.scene, depth):
        why = "direct light ends at the first surface" if depth == DIRECT else "it does not tell what it lets through"
        warnings.warn(f"what is behind {', '.join(names)} is black: {why}", SceneWarning, stacklevel=2)
    settings = {**technique.integrator(given), **loaded.properties, "hide_emitters": sampling.hide_emitters}
    return (
        mi.load_dict(settings),
        {"technique": technique.name, **technique.settings(given)},
        technique.shadow_rays(given),
    )


def technique_of(
    sampling: SamplingSettings, own: Mapping[str, Any] | None = None
) -> tuple[Technique, dict[str, Value]]:
    """The technique that settings ask for, and its properties that are given; raises :class:`InputError`.

    ``own``: the description of the scene's integrator, for what they leave open.
    """
    pinned = {key: n for key, n in (("strata", sampling.strata), ("proposals", sampling.proposals)) if n is not None}
    own = own or {"type": "path", "max_depth": USUAL_DEPTH}
    if sampling.technique is not None:
        technique, given = parse_technique(sampling.technique)
    elif sampling.direct or pinned or (own["type"] == "direct" and sampling.max_depth is None):
        technique, given = parse_technique("stratified")
    else:
        technique, given = parse_technique("path-stratified")
        given = {key: own[key] for key in technique.properties if key in own}
    if sampling.direct and "max_depth" in technique.properties:
        raise InputError(f"direct: {technique.name} is the whole light; leave one of them out")
    if sampling.max_depth is not None and not (sampling.direct and sampling.max_depth == DIRECT):
        if "max_depth" not in technique.properties:
            raise InputError(f"max_depth: {technique.name} is direct light, of depth 2; leave one of them out")
        given["max_depth"] = sampling.max_depth
    given |= pinned
    technique.settings(given)
    return technique, given
