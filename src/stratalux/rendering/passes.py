"""Rendering in passes: progress between them, a clean stop at any of them, and one image at the end."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
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
from ..integrators.sums import UNLIMITED, Memory
from ..integrators.techniques import Technique, Value, parse_technique
from ..scenes.camera import own_camera
from ..scenes.load import Loaded, load
from ..scenes.mitsuba_xml import DIRECT, dark_behind
from ..scenes.surroundings import object_pixels
from ..settings import documented
from .checkpoint import Checkpoint, identity_of
from .settings import (
    GROUPS,
    METADATA,
    SAMPLES,
    USUAL_DEPTH,
    MachineSettings,
    PictureSettings,
    SamplingSettings,
)
from .steps import steps
from .variants import choose_variant, why_not


@dataclass
class RenderResult:
    """What has been rendered so far.

    ``bitmap``: the developed film. ``spp`` of ``spp_total`` samples per pixel are done. ``seconds``: rendering alone;
    ``preparation_seconds``: cutting the map and building tables; ``compile_seconds``: tracing and compiling kernels.
    ``camera_rays``, and ``shadow_rays`` towards the environment at most (none is traced where no light can arrive).
    ``picture``: all that the image depends on; with an integrator of a program's own there is None. ``measure``: how
    large the object is, in words, and ``object_pixels`` those (H, W) that show it; of a scene, nothing. ``float32``:
    whether the scene's film asks for numbers of 32 bits in files. ``variant``: of Mitsuba. ``earlier_seconds``:
    that it took before it went on from a checkpoint. ``noise``: see :meth:`~..integrators.sums.Sums.noise`.
    ``checkpoint``: what goes on from here, see :class:`~.checkpoint.Checkpoint`; there is none with an integrator of a
    program's own.
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
    noise: NDArray[np.float32] | None = None
    earlier_seconds: float = 0.0
    variant: str = ""
    checkpoint: Callable[[], Checkpoint] | None = None

    @cached_property
    def error(self) -> float | None:
        """Relative standard error of a pixel: the root of the mean square over the object, or over all that is no
        background, divided by the mean. It is an estimate, from two halves of the passes, and rather too large: see
        :meth:`~..integrators.sums.Sums.noise`. None before there are two passes, and for what is black."""
        if self.noise is None:
            return None
        mask = None if self.object_pixels is None else self.object_pixels()
        if mask is None or not mask.any():
            mask = np.ones(self.noise.shape, dtype=bool)
        image = self.image[mask]  # (N, C), or (N) of luminance alone
        mean = float((image[:, : 3 if image.shape[1] > 2 else 1] if image.ndim > 1 else image).mean())
        return float(np.sqrt(np.mean(np.square(self.noise[mask], dtype=np.float64)))) / mean if mean > 0 else None

    @property
    def _shares(self) -> list[float]:
        """Of the time and of the error that were asked for."""
        shares: list[float] = []
        if self.picture is not None:
            sampling = self.picture.sampling
            if sampling.time is not None:
                shares.append(self.total_seconds / sampling.time)
            if sampling.target_error is not None and self.error is not None:
                shares.append((sampling.target_error / self.error) ** 2 if self.error else 1.0)
        return shares

    @property
    def enough(self) -> bool:
        """Whether it has taken as long, or is as good, as was asked for."""
        return any(share >= 1 for share in self._shares)

    @property
    def share(self) -> float:
        """Of all that was asked for, as far as it is known, from 0 to 1."""
        return min(1.0, max(self.spp / self.spp_total, *self._shares, 0.0))

    @property
    def total_seconds(self) -> float:
        """Of preparation, compilation and rendering, those before a checkpoint too."""
        return self.earlier_seconds + self.preparation_seconds + self.compile_seconds + self.seconds

    @property
    def image(self) -> NDArray[np.float32]:
        """Pixels (H, W, C), linear."""
        return np.array(self.bitmap)

    def metadata(self) -> dict[str, Value]:
        """What the OpenEXR file remembers."""
        return {
            **self.settings,
            **(
                {METADATA: self.picture.to_text(), SAMPLES: f"{self.spp} {self.picture.sampling.seed}"}
                if self.picture
                else {}
            ),
            "spp": self.spp,
            **({} if self.error is None else {"relativeStandardError": self.error}),
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
    scene: mi.Scene | str | Path | PictureSettings,
    *,
    integrator: mi.Integrator | None = None,
    resume: str | Path | Checkpoint | None = None,
    **settings: Any,
) -> RenderResult:
    """Render ``scene`` and return the complete result.

    ``scene``: a loaded ``mi.Scene``, or a Mitsuba XML file, a mesh, or ``"demo"``, which are loaded as
    :func:`stratalux.load_scene` does, or :class:`~.settings.PictureSettings`. An ``integrator`` of your own replaces
    the technique. ``resume``: the :class:`~.checkpoint.Checkpoint` of the same picture, to go on from there. Raises
    :class:`InputError` for a scene without that camera, for a variant that cannot render, and for a checkpoint of
    another picture.
    """
    *_, result = render_passes(scene, integrator=integrator, resume=resume, **settings)
    return result


