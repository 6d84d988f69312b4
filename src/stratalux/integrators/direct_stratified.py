"""``direct_stratified``: direct light from an environment map with the paper's stratified sampling scheme."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..environment import MapCache, MapLight
from ..envmap import EnvironmentMap
from ..median_cut import median_cut
from ..sampling import RegionSampler
from ..techniques import Property, Technique, Value, properties_from
from .automatic import Automatic
from .common import DirectIntegrator, MisWithBsdf, target
from .lobes import MOST_RAYS

_PINNED: dict[str, Value] = {"strata": 64, "proposals": 1, "bsdf_samples": 0}
"""What the properties are, unless given, once any of them is."""

STRATIFIED = Technique(
    name="stratified",
    plugin="direct_stratified",
    summary="strata nested over the samples of a pixel; with any property, the paper's scheme",
    source="Mei, Jaeger and Hu 2006, equations (5) and (6), and what follows from them",
    unbiased=True,
    properties={
        "strata": Property(0, "regions of the map, N; 0: automatic", minimum=0),
        "proposals": Property(0, "proposals in each region, M; 0: automatic", minimum=0),
        "bsdf_samples": Property(-1, "BSDF samples combined with those of the map by MIS; -1: automatic", minimum=-1),
    },
    pinned=_PINNED,
    automatic_rays=MOST_RAYS,
    rays=("strata", "bsdf_samples"),
)
TECHNIQUES = (STRATIFIED,)


class DirectStratified(DirectIntegrator):
    r"""Stratified direct lighting, pinned to the paper's scheme (Mei, Jaeger, Hu, section 3.2).

    ================= ======= ===================================================================================
    ``strata``        int     Number of regions N that the environment map is cut into (default: 0, automatic)
    ``proposals``     int     Proposals M drawn in each region, of which one is kept (default: 0, automatic)
    ``bsdf_samples``  int     BSDF samples K that are combined with them under MIS (default: -1, automatic)
    ``hide_emitters`` bool    Hide directly visible emitters (default: false)
    ================= ======= ===================================================================================

    With no property given, nothing needs tuning but the samples per pixel: see :class:`~.nested_strata.NestedStrata`.
    Any of the three properties pins the paper's scheme, in which the others are N = 64, M = 1 and K = 0.

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

    The paper holds that samples of regions cannot be combined with BSDF samples, being of another domain. They can: any
    direction ω lies in exactly one region, from which one sample is drawn with pdf p_i(ω), so the regions together are
    a technique that places p_i(ω) samples per steradian at ω. With K BSDF samples of pdf p_b, the balance heuristic
    weighs a sample of the map by w = p_i / (p_i + K p_b), which enters q, and a BSDF sample by K p_b / (p_i + K p_b).
    Both weights depend on ω alone and add up to 1, so the sum is unbiased for M > 1 too, where p_i is the density of
    the proposals rather than that of the survivor.

    Other emitters, delta lobes and environments that are no image are sampled as Mitsuba's ``direct`` does.
    """

    automatic = False

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        settings = properties_from(STRATIFIED, props)
        self.strata = int(settings["strata"])
        self.proposals = int(settings["proposals"])
        self.bsdf_samples = int(settings["bsdf_samples"])
        self._cache: MapCache[RegionSampler] = MapCache(self._regions)

    def _regions(self, environment: EnvironmentMap) -> RegionSampler:
        return RegionSampler(environment, median_cut(environment, self.strata))

    def prepare(self, scene: mi.Scene) -> MapLight[RegionSampler] | None:
        """Build (or fetch) the tables for ``scene``; rendering calls this by itself."""
        return self._cache.get(scene)

    def _proposal(
        self,
        light: MapLight[RegionSampler],
        mis: MisWithBsdf,
        i: mi.UInt32,
        sampler: mi.Sampler,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> tuple[mi.Vector3f, mi.Spectrum, mi.Float, mi.Float]:
        """A proposal x from the density of Ω_i (2): direction, g = L f cos, q (0 where nothing can arrive), and p_i."""
        x = light.tables.sample(i, sampler.next_2d(active), sampler.next_2d(active), active)
        d = light.to_world @ x.d
        valid = active & (x.pdf > 0)
        g = light.radiance(si, x.uv, valid) * mis.eval(si, bsdf, si.to_local(d), x.pdf, valid)
        return d, g, dr.select(valid, target(g), 0), x.pdf

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
        mis = MisWithBsdf(self.bsdf_samples)
        N = dr.opaque(mi.UInt32, light.tables.count)
        M = dr.opaque(mi.UInt32, self.proposals)

        L_o = mi.Spectrum(0)  # Outgoing radiance
        i = mi.UInt32(0)  # Index of the region
        while i < N:
            if dr.hint(self.proposals == 1, mode="scalar"):
                # The only proposal is kept: f / q · q / p is f / p.
                y, g, q, pdf = self._proposal(light, mis, i, sampler, si, bsdf, active)
                lit = q > 0
                L_ns = g / pdf
            else:
                w_sum = mi.Float(0)  # Σ_j w_ij of the proposals so far
                y = mi.Vector3f(0)  # Direction of the proposal that is kept
                g_q = mi.Spectrum(0)  # Its (L f cos) / q
                j = mi.UInt32(0)  # Index of the proposal
                while j < M:
                    # ------- (3): keep it with probability w_ij / Σ_j w_ij --------
                    d, g, q, pdf = self._proposal(light, mis, i, sampler, si, bsdf, active)
                    w = dr.select(q > 0, q / pdf, 0)
                    w_sum += w
                    keep = (w > 0) & (sampler.next_1d(active) * w_sum < w)
                    y = dr.select(keep, d, y)
                    g_q = dr.select(keep, g / q, g_q)
                    j += 1
                lit = w_sum > 0
                L_ns = g_q * (w_sum / mi.Float(M))

            # ----- (5), (6): one shadow ray towards the proposal that is kept -----
            visible = lit & ~scene.ray_test(si.spawn_ray(y), lit)
            L_o += dr.select(visible, L_ns, 0)
            i += 1

        if dr.hint(self.bsdf_samples > 0, mode="scalar"):
            L_o += mis.bsdf_samples(
                scene, light, lambda d, active: light.tables.pdf(d, active)[0], sampler, si, bsdf, active
            )
        return L_o

    def to_string(self) -> str:
        return (
            f"DirectStratified[strata = {self.strata}, proposals = {self.proposals}, "
            f"bsdf_samples = {self.bsdf_samples}]"
        )


def direct_stratified(props: mi.Properties) -> DirectIntegrator:
    """The plugin: the paper's scheme if any of its properties is given, else :class:`~.automatic.Automatic`."""
    automatic = int(properties_from(STRATIFIED, props)["strata"]) == 0
    return Automatic(props) if automatic else DirectStratified(props)


PLUGINS = {"direct_stratified": direct_stratified}
