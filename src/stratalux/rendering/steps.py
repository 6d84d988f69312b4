"""The steps of a picture: one pass after the other, of any integrator."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..integrators.launches import Arrays, Launch, Maker, grown, here, number_for
from ..integrators.memory import samples_at_once
from ..integrators.sums import UNLIMITED, Memory, Sums
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

Step = tuple[NDArray[np.floating[Any]], float, NDArray[np.float32] | None]
"""The raw image so far, its samples per pixel, and its noise (:meth:`~..integrators.sums.Sums.noise`)."""


class Steps:
    """Those of a picture. ``work``: light samples for one per pixel. ``max_memory``: bytes that the process may take,
    see :func:`~..integrators.memory.samples_at_once`."""

    def __init__(
        self,
        integrator: mi.Integrator,
        scene: mi.Scene,
        camera: mi.Sensor,
        seed: int,
        spp: int,
        work: int,
        max_memory: int | None = None,
    ) -> None:
        self._integrator, self._scene, self._camera, self._seed, self._spp = integrator, scene, camera, seed, spp
        self._max_memory = max_memory
        self._automatic = getattr(integrator, "automatic", False) and integrator.adapts_to(scene, camera)
        width, height = (int(side) for side in camera.film().crop_size())
        self._size = width, height
        self._sizes = PassSizes(spp, max(work, _SAMPLES_PER_PASS // _LANES * width * height))

    def all(self, memory: Memory, make: Maker = here) -> Iterator[Step]:
        """Pass by pass. ``memory``: of what is done, and of nothing at first. ``make``: who makes them."""
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

    @property
    def work(self) -> dict[str, tuple[float, float]]:
        """How many samples of each kind are done, and how many there will be, where these take unlike times."""
        return dict(self._integrator.work) if self._automatic else {}

    def launch(self, stage: str, known: Memory) -> Launch:
        """That of a stage, for who makes launches elsewhere: see :class:`~..integrators.launches.Maker`."""
        if stage == _PASSES:
            return self._pass
        made: Launch = self._integrator.launch(self._scene, self._camera, self._seed, self._spp, stage, known)
        return made

    def _pass(self, k: int) -> Arrays:
        camera, seed = self._camera, self._seed if k == 0 else (self._seed * _SPREAD + k) & LARGEST_SEED
        self._integrator.render(self._scene, camera, seed=seed, spp=self._sizes[k], develop=False, evaluate=True)
        # Some samplers round up.
        samples = np.array(camera.sampler().sample_count(), dtype=np.int64)
        return {"raw": np.array(camera.film().develop(raw=True)).astype(np.float64), "samples": samples}


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
