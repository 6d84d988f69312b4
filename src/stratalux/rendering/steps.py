"""The steps of a picture: one pass after the other, of any integrator."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..errors import SceneWarning
from ..integrators.launches import Arrays, Launch, Maker, grown, here, number_for, of_part
from ..integrators.memory import NoRoom, samples_at_once
from ..integrators.sums import UNLIMITED, Memory, Noise, Sums, reach_of
from .bands import NAME, Band, bands, empty_like, number, only, pixels_of
from .settings import LARGEST_SEED

_SAMPLES_PER_PASS = 1 << 25
"""Light samples in one pass: about a second on two cores. A constant, so that a seed always gives the same passes."""
_LANES = 1 << 22
"""Camera samples in one pass, at most, or one of each pixel: it is less work where there are few light samples."""
_PIXEL_BYTES, _LANE_BYTES = 150, 80
"""Memory that a pixel of the film takes, and a camera sample of a pass."""
FIRST = 8
"""Where there are several passes, the first is smaller by this factor: there is something to keep soon."""
_SPREAD = 0x9E3779B1
"""Passes of one seed are not those of another one (Knuth's multiplicative hash of 32 bits)."""
_ENDLESS = 1 << 40
"""Passes, where there are as many as there is time for."""
_PASSES = "passes"
"""The stage of an integrator that does not know of stages."""
_BANDS = "bands"
"""Their number, in the memory of a film that is made of them."""


@dataclass(frozen=True)
class Step:
    """The picture so far, its samples per pixel, and its noise (:meth:`~..integrators.sums.Sums.noise`).

    ``part`` of ``parts`` is under way, rows ``rows`` of the film: of a film that is too large for the memory there is.
    """

    bitmap: mi.Bitmap
    spp: float
    noise: NDArray[np.float32] | None
    part: int = 0
    parts: int = 1
    rows: slice = field(default_factory=lambda: slice(None))


class Steps:
    """Those of a picture. ``rays``: light samples for each camera sample, in all. ``max_memory``: bytes that the
    process may take, see :func:`~..integrators.memory.samples_at_once`."""

    def __init__(
        self,
        integrator: mi.Integrator,
        scene: mi.Scene,
        camera: mi.Sensor,
        seed: int,
        spp: int,
        rays: int,
        max_memory: int | None = None,
    ) -> None:
        self._integrator, self._scene, self._camera, self._seed, self._spp = integrator, scene, camera, seed, spp
        self._max_memory, self._rays = max_memory, rays
        self._automatic = getattr(integrator, "automatic", False) and integrator.adapts_to(scene, camera)
        width, height = (int(side) for side in camera.film().crop_size())
        self._size = width, height
        self._sizes = PassSizes(spp, width * height * max(rays, _SAMPLES_PER_PASS // _LANES))
        self._part, self._parts, self._next = 0, 1, False
        self._band = ""

    def all(self, memory: Memory, make: Maker = here) -> Iterator[Step]:
        """Pass by pass. ``memory``: of what is done, and of nothing at first. ``make``: who makes them."""
        if _BANDS not in memory:
            begun = bool(memory)
            try:
                for raw, done, noise in self._whole(memory, make):
                    yield Step(self._developed(raw), done, noise)
                return
            except NoRoom as error:
                if begun:  # as a whole
                    raise
                count = number(error, self._camera.film())
                memory.clear()
                memory[_BANDS] = np.array(count)
            width, height = self._size
            warnings.warn(
                f"memory: a film of {width}x{height} pixels has no room at once; it is rendered in {count} bands",
                SceneWarning,
                stacklevel=2,
            )
        yield from self._banded(memory, make)

    def enough(self) -> bool:
        """The part of the film that is under way has come to its end; whether it was the last one."""
        self._next = True
        return self._part + 1 == self._parts

    @property
    def work(self) -> dict[str, tuple[float, float]]:
        """How many samples of each kind are done, and how many there will be, where these take unlike times."""
        if not self._automatic:
            return {}
        before, parts = self._part, self._parts
        return {kind: (before * all + done, parts * all) for kind, (done, all) in self._integrator.work.items()}

    def launch(self, stage: str, known: Memory) -> Launch:
        """That of a stage, for who makes launches elsewhere: see :class:`~..integrators.launches.Maker`."""
        if stage.startswith(NAME):
            return self._launch_of_band(stage, known)
        if stage == _PASSES:
            return self._pass
        made: Launch = self._integrator.launch(self._scene, self._camera, self._seed, self._spp, stage, known)
        return made

    def _whole(self, memory: Memory, make: Maker) -> Iterator[tuple[NDArray[np.floating[Any]], float, Noise]]:
        """The raw image so far, its samples per pixel, and its noise."""
        if self._automatic:
            yield from self._integrator.passes(self._scene, self._camera, self._seed, self._spp, memory, make)
            return
        samples_at_once(self._max_memory, self._size, _PIXEL_BYTES, _LANE_BYTES, self._size[0] * self._size[1])
        sums = Sums(memory)
        if sums.launches:
            yield sums.raw(), float(memory["done"]), sums.noise()
        for done, found in make(_PASSES, {}, sums.launches, len(self._sizes), self._pass):
            sums.add(found["raw"], done)
            memory["done"] = memory.get("done", 0) + int(found["samples"])
            yield sums.raw(), float(memory["done"]), sums.noise()
        # What the last wavefront has left in the sampler would be handed to every kernel that is replayed from then on.
        self._camera.sampler().seed(0, 1)

    def _developed(self, raw: NDArray[np.floating[Any]]) -> mi.Bitmap:
        """Develop the weighted sums of several passes as if they had been one."""
        film = self._camera.film()
        film.prepare([])
        film.put_block(mi.ImageBlock(mi.TensorXf(raw.astype(np.float32)), film.crop_offset()))
        return film.bitmap()

    def _pass(self, k: int) -> Arrays:
        camera, seed = self._camera, self._seed if k == 0 else _another(self._seed, k)
        self._integrator.render(self._scene, camera, seed=seed, spp=self._sizes[k], develop=False, evaluate=True)
        # Some samplers round up.
        samples = np.array(camera.sampler().sample_count(), dtype=np.int64)
        return {"raw": np.array(camera.film().develop(raw=True)).astype(np.float64), "samples": samples}

    # Of the memory of bands, "pixels", "noise" and "spp" are of all of them, and "now" of the one under way.

    def _banded(self, memory: Memory, make: Maker) -> Iterator[Step]:
        camera, (width, height) = self._camera, self._size
        with only(camera, 0, 1):
            camera.film().prepare([])
            whole = empty_like(camera.film().bitmap(), height)
        pixels = pixels_of(whole)
        pixels[...] = memory.get("pixels", 0)  # also so that its memory is there, and counts
        memory["pixels"] = pixels
        self._parts = int(memory[_BANDS])
        done = memory.setdefault("spp", np.zeros(self._parts))
        cut = bands(height, self._parts, reach_of(camera.film()))
        weights = [band.bottom - band.top for band in cut]
        first = self._part = int(memory.get("part", 0))

        def step(rows: slice) -> Step:
            spp = float(np.average(done, weights=weights))
            return Step(whole, spp, memory.get("noise"), self._part, self._parts, rows)

        if first == self._parts:
            self._part -= 1
            yield step(slice(None))
        for part, band in enumerate(cut[first:], first):
            self._part, self._next = part, False
            rows, inner = slice(band.top, band.bottom), slice(band.top - band.first, band.bottom - band.first)
            for bitmap, done[part], noise in self._inside(band, memory.setdefault("now", {}), make):
                pixels[rows] = pixels_of(bitmap)[inner]
                if noise is not None:
                    if "noise" not in memory:
                        memory["noise"] = np.full((height, width), np.nan, np.float32)
                    memory["noise"][rows] = noise[inner]
                yield step(rows)
                if self._next:
                    break
            memory["part"], memory["now"] = part + 1, {}
            dr.flush_malloc_cache()

    def _inside(self, band: Band, memory: Memory, make: Maker) -> Iterator[tuple[mi.Bitmap, float, Noise]]:
        """Of one band: developed, its samples per pixel, and its noise."""
        steps = self._of(band)
        passes = steps._whole(memory, of_part(make, band.name))
        while True:
            with only(self._camera, band.first, band.last):
                found = next(passes, None)
                if found is None:
                    return
                raw, done, noise = found
                bitmap = self._developed(raw)
            yield bitmap, done, noise

    def _of(self, band: Band) -> Steps:
        """The steps of a band, which is a picture of its own."""
        with only(self._camera, band.first, band.last):
            seed = _another(self._seed, band.first) if band.first else self._seed
            return Steps(self._integrator, self._scene, self._camera, seed, self._spp, self._rays, self._max_memory)

    def _launch_of_band(self, stage: str, known: Memory) -> Launch:
        name, _, inner = stage.partition("/")
        band = Band.called(name)
        steps, made = self._of(band), None

        def launch(k: int) -> Arrays:
            nonlocal made
            with only(self._camera, band.first, band.last):
                if made is None or self._band != name:  # the integrator has seen another one meanwhile
                    made, self._band = steps.launch(inner, known), name
                return made(k)

        return launch


def _another(seed: int, k: int) -> int:
    """Seed, of those that belong to a ``seed``."""
    return (seed * _SPREAD + k) & LARGEST_SEED


class PassSizes:
    """Samples per pixel of each pass: powers of two, as the kernel is the same for all of those, and a rest.

    Where one pass does not do, the first are smaller and double.
    """

    def __init__(self, spp: int, samples_per_spp: int) -> None:
        size = max(1, _SAMPLES_PER_PASS // samples_per_spp)
        size = 1 << (size.bit_length() - 1)
        self._spp, self._times = spp, min(FIRST, size)
        self._first = size // self._times

    def __len__(self) -> int:
        if self._spp >= UNLIMITED:
            return _ENDLESS
        much = -(-self._spp // self._first)
        return 1 if much <= self._times else number_for(much, self._times)

    def __getitem__(self, k: int) -> int:
        if not 0 <= k < len(self):
            raise IndexError(k)
        if len(self) == 1:
            return self._spp
        before, after = (self._first * grown(passes, self._times) for passes in (k, k + 1))
        return min(after, self._spp) - before
