"""Rendering in passes: progress between them, a clean stop at any of them, and one image at the end."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SceneWarning
from ..images.files import is_picture
from ..images.settings import OutputSettings
from ..images.writing import automatic_exposure, write_image
from ..integrators.accelerate import description_of
from ..integrators.techniques import Technique, Value, parse_technique
from ..scenes.camera import own_camera
from ..scenes.load import Loaded, load
from ..scenes.mitsuba_xml import DIRECT, dark_behind
from ..scenes.surroundings import object_pixels
from ..settings import documented
from .settings import (
    GROUPS,
    LARGEST_SEED,
    METADATA,
    USUAL_DEPTH,
    MachineSettings,
    PictureSettings,
    SamplingSettings,
)
from .variants import choose_variant, why_not

_SAMPLES_PER_PASS = 1 << 25
"""Light samples in one pass: about a second on two cores. A constant, so that a seed always gives the same passes."""
FIRST = 8
"""Where there are several passes, the first is smaller by this factor: there is something to keep soon."""


@dataclass
class RenderResult:
    """What has been rendered so far.

    ``bitmap``: the developed film. ``spp`` of ``spp_total`` samples per pixel are done. ``seconds``: rendering alone;
    ``preparation_seconds``: cutting the map and building tables; ``compile_seconds``: tracing and compiling kernels.
    ``camera_rays``, and ``shadow_rays`` towards the environment at most (none is traced where no light can arrive).
    ``picture``: all that the image depends on; with an integrator of a program's own there is None. ``measure``: how
    large the object is, in words, and ``object_pixels`` those (H, W) that show it; of a scene, nothing. ``float32``:
    whether the scene's film asks for numbers of 32 bits in files.
    """

    bitmap: mi.Bitmap
    spp: int
    spp_total: int
    seconds: float
    preparation_seconds: float
    compile_seconds: float
    camera_rays: int
    shadow_rays: int
    settings: dict[str, Value]
    picture: PictureSettings | None = None
    measure: str = ""
    object_pixels: Callable[[], NDArray[np.bool_]] | None = None
    float32: bool = False

    @property
    def image(self) -> NDArray[np.float32]:
        """Pixels (H, W, C), linear."""
        return np.array(self.bitmap)

    def metadata(self) -> dict[str, Value]:
        """What the OpenEXR file remembers."""
        return {
            **self.settings,
            **({METADATA: self.picture.to_text()} if self.picture else {}),
            "spp": self.spp,
            "seconds": self.seconds,
            "renderTimeSeconds": self.seconds,
            "samplesPerPixel": self.spp,
            "version": f"stratalux {version('stratalux')}, mitsuba {mi.__version__}",
        }

    @property
    def output(self) -> OutputSettings:
        """How the image is stored, as the settings say."""
        return OutputSettings() if self.picture is None else self.picture.output

    @property
    def exposure(self) -> float:
        """Exposure in stops of all pictures: that of the settings, or the automatic one, which meters the object."""
        if self.output.exposure is not None:
            return self.output.exposure
        return automatic_exposure(self.bitmap, None if self.object_pixels is None else self.object_pixels())

    @documented(OutputSettings)
    def write(self, path: str | Path, **settings: Any) -> None:
        """Write the image by the suffix of ``path``; see :func:`stratalux.images.writing.write_image`.

        What is not given is as the image's settings have it; an OpenEXR file has 32 bits where the film asks for them,
        too.
        """
        of_film = {"float32": True} if self.float32 and Path(path).suffix.lower() == ".exr" else {}
        given = self.output.changed() | of_film | settings
        if given.get("exposure") is None and is_picture(path, self.output):
            given["exposure"] = self.exposure
        write_image(path, self.bitmap, self.metadata(), **given)


@documented(*GROUPS.values(), without=("source",))
def render(
    scene: mi.Scene | str | Path | PictureSettings, *, integrator: mi.Integrator | None = None, **settings: Any
) -> RenderResult:
    """Render ``scene`` and return the complete result.

    ``scene``: a loaded ``mi.Scene``, or a Mitsuba XML file, a mesh, or ``"demo"``, which are loaded as
    :func:`stratalux.load_scene` does, or :class:`~.settings.PictureSettings`. An ``integrator`` of your own replaces
    the technique. Raises :class:`InputError` for a scene without that camera and for a variant that cannot render.
    """
    *_, result = render_passes(scene, integrator=integrator, **settings)
    return result


@documented(*GROUPS.values(), without=("source",))
def render_passes(
    scene: mi.Scene | str | Path | PictureSettings, *, integrator: mi.Integrator | None = None, **settings: Any
) -> Iterator[RenderResult]:
    """Render ``scene`` pass by pass, yielding the image so far after each; leave the loop to stop.

    ``strata`` and ``proposals`` are short for those properties of ``stratified``. ``spp``: 0 for the scene's own. Pass
    k uses ``seed`` + k. Everything else is as in :func:`render`.
    """
    picture = scene if isinstance(scene, PictureSettings) else _settings(scene, settings)
    shown = picture.scene
    if shown is None:
        loaded = Loaded(scene, _described(scene), own_camera(picture.camera, scene))
        return _render_passes(loaded, picture, integrator)
    picture = replace(picture, machine=activate(picture.machine))
    loaded = load(shown, picture.camera, picture.machine.max_memory)
    return _render_passes(loaded, picture, integrator)


def _described(scene: Any) -> dict[str, Any] | None:
    own = scene.integrator()
    return None if own is None else description_of(own)


def _settings(scene: Any, settings: dict[str, Any]) -> PictureSettings:
    source = os.fspath(scene) if isinstance(scene, (str, os.PathLike)) else None
    return PictureSettings.of(source, **settings)


def activate(machine: MachineSettings) -> MachineSettings:
    """Make the variant active that is asked for, else keep the one that is, if it can render; say which it is."""
    active = mi.variant()
    if machine.variant is None and active is not None and why_not(active) is None:
        return replace(machine, variant=active)
    return replace(machine, variant=choose_variant(machine.variant))


def _render_passes(
    loaded: Loaded, picture: PictureSettings, integrator: mi.Integrator | None
) -> Iterator[RenderResult]:
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
    own = integrator is not None
    if integrator is None:
        integrator, about, rays_per_sample = _integrator(sampling, loaded)
    film = camera.film()
    spp = sampling.spp or camera.sampler().sample_count()
    picture = replace(
        picture, sampling=replace(sampling, spp=spp), machine=replace(picture.machine, variant=mi.variant())
    )
    start = time.perf_counter()
    if hasattr(integrator, "prepare") and integrator.prepare(scene) is None:
        rays_per_sample = 0
    work = rays_per_sample * max(1, getattr(integrator, "proposals", 1) // 4)
    preparation = time.perf_counter() - start

    pixels = int(np.prod(film.crop_size()))
    seconds, compiling = 0.0, 0.0
    passes = _passes(integrator, scene, camera, sampling.seed, spp, pixels * max(1, work))
    while True:
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            start = time.perf_counter()
            total, done = next(passes, (None, 0.0))
            if total is None:
                return
            dr.sync_thread()
            elapsed = time.perf_counter() - start
            history = dr.kernel_history()
        compile_time = sum(kernel.get("codegen_time", 0) + kernel.get("backend_time", 0) for kernel in history) / 1000
        compiling += compile_time
        seconds += elapsed - compile_time
        yield RenderResult(
            bitmap=_develop(film, total),
            spp=round(done),
            spp_total=spp,
            seconds=seconds,
            preparation_seconds=preparation,
            compile_seconds=compiling,
            camera_rays=round(pixels * done),
            shadow_rays=round(pixels * done) * rays_per_sample,
            settings={**about, "integrator": " ".join(str(integrator).split()), "seed": sampling.seed},
            picture=None if own else picture,
            measure=loaded.measure,
            object_pixels=partial(object_pixels, scene, camera) if loaded.measure else None,
            float32="component_format = float32" in str(film),  # it says so nowhere else
        )


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


def _passes(
    integrator: mi.Integrator, scene: mi.Scene, camera: mi.Sensor, seed: int, spp: int, work: int
) -> Iterator[tuple[mi.TensorXf, float]]:
    """The raw image so far and its samples per pixel, pass by pass. ``work``: light samples for one per pixel."""
    if getattr(integrator, "automatic", False) and integrator.adapts_to(scene, camera):
        for raw, done in integrator.passes(scene, camera, seed, spp):
            yield mi.TensorXf(raw), done
        return
    total: mi.TensorXf | None = None
    done = 0
    for k, count in enumerate(_pass_sizes(spp, work)):
        integrator.render(scene, camera, seed=(seed + k) & LARGEST_SEED, spp=count, develop=False, evaluate=True)
        raw = camera.film().develop(raw=True)
        total = raw if total is None else total + raw
        dr.eval(total)
        done += int(camera.sampler().sample_count())  # some samplers round up
        yield total, float(done)
    # What the last wavefront has left in the sampler would be handed to every kernel that is replayed from then on.
    camera.sampler().seed(0, 1)


def _pass_sizes(spp: int, samples_per_spp: int) -> list[int]:
    """Samples per pixel of each pass: powers of two, as the kernel is the same for all of those, and a rest.

    Where one pass does not do, the first are smaller and double.
    """
    size = max(1, _SAMPLES_PER_PASS // samples_per_spp)
    size = 1 << (size.bit_length() - 1)
    if spp <= size:
        return [spp]
    first = max(1, size // FIRST)
    sizes = [first]
    while (done := sum(sizes)) < spp:
        sizes.append(min(done, size, spp - done))
    return sizes


def _develop(film: mi.Film, raw: mi.TensorXf) -> mi.Bitmap:
    """Develop the weighted sums of several passes as if they had been one."""
    film.prepare([])
    film.put_block(mi.ImageBlock(raw, film.crop_offset()))
    return film.bitmap()
