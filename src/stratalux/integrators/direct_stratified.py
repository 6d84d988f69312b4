"""``direct_stratified``: direct light from an environment map with the paper's stratified sampling scheme."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..maps.envmap import EnvironmentMap
from ..maps.median_cut import median_cut
from ..sampling.leaf_sampler import RegionLeafSampler
from .automatic.image import Automatic
from .automatic.lobes import MOST_RAYS
from .common import LEAST, DirectIntegrator, MisWithBsdf, target
from .derivatives import SUM
from .environment import MapCache, MapLight
from .light_samples import FreshLight, SharedLight, launch_seed
from .straight import Scene, arriving
from .techniques import Property, Technique, Value, properties_from

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

    The density p_i is that of leaves of equal energy that the region is cut into (:mod:`.sampling.leaves`): a proposal
    is a leaf and a point in it. One random number chooses the leaves of all M proposals, each from another M-th of the
    region, which changes nothing in the sum above, and another one the survivor. The point in a leaf is drawn once for
    all pixels of a launch, with a seed of the launch, so that a proposal is one look-up; spectral variants, where the
    radiance depends on the wavelengths, draw it anew.

    The paper holds that samples of regions cannot be combined with BSDF samples, being of another domain. They can: any
    direction ω lies in exactly one region, from which one sample is drawn with pdf p_i(ω), so the regions together are
    a technique that places p_i(ω) samples per steradian at ω. With K BSDF samples of pdf p_b, a sample of the map has
    the weight w, which enters q, and a BSDF sample the weight 1 − w,

        w(ω) = p̃(ω) / (p̃(ω) + K p_b(ω)),    p̃(ω) = luminance(L(ω)) / E_i,

    the balance heuristic but for p̃, which stands for p_i and needs no search for the leaf of a direction; E_i is the
    energy of the region of ω. Both weights depend on ω alone and add up to 1, so the sum is unbiased, for M > 1 too,
    where p_i is the density of the proposals rather than that of the survivor.

    Other emitters, delta lobes and environments that are no image are sampled as Mitsuba's ``direct`` does.
    """

    automatic = False

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        settings = properties_from(STRATIFIED, props)
        self.strata = int(settings["strata"])
        self.proposals = int(settings["proposals"])
        self.bsdf_samples = int(settings["bsdf_samples"])
        self._cache: MapCache[RegionLeafSampler] = MapCache(self._regions)

    def _regions(self, environment: EnvironmentMap) -> RegionLeafSampler:
        return RegionLeafSampler(environment, median_cut(environment, self.strata))

    def prepare(self, scene: mi.Scene) -> MapLight[RegionLeafSampler] | None:
        """Build (or fetch) the tables for ``scene``; rendering calls this by itself."""
        return self._cache.get(scene)

    @dr.syntax
    def environment_light(
        self,
        scene: Scene,
        light: MapLight[RegionLeafSampler],
        sampler: mi.Sampler,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        mis = MisWithBsdf(self.bsdf_samples, light.differentiated)
        proposals = Proposals(light, mis, sampler, si, bsdf)
        # With derivatives, each proposal gets a ray: which one is kept would follow from what is differentiated.
        single = self.proposals == 1 or light.differentiated
        N = dr.opaque(mi.UInt32, len(light.tables.regions))
        M = dr.opaque(mi.UInt32, 1 if single else self.proposals)

        L_o = mi.Spectrum(0)  # Outgoing radiance
        i = mi.UInt32(0)  # Index of the region
        while dr.hint(active & (i < N), max_iterations=SUM):
            if dr.hint(single, mode="scalar"):
                # The only proposal is kept: f / q · q / p is f / p.
                y, L_ns = proposals.draw(i, sampler.next_1d(active), active)
                lit = active & ((target(L_ns) > 0) | light.differentiated)
            else:
                u = sampler.next_2d(active)
                ξ = u.y  # Which proposal is kept, of those so far
                w_sum = mi.Float(0)  # Σ_j w_ij of them
                w_y = mi.Float(1)  # Weight of the one that is kept
                y = mi.Vector3f(0)  # Its direction
                g_p = mi.Spectrum(0)  # Its (L f cos) / p
                j = mi.UInt32(0)  # Index of the proposal
                while active & (j < M):
                    # ------- (3): keep it with probability w_ij / Σ_j w_ij --------
                    d, g = proposals.draw(i, (u.x + mi.Float(j)) / mi.Float(M), active)
                    w = dr.maximum(target(g), 0)
                    w_sum += w
                    ξ *= w_sum
                    keep = ξ < w
                    y, g_p, w_y = dr.select(keep, d, y), dr.select(keep, g, g_p), dr.select(keep, w, w_y)
                    # What is left of the random number is uniform again.
                    share = dr.select(keep, w, w_sum - w)
                    ξ = dr.select(share > 0, dr.select(keep, ξ, ξ - w) / share, u.y)
                    j += 1
                lit = active & (w_sum > 0)
                L_ns = g_p * (w_sum / (w_y * mi.Float(M)))

            # ----- (5), (6): one shadow ray towards the proposal that is kept -----
            L_o += arriving(scene, si, y, L_ns, lit)
            i += 1

        if dr.hint(self.bsdf_samples > 0, mode="scalar"):
            L_o += mis.bsdf_samples(scene, light, proposals.density_towards, sampler, si, bsdf, active)
        return L_o

    def to_string(self) -> str:
        return (
            f"DirectStratified[strata = {self.strata}, proposals = {self.proposals}, "
            f"bsdf_samples = {self.bsdf_samples}]"
        )


class Proposals:
    """Proposals from the regions for the lanes' shading points.

    It draws no random numbers inside of a loop, as the loop would not know that the sampler's state is its own.
    """

    def __init__(
        self,
        light: MapLight[RegionLeafSampler],
        mis: MisWithBsdf,
        sampler: mi.Sampler,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
    ) -> None:
        self._light, self._mis, self._si, self._bsdf = light, mis, si, bsdf
        seed = launch_seed(sampler)
        self._samples = FreshLight(light, seed) if mi.is_spectral else SharedLight(SharedLight.drawn(light, seed))
        self._leaves = dr.opaque(mi.UInt32, 1 << light.tables.depth)

    def draw(self, i: mi.UInt32, u: mi.Float, active: mi.Bool) -> tuple[mi.Vector3f, mi.Spectrum]:
        """Direction of a proposal x from the density p_i of Ω_i (2), and L f cos / p_i there, weighted for MIS.

        ``u`` chooses the leaf, and its bits the point inside where that is drawn anew.
        """
        leaf = i * self._leaves + dr.minimum(mi.UInt32(u * mi.Float(self._leaves)), self._leaves - 1)
        d, luminance, L_p, _ = self._samples.draw(leaf, dr.reinterpret_array(mi.UInt32, u), self._si, active)
        density = self._density(i, luminance, active)
        return d, L_p * self._mis.eval(self._si, self._bsdf, self._si.to_local(d), density, active)

    def density_towards(self, d: mi.Vector3f, L: mi.Spectrum, active: mi.Bool) -> mi.Float:
        """p̃ at the unit direction ``d`` of the map's frame, from which ``L`` comes."""
        return self._density(self._light.tables.region(d, active), target(L), active)

    def _density(self, i: mi.UInt32, luminance: mi.Float, active: mi.Bool) -> mi.Float:
        """p̃ where the luminance is so, in Ω_i."""
        energy = dr.gather(mi.Float, self._light.tables.region_energy, i, active) * self._light.scale
        return dr.maximum(luminance, 0) / dr.maximum(energy, LEAST)


def direct_stratified(props: mi.Properties) -> DirectIntegrator:
    """The plugin: the paper's scheme if any of its properties is given, else :class:`~.automatic.Automatic`."""
    automatic = int(properties_from(STRATIFIED, props)["strata"]) == 0
    return Automatic(props) if automatic else DirectStratified(props)


PLUGINS = {"direct_stratified": direct_stratified}
