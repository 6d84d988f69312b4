"""Rendering in passes: progress between them, a clean stop at any of them, and one image at the end."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..images.files import write_image
from ..integrators.techniques import Value, parse_technique

_SAMPLES_PER_PASS = 1 << 25
"""Light samples in one pass: about a second on two cores. A constant, so that a seed always gives the same passes."""


@dataclass
class RenderResult:
    """What has been rendered so far.

    ``bitmap``: the developed film. ``spp`` of ``spp_total`` samples per pixel are done. ``seconds``: rendering alone;
    ``preparation_seconds``: cutting the map and building tables; ``compile_seconds``: tracing and compiling kernels.
    ``camera_rays``, and ``shadow_rays`` towards the environment at most (none is traced where no light can arrive).
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

    @property
    def image(self) -> NDArray[np.float32]:
        """Pixels (H, W, C), linear."""
        return np.array(self.bitmap)

    def metadata(self) -> dict[str, Value]:
        """What the OpenEXR file remembers."""
        return {
            **self.settings,
            "spp": self.spp,
            "seconds": self.seconds,
            "renderTimeSeconds": self.seconds,
            "samplesPerPixel": self.spp,
            "version": f"stratalux {version('stratalux')}, mitsuba {mi.__version__}",
        }

    def write(self, path: str | Path, exposure: float | None = None) -> None:
        """Write the image by the suffix of ``path``; see :func:`stratalux.images.files.write_image`."""
        write_image(path, self.bitmap, self.metadata(), exposure)


def render(scene: mi.Scene, **options: Any) -> RenderResult:
    """Render ``scene`` and return the complete result; the options are those of :func:`render_passes`."""
    *_, result = render_passes(scene, **options)
    return result


def render_passes(
    scene: mi.Scene,
    *,
    technique: str = "stratified",
    strata: int | None = None,
    proposals: int | None = None,
    hide_emitters: bool = False,
    integrator: mi.Integrator | None = None,
    spp: int = 0,
    seed: int = 0,
    sensor: int = 0,
) -> Iterator[RenderResult]:
    """Render ``scene`` pass by pass, yielding the image so far after each; leave the loop to stop.

    ``technique``: ``NAME[:key=value,...]``, see :func:`.techniques.techniques`; ``strata`` and ``proposals``
    are short for those properties of ``stratified``. An ``integrator`` of your own replaces it. ``hide_emitters``:
    leave the map out of the background. ``spp``: samples per pixel, 0 for the scene's own. Pass k uses ``seed`` + k.
    ``sensor``: index of the camera.
    Raises :class:`InputError` for a scene without that camera and for a variant that cannot render.
    """
    if mi.variant() is None or mi.variant().startswith("scalar"):
        raise InputError(
            f"variant {mi.variant()}: rendering needs a vectorised one; mitsuba.set_variant('llvm_ad_rgb')"
        )
    if not 0 <= sensor < len(scene.sensors()):
        raise InputError(f"sensor {sensor}: the scene has {len(scene.sensors())}; add one or choose another")
    settings: dict[str, Value] = {}
    rays_per_sample = 2
    if integrator is None:
        named, given = parse_technique(technique)
        given |= {key: n for key, n in (("strata", strata), ("proposals", proposals)) if n is not None}
        settings = {"technique": named.name, **named.settings(given)}
        rays_per_sample = named.shadow_rays(given)
        integrator = mi.load_dict({**named.integrator(given), "hide_emitters": hide_emitters})
    camera = scene.sensors()[sensor]
    film = camera.film()
    spp = spp or camera.sampler().sample_count()
    start = time.perf_counter()
    if hasattr(integrator, "prepare") and integrator.prepare(scene) is None:
        rays_per_sample = 0
    work = rays_per_sample * max(1, getattr(integrator, "proposals", 1) // 4)
    preparation = time.perf_counter() - start

    pixels = int(np.prod(film.crop_size()))
    seconds, compiling = 0.0, 0.0
    passes = _passes(integrator, scene, camera, seed, spp, pixels * max(1, work))
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
            settings={**settings, "integrator": " ".join(str(integrator).split()), "seed": seed},
        )


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
        integrator.render(scene, camera, seed=seed + k, spp=count, develop=False, evaluate=True)
        raw = camera.film().develop(raw=True)
        total = raw if total is None else total + raw
        dr.eval(total)
        done += int(camera.sampler().sample_count())  # some samplers round up
        yield total, float(done)
    # What the last wavefront has left in the sampler would be handed to every kernel that is replayed from then on.
    camera.sampler().seed(0, 1)


def _pass_sizes(spp: int, samples_per_spp: int) -> list[int]:
    """Samples per pixel of each pass: a power of two, as the kernel is the same for all of those, and a rest."""
    size = max(1, _SAMPLES_PER_PASS // samples_per_spp)
    size = min(spp, 1 << (size.bit_length() - 1))
    passes, rest = divmod(spp, size)
    return [size] * passes + [rest] * (rest > 0)


def _develop(film: mi.Film, raw: mi.TensorXf) -> mi.Bitmap:
    """Develop the weighted sums of several passes as if they had been one."""
    film.prepare([])
    film.put_block(mi.ImageBlock(raw, film.crop_offset()))
    return film.bitmap()
