"""What tracing rays costs at least: cosine-distributed shadow rays from every camera hit, and nothing else.

What ``direct_stratified`` takes beyond that with as many rays is the price of choosing and weighting them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from ..assets import Assets
from ..comparison.records import Spread
from ..comparison.reference import SEED_STEP
from ..rendering.passes import render
from .cases import Case, Suite
from .records import spread_json
from .scenes import load_setting

RAYS = 64
PINNED = {"type": "direct_stratified", "strata": RAYS, "proposals": 4}
"""The paper's scheme with a usual number of regions and proposals."""
CASE = Case("grace", "diffuse", "buddha")
_SAMPLER = "independent"
_REPEATS = 7


def bare_rays(count: int) -> mi.Integrator:
    """An integrator that sends ``count`` cosine-distributed shadow rays from what the camera sees: ambient occlusion.

    The class derives from the active variant's own, so it is made anew.
    """

    class BareRays(mi.SamplingIntegrator):
        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            self.count = count

        @dr.syntax
        def sample(
            self,
            scene: mi.Scene,
            sampler: mi.Sampler,
            ray: mi.RayDifferential3f,
            medium: mi.Medium | None = None,
            active: mi.Bool | bool = True,
        ) -> tuple[mi.Spectrum, mi.Bool, list[mi.Float]]:
            active = mi.Bool(active)
            si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=True, active=active)
            valid = active & si.is_valid()
            N = dr.opaque(mi.UInt32, self.count)
            unblocked = mi.Float(0)
            i = mi.UInt32(0)
            while i < N:
                d = si.to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d(valid)))
                unblocked += dr.select(valid & ~scene.ray_test(si.spawn_ray(d), valid), 1, 0)
                i += 1
            return mi.Spectrum(unblocked / mi.Float(N)), valid, []

        def to_string(self) -> str:
            return f"BareRays[count = {self.count}]"

    return BareRays(mi.Properties())


def measure_floor(suite: Suite, assets: Assets, fraction: Callable[[float], None] = lambda _: None) -> dict[str, Any]:
    """Seconds of both integrators, in turn after a warm-up, and the median of their ratio; see the results' format."""
    setting = load_setting(CASE, suite, assets)
    integrators = {"rays": bare_rays(RAYS), "stratified": mi.load_dict(PINNED)}
    seconds: dict[str, list[float]] = {name: [] for name in integrators}
    for k in range(_REPEATS + 1):
        for name, integrator in integrators.items():
            result = render(
                setting.plain,
                integrator=integrator,
                spp=suite.floor_spp,
                seed=k * SEED_STEP,
                camera=setting.cameras[_SAMPLER],
            )
            if k:
                seconds[name].append(result.seconds)
        fraction((k + 1) / (_REPEATS + 1))
    ratios = Spread(tuple(s / r for s, r in zip(seconds["stratified"], seconds["rays"], strict=True)))
    return {
        "case": CASE.name,
        "size": list(setting.size),
        "spp": suite.floor_spp,
        "sampler": _SAMPLER,
        "rays_per_sample": RAYS,
        "integrator": PINNED,
        "rays_seconds": spread_json(Spread(tuple(seconds["rays"]))),
        "stratified_seconds": spread_json(Spread(tuple(seconds["stratified"]))),
        "ratio": spread_json(ratios),
    }
