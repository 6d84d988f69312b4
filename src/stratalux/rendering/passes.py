"""Rendering in passes: progress between them, a clean stop at any of them, and one image at the end."""

from __future__ import annotations

import importlib.util
import os
import time
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..images.files import is_picture
from ..images.settings import OutputSettings
from ..images.writing import automatic_exposure, write_image
from ..integrators.accelerate import description_of
from ..integrators.launches import Maker, here
from ..integrators.sums import Memory
from ..integrators.techniques import Value
from ..sampling.recording import seconds_of_recordings
from ..scenes.camera import own_camera
from ..scenes.load import Loaded
from ..scenes.metering import incident_light
from ..scenes.sources import sources
from ..scenes.surroundings import object_pixels
from ..settings import documented
from .checkpoint import Checkpoint, identity_of
from .cluster import LOCAL, check_packages
from .ready import loaded_for, ready
from .settings import (
    GROUPS,
    METADATA,
    SAMPLES,
    MachineSettings,
    PictureSettings,
)
from .steps import Step
from .variants import choose_variant, why_not

if TYPE_CHECKING:
    from .cluster.client import Processes


@dataclass
class RenderResult:
    """What has been rendered so far.

    ``bitmap``: the developed film. ``spp`` of ``spp_total`` samples per pixel are done. ``seconds``: rendering alone;
    ``preparation_seconds``: cutting the map and building tables; ``compile_seconds``: tracing and compiling kernels.
    ``camera_rays``, and ``shadow_rays`` towards the environment at most (none is traced where no light can arrive).
    ``picture``: all that the image depends on; with an integrator of a program's own there is None. ``measure``: how
    large the object is, in words, ``object_pixels`` those (H, W) that show it, and ``light``, what falls onto it, see
    :func:`~..scenes.metering.incident_light`; of a scene, nothing. ``float32``: whether the scene's film asks for
    numbers of 32 bits in files. ``variant``: of Mitsuba. ``earlier_seconds``: that it took before it went on from a
    checkpoint. ``noise``: see :meth:`~..integrators.sums.Sums.noise`.
    ``kinds``: see :attr:`~.steps.Steps.work`.
    ``part`` of ``parts`` is under way, ``rows`` of the film: where the film is too large for the memory there is, it is
    made band by band, and ``bitmap`` and ``noise`` are those of all results.
    ``checkpoint``: what goes on from here, see :class:`~.checkpoint.Checkpoint`; there is none with an integrator of a
    program's own. ``workers``: those of a cluster, in words, and where they are watched.
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
    light: Callable[[], float] | None = None
    float32: bool = False
    noise: NDArray[np.float32] | None = None
    earlier_seconds: float = 0.0
    variant: str = ""
    checkpoint: Callable[[], Checkpoint] | None = None
    workers: str = ""
    kinds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    part: int = 0
    parts: int = 1
    rows: slice = field(default_factory=lambda: slice(None))

    @cached_property
    def error(self) -> float | None:
        """Relative standard error of a pixel: the root of the mean square over the object, or over all that is no
        background, divided by the mean. It is an estimate, from two halves of the passes, and rather too large: see
        :meth:`~..integrators.sums.Sums.noise`. None before there are two passes, and for what is black."""
        return self._error_of(slice(None))

    def _error_of(self, rows: slice) -> float | None:
        if self.noise is None:
            return None
        noise = self.noise[rows]
        known = np.isfinite(noise)
        mask = known if self.object_pixels is None else known & self.object_pixels()[rows]
        if not mask.any():
            mask = known
        if not mask.any():
            return None
        image = self._pixels[rows][mask]  # (N, C), or (N) of luminance alone
        mean = float((image[:, : 3 if image.shape[1] > 2 else 1] if image.ndim > 1 else image).mean())
        return float(np.sqrt(np.mean(np.square(noise[mask], dtype=np.float64)))) / mean if mean > 0 else None

    @cached_property
    def _shares(self) -> list[float]:
        """Of the time and of the error that were asked for, of the part of the film that is under way: each has as much
        time as others, and an error of its own."""
        shares: list[float] = []
        if self.picture is not None:
            sampling = self.picture.sampling
            if sampling.time is not None:
                shares.append(self.total_seconds / sampling.time * self.parts - self.part)
            if sampling.target_error is not None:
                error = self.error if self.parts == 1 else self._error_of(self.rows)
                if error is not None:
                    shares.append((sampling.target_error / error) ** 2 if error else 1.0)
        return shares

    @property
    def enough(self) -> bool:
        """Whether it has taken as long, or is as good, as was asked for: the part of the film that is under way."""
        return any(share >= 1 for share in self._shares)

    @property
    def share(self) -> float:
        """Of all that was asked for, as far as it is known, from 0 to 1."""
        within = min(1.0, max(0.0, *self._shares)) if self._shares else 0.0
        return min(1.0, max(self.spp / self.spp_total, (self.part + within) / self.parts if self.parts > 1 else within))

    @property
    def work(self) -> Mapping[str, tuple[float, float]]:
        """How much is done, and of how much, of each kind of samples by name; of a picture that ends by its time or its
        error, of the whole."""
        return self.kinds if self.kinds and not self._shares else {"": (self.share, 1.0)}

    @property
    def total_seconds(self) -> float:
        """Of preparation, compilation and rendering, those before a checkpoint too."""
        return self.earlier_seconds + self.preparation_seconds + self.compile_seconds + self.seconds

    @property
    def image(self) -> NDArray[np.float32]:
        """Pixels (H, W, C), linear."""
        return np.array(self.bitmap)

    @property
    def _pixels(self) -> NDArray[np.float32]:
        """The same, not to be changed."""
        return np.asarray(self.bitmap)

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
        mask = None if self.object_pixels is None else self.object_pixels()
        return automatic_exposure(self.bitmap, mask, 0.0 if self.light is None else self.light())

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
        return _render_passes(loaded, (), picture, integrator, resume)
    picture = replace(picture, machine=activate(picture.machine))
    processes = _processes(picture) if integrator is None else None
    try:
        with sources() as files:
            loaded = loaded_for(picture)
        passes = _render_passes(loaded, files, picture, integrator, resume, processes)
    except BaseException:
        if processes is not None:
            processes.close()
        raise
    if processes is not None:
        weakref.finalize(passes, processes.close)  # whether anybody asks for the first one or not
    return passes


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
    loaded: Loaded,
    files: Iterable[Path],
    picture: PictureSettings,
    integrator: mi.Integrator | None,
    resume: Checkpoint | None,
    processes: Processes | None = None,
) -> Iterator[RenderResult]:
    made = ready(loaded, picture, integrator)
    scene, camera, picture, sampling = loaded.scene, made.camera, made.picture, made.picture.sampling
    film, own = camera.film(), integrator is not None
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
    light = None if shows is None else cache(partial(_light, scene, camera, shows))
    with _maker(files, picture, identity, processes) as (make, workers):
        for step, elapsed, compile_time in _timed(made.steps.all(memory, make)):
            compiling += compile_time
            seconds += elapsed - compile_time
            result = RenderResult(
                bitmap=step.bitmap,
                spp=round(step.spp),
                spp_total=made.spp,
                seconds=seconds,
                preparation_seconds=made.preparation_seconds,
                compile_seconds=compiling,
                camera_rays=round(pixels * step.spp),
                shadow_rays=round(pixels * step.spp) * made.rays_per_sample,
                settings={**made.about, "integrator": " ".join(str(made.integrator).split()), "seed": sampling.seed},
                picture=None if own else picture,
                measure=loaded.measure,
                object_pixels=shows,
                light=light,
                float32="component_format = float32" in str(film),  # it says so nowhere else
                noise=step.noise,
                variant=mi.variant(),
                earlier_seconds=0.0 if resume is None else resume.seconds,
                workers=workers,
                kinds=made.steps.work,
                part=step.part,
                parts=step.parts,
                rows=step.rows,
            )
            if identity is not None:
                result.checkpoint = partial(_checkpoint, identity, memory, result.total_seconds)
            yield result
            if result.enough and made.steps.enough():
                return


def _timed(passes: Iterator[Step]) -> Iterator[tuple[Step, float, float]]:
    """Each pass, the seconds that it took, and those of them that went into tracing and compiling."""
    while True:
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            seconds_of_recordings()
            start = time.perf_counter()
            step = next(passes, None)
            if step is None:
                return
            dr.sync_thread()
            elapsed = time.perf_counter() - start
            history = dr.kernel_history()
        compiling = sum(kernel.get("codegen_time", 0) + kernel.get("backend_time", 0) for kernel in history) / 1000
        # What is recorded is traced and compiled there; its kernels run beside.
        yield step, elapsed, min(elapsed, max(compiling, seconds_of_recordings()))


def _processes(picture: PictureSettings) -> Processes | None:
    """Those of ``local:N``, which start while the scene is loaded here."""
    where = picture.machine.cluster
    if where is None or not where.startswith(LOCAL) or importlib.util.find_spec("distributed") is None:
        return None
    if picture.scene is None or not isinstance(picture.scene.environment, (str, type(None))):
        return None
    from .cluster.client import Processes

    return Processes(where, str(picture.machine.variant), picture.to_text())


@contextmanager
def _maker(
    files: Iterable[Path],
    picture: PictureSettings,
    identity: Callable[[], dict[str, Any]] | None,
    processes: Processes | None = None,
) -> Iterator[tuple[Maker, str]]:
    """Who makes the launches of a picture, and who that is in words, if it is a cluster."""
    where = picture.machine.cluster
    if where is None:
        yield here, ""
        return
    if identity is None:
        raise InputError("cluster: an integrator of a program's own is not there; leave one of them out")
    check_packages()
    from .cluster.client import cluster
    from .cluster.job import Job

    job = Job.of(picture, files, identity())
    with cluster(where, mi.variant(), processes) as workers:
        yield workers.maker(job), str(workers)


def _light(scene: mi.Scene, camera: mi.Sensor, shows: Callable[[], NDArray[np.bool_]]) -> float:
    return incident_light(scene, camera, shows())


def _checkpoint(identity: Callable[[], dict[str, Any]], memory: Memory, seconds: float) -> Checkpoint:
    return Checkpoint(identity(), memory, seconds)
