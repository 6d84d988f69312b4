"""The steps of a picture: one pass after the other, of any integrator."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..integrators.sums import UNLIMITED, Memory, Sums
from .settings import LARGEST_SEED

_SAMPLES_PER_PASS = 1 << 25
"""Light samples in one pass: about a second on two cores. A constant, so that a seed always gives the same passes."""
FIRST = 8
"""Where there are several passes, the first is smaller by this factor: there is something to keep soon."""
_SPREAD = 0x9E3779B1
"""Passes of one seed are not those of another one (Knuth's multiplicative hash of 32 bits)."""

Step = tuple[NDArray[np.floating[Any]], float, NDArray[np.float32] | None]
"""The raw image so far, its samples per pixel, and its noise (:meth:`~..integrators.sums.Sums.noise`)."""


def steps(
    integrator: mi.Integrator, scene: mi.Scene, camera: mi.Sensor, seed: int, spp: int, work: int, memory: Memory
) -> Iterator[Step]:
    """Pass by pass. ``work``: light samples for one per pixel. ``memory``: of what is done, and of nothing at first."""
    if getattr(integrator, "automatic", False) and integrator.adapts_to(scene, camera):
        yield from integrator.passes(scene, camera, seed, spp, memory)
        return
    sums = Sums(memory)
    for k, count in enumerate(_pass_sizes(spp, work)):
        if k >= sums.launches:
            integrator.render(scene, camera, seed=_seed(seed, k), spp=count, develop=False, evaluate=True)
            sums.add(np.array(camera.film().develop(raw=True)))
            # Some samplers round up.
            memory["done"] = memory.get("done", 0) + int(camera.sampler().sample_count())
        elif k + 1 < sums.launches:
            continue
        yield sums.raw(), float(memory["done"]), sums.noise()
    # What the last wavefront has left in the sampler would be handed to every kernel that is replayed from then on.
    camera.sampler().seed(0, 1)


def _seed(seed: int, k: int) -> int:
    return seed if k == 0 else (seed * _SPREAD + k) & LARGEST_SEED


def _pass_sizes(spp: int, samples_per_spp: int) -> Iterator[int]:
    """Samples per pixel of each pass: powers of two, as the kernel is the same for all of those, and a rest.

    Where one pass does not do, the first are smaller and double.
    """
    size = max(1, _SAMPLES_PER_PASS // samples_per_spp)
    size = 1 << (size.bit_length() - 1)
    if spp <= size:
        yield spp
        return
    done, count = 0, max(1, size // FIRST)
    while done < spp or spp >= UNLIMITED:
        yield count
        done += count
        count = min(done, size, spp - done) if spp < UNLIMITED else min(done, size)
