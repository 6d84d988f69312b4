"""``direct_stratified``: direct light from an environment map with the paper's stratified sampling scheme."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..environment import MapCache, MapLight
from ..median_cut import median_cut
from ..sampling import RegionSampler
from ..techniques import Property, Technique, properties_from
from .common import DirectIntegrator, target

STRATIFIED = Technique(
    name="stratified",
    plugin="direct_stratified",
    summary="one shadow ray to each region of a median cut, chosen by resampling",
    source="Mei, Jaeger and Hu 2006, equations (5) and (6)",
    unbiased=True,
    properties={
        "strata": Property(64, "regions of the map, N", minimum=1),
        "proposals": Property(1, "proposals in each region, M", minimum=1),
    },
    rays=("strata",),
)
TECHNIQUES = (STRATIFIED,)


class DirectStratified(DirectIntegrator):
    r"""Stratified direct lighting (Mei, Jaeger, Hu, section 3.2).

    ================= ======= ========================================================================
    ``strata``        int     Number of regions N that the environment map is cut into (default: 64)
    ``proposals``     int     Proposals M drawn in each region, of which one is kept (default: 1)
    ``hide_emitters`` bool    Hide directly visible emitters (default: false)
    ================= ======= ========================================================================

    The map is cut by median cut into regions Ω_1 … Ω_N of equal energy, and the light of each is estimated with one
    shadow ray,

        L_o(p, ω_o) = Σ_i L̂_ns,i V(p, y_i)                                                      (5)

    where y_i is one of M proposals x_i1 … x_iM from the region's density p_i (2), kept with probability proportional
    to w_ij = q(x_ij) / p_i(x_ij), and L̂_ns,i estimates the unshadowed light of the region,

        L_ns,i = ∫_{Ω_i} L f cos dω                                                              (6)

    The paper's q is a number; in colour we take q = luminance(L f cos) and

        L̂_ns,i = (L f cos)(y_i) / q(y_i) · (1/M) Σ_j w_ij

    which is unbiased in every channel for every M ≥ 1: with g = L f cos, and as q > 0 wherever g is,
    E[V(y) g(y)/q(y) · mean(w)] = (1/M) Σ_j E[w_j V(x_j) g(x_j)/q(x_j)] = ∫ V g dω.
    With M = 1 it is plain importance sampling of each region.

    Other emitters, delta lobes and environments that are no image are sampled as Mitsuba's ``direct`` does.
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        settings = properties_from(STRATIFIED, props)
        self.strata = int(settings["strata"])
        self.proposals = int(settings["proposals"])
        self._cache = MapCache(lambda environment: RegionSampler(environment, median_cut(environment, self.strata)))

    def shadow_rays(self) -> int:
        """Shadow rays towards the environment per shading point."""
        return self.strata

    def prepare(self, scene: mi.Scene) -> MapLight[RegionSampler] | None:
        """Build (or fetch) the tables for ``scene``; rendering calls this by itself."""
        return self._cache.get(scene)

    @dr.syntax
    def environment_light(
        self,
        scene: mi.Scene,
        light: MapLight[RegionSampler],
        sampler: mi.Sampler,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        ctx = mi.BSDFContext()
        N = dr.opaque(mi.UInt32, light.tables.count)
        M = dr.opaque(mi.UInt32, self.proposals)

        L_o = mi.Spectrum(0)  # Outgoing radiance
        i = mi.UInt32(0)  # Index of the region
        while i < N:
            w_sum = mi.Float(0)  # Σ_j w_ij of the proposals so far
            y = mi.Vector3f(0)  # Direction of the proposal that is kept
            g_q = mi.Spectrum(0)  # Its (L f cos) / q
            j = mi.UInt32(0)  # Index of the proposal
            while j < M:
                # ------------ (2): a proposal from the density of Ω_i -------------
                x = light.tables.sample(i, sampler.next_2d(active), sampler.next_2d(active), active)
                d = light.to_world @ x.d
                valid = active & (x.pdf > 0)
                g = light.radiance(si, x.uv, valid) * bsdf.eval(ctx, si, si.to_local(d), valid)

                # ------- (3): keep it with probability w_ij / Σ_j w_ij ------------
                q = target(g)
                w = dr.select(valid & (q > 0), q / x.pdf, 0)
                w_sum += w
                keep = (w > 0) & (sampler.next_1d(active) * w_sum < w)
                y = dr.select(keep, d, y)
                g_q = dr.select(keep, g / q, g_q)
                j += 1

            # ----- (5), (6): one shadow ray towards the proposal that is kept -----
            lit = active & (w_sum > 0)
            visible = lit & ~scene.ray_test(si.spawn_ray(y), lit)
            L_o += dr.select(visible, g_q * (w_sum / mi.Float(M)), 0)
            i += 1
        return L_o

    def to_string(self) -> str:
        return f"DirectStratified[strata = {self.strata}, proposals = {self.proposals}]"


PLUGINS = {"direct_stratified": DirectStratified}
