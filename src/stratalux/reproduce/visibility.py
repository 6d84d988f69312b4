"""What a visibility test costs against the generation of a light sample (the paper's 7.36 : 1), measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from .pinned import Pinned
from .view import View

Progress = Callable[[float], None]


class _NothingInTheWay:
    """A scene whose visibility tests are free."""

    def ray_test(self, ray: mi.Ray3f, active: mi.Bool) -> mi.Bool:
        return mi.Bool(False)


class _PlainSurface:
    """A BSDF that costs next to nothing: f cos = 1 above the surface."""

    def eval(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool) -> mi.Spectrum:
        return mi.Spectrum(dr.select(active & (wo.z > 0), mi.Float(1), 0))


@dataclass(frozen=True)
class Costs:
    """Nanoseconds of wall time, medians: of drawing a light sample and looking up its radiance; of the surface's
    f cos; and of a visibility test. ``tests``: share of the samples that need one, being above the surface."""

    sample: float
    surface: float
    test: float
    tests: float

    @property
    def ratio(self) -> float:
        """A visibility test to the generation of a sample."""
        return self.test / self.sample

    @property
    def ratio_with_surface(self) -> float:
        """A visibility test to the generation of a sample and the evaluation of the surface there."""
        return self.test / (self.sample + self.surface)


def visibility_costs(
    view: View, technique: Pinned, tests: float, rounds: int, progress: Progress | None = None
) -> Costs:
    """Time the light loop of ``technique`` as it is, without visibility tests, and without the surface too, in turn.

    ``tests``: share of the samples that lie above the surface, where alone a test is made. The costs are the
    differences between the kernels, of each the median over ``rounds``.
    """
    integrator = technique.load()
    light = integrator.prepare(view.scene)
    si = view.intersections()
    bsdf = si.bsdf()
    dr.eval(bsdf)
    active = si.is_valid()
    dr.eval(active)
    lanes = dr.width(si)
    nothing, plain = _NothingInTheWay(), _PlainSurface()
    sides: tuple[tuple[Any, Any], ...] = ((nothing, plain), (nothing, bsdf), (view.scene, bsdf))
    times: list[list[float]] = [[] for _ in sides]
    for k in range(rounds + 1):
        for (scene, surface), mine in zip(sides, times, strict=True):
            sampler = mi.load_dict({"type": "independent"})
            sampler.seed(k, lanes)
            sampler.schedule_state()
            dr.eval()
            dr.sync_thread()
            with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
                dr.kernel_history_clear()
                dr.eval(integrator.environment_light(scene, light, sampler, si, surface, active))
                dr.sync_thread()
                history = dr.kernel_history()
            if k:  # the first round warms up
                mine.append(sum(kernel.get("execution_time", 0) for kernel in history) / 1000)
        if progress is not None:
            progress((k + 1) / (rounds + 1))
    hits = int(np.count_nonzero(np.array(active)))
    return costs_of(times, max(1, hits * technique.rays), tests)


def costs_of(times: Sequence[Sequence[float]], samples: int, tests: float) -> Costs:
    """From the seconds of every round of three kernels: without tests and surface, without tests, and with both."""
    sample, shaded, tested = (1e9 * median(mine) / samples for mine in times)
    return Costs(sample, shaded - sample, (tested - shaded) / max(tests, 1e-9), tests)