@documented(*GROUPS.values(), without=("source",))
def render_passes(
    scene: mi.Scene | str | Path | PictureSettings,
    *,
    integrator: mi.Integrator | None = None,
    resume: str | Path | Checkpoint | None = None,
    **settings: Any,
) -> Iterator[RenderResult]:
    """Render ``scene`` pass by pass, yielding the image so far after each; leave the loop to stop.

    ``strata`` and ``proposals`` are short for those properties of ``stratified``. ``spp``: 0 for the scene's own, or,
    where ``time`` or ``target_error`` is given, for as many as these allow. Everything else is as in :func:`render`.
    """
    if resume is not None and not isinstance(resume, Checkpoint):
        resume = Checkpoint.load(resume)
    picture = scene if isinstance(scene, PictureSettings) else _settings(scene, settings)
    shown = picture.scene
    if shown is None:
        loaded = Loaded(scene, _described(scene), own_camera(picture.camera, scene))
        return _render_passes(loaded, picture, integrator, resume)
    picture = replace(picture, machine=activate(picture.machine))
    loaded = load(shown, picture.camera, picture.machine.max_memory)
    return _render_passes(loaded, picture, integrator, resume)


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
    loaded: Loaded, picture: PictureSettings, integrator: mi.Integrator | None, resume: Checkpoint | None
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
    spp = sampling.spp
    if spp == 0:
        limited = sampling.time is not None or sampling.target_error is not None
        spp = UNLIMITED if limited else camera.sampler().sample_count()
    picture = replace(
        picture, sampling=replace(sampling, spp=spp % UNLIMITED), machine=replace(picture.machine, variant=mi.variant())
    )
    start = time.perf_counter()
    if hasattr(integrator, "prepare") and integrator.prepare(scene) is None:
        rays_per_sample = 0
    work = rays_per_sample * max(1, getattr(integrator, "proposals", 1) // 4)
    preparation = time.perf_counter() - start

    pixels = int(np.prod(film.crop_size()))
    seconds, compiling = 0.0, 0.0
    identity = None if own else cache(partial(identity_of, scene, picture))
    memory: Memory = {}
    if resume is not None:
        if identity is None:
            raise InputError("resume: an integrator of a program's own cannot be compared; leave one of them out")
        resume.check(identity())
        memory = resume.memory
    shows = cache(partial(object_pixels, scene, camera)) if loaded.measure else None
    passes = steps(integrator, scene, camera, sampling.seed, spp, pixels * max(1, work), memory)
    while True:
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            start = time.perf_counter()
            total, done, noise = next(passes, (None, 0.0, None))
            if total is None:
                return
            dr.sync_thread()
            elapsed = time.perf_counter() - start
            history = dr.kernel_history()
        compile_time = sum(kernel.get("codegen_time", 0) + kernel.get("backend_time", 0) for kernel in history) / 1000
        compiling += compile_time
        seconds += elapsed - compile_time
        result = RenderResult(
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
            object_pixels=shows,
            float32="component_format = float32" in str(film),  # it says so nowhere else
            noise=noise,
            variant=mi.variant(),
            earlier_seconds=0.0 if resume is None else resume.seconds,
        )
        if identity is not None:
            result.checkpoint = partial(_checkpoint, identity, memory, result.total_seconds)
        yield result
        if result.enough:
            return


def _checkpoint(identity: Callable[[], dict[str, Any]], memory: Memory, seconds: float) -> Checkpoint:
    return Checkpoint(identity(), memory, seconds)


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


def _develop(film: mi.Film, raw: NDArray[np.floating[Any]]) -> mi.Bitmap:
    """Develop the weighted sums of several passes as if they had been one."""
    film.prepare([])
    film.put_block(mi.ImageBlock(mi.TensorXf(raw.astype(np.float32)), film.crop_offset()))
    return film.bitmap()
