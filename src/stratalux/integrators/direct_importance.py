"""``direct_importance``: illumination-based and bidirectional importance sampling of the whole map."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..maps.median_cut import median_cut
from ..sampling.region_sampler import DirectionSample, RegionSampler
from .common import DirectIntegrator, MisWithBsdf, target
from .derivatives import SUM
from .environment import MapCache, MapLight
from .straight import Scene, arriving
from .techniques import Property, Technique, properties_from

IMPORTANCE = Technique(
    name="importance",
    plugin="direct_importance",
    summary="importance sampling of the whole map, with resampling if proposals > samples",
    source="Pharr and Humphreys 2004 (the paper's equation 2); Burke et al., Talbot et al. 2005 (equation 3)",
    unbiased=True,
    properties={
        "samples": Property(16, "shadow rays, N (or M1 of bidirectional importance sampling)", minimum=1),
        "proposals": Property(1, "proposals M0 in all; resampling begins above the number of samples", minimum=1),
        "bsdf_samples": Property(0, "BSDF samples combined with those of the map by MIS", minimum=0),
        "sequence": Property("sobol", "random numbers of the map samples", choices=("independent", "sobol")),
    },
    rays=("samples", "bsdf_samples"),
)
TECHNIQUES = (IMPORTANCE,)


class DirectImportance(DirectIntegrator):
    r"""Direct lighting with samples of the whole environment map.

    ================= ======= ==================================================================================
    ``samples``       int     Shadow rays N (default: 16)
    ``proposals``     int     Proposals M0; more than ``samples`` turns on resampling (default: 1)
    ``bsdf_samples``  int     BSDF samples K that are combined with them under MIS (default: 0)
    ``sequence``      string  ``sobol`` or ``independent`` (default: ``sobol``)
    ``hide_emitters`` bool    Hide directly visible emitters (default: false)
    ================= ======= ==================================================================================

    Illumination-based importance sampling draws N directions from the density of the map, with the factor sin θ that
    the paper's p(i, j) leaves out (it would send too many samples to the poles),

        L_o ≈ (1/N) Σ_j (L f cos)(x_j) V(x_j) / p(x_j)                                           (2)

    Bidirectional importance sampling draws M0 proposals x_i from that density, weighs them by w_i = q(x_i) / p(x_i)
    with q = luminance(L f cos), and keeps N ≤ M0 of them in proportion to w,

        L_o ≈ (1/N) Σ_j (L f cos)(y_j) / q(y_j) V(y_j) · (1/M0) Σ_i w_i                          (3)

    which is the paper's equation (3) in colour. The N survivors are drawn by systematic resampling: proposal i is taken
    either ⌊n_i⌋ or ⌈n_i⌉ times with n_i = N w_i / Σ w as its mean, so the estimate stays unbiased, varies less than
    with independent draws, and a proposal taken several times needs one shadow ray. Proposals are not stored: they are
    drawn a second time from the same random numbers.

    ``sobol`` uses the (0, 2)-sequence, as the paper does for this technique, each coordinate scrambled by a random
    digit permutation (exclusive or) for each shading point; ``independent`` uses pseudo-random numbers.
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        settings = properties_from(IMPORTANCE, props)
        self.samples = int(settings["samples"])
        self.proposals = int(settings["proposals"])
        self.bsdf_samples = int(settings["bsdf_samples"])
        self.sequence = str(settings["sequence"])
        self._cache = MapCache(lambda environment: RegionSampler(environment, median_cut(environment, 1)))

    def prepare(self, scene: mi.Scene) -> MapLight[RegionSampler] | None:
        """Build (or fetch) the tables for ``scene``; rendering calls this by itself."""
        return self._cache.get(scene)

    def environment_light(
        self,
        scene: Scene,
        light: MapLight[RegionSampler],
        sampler: mi.Sampler,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        mis = MisWithBsdf(self.bsdf_samples, light.differentiated)
        points = Points(sampler, self.sequence, active)
        # With derivatives, there is no resampling: what is kept would follow from what is differentiated.
        if self.proposals <= self.samples or light.differentiated:
            L_o = self._importance_sampling(scene, light, points, mis, si, bsdf, active)
        else:
            L_o = self._resampling(scene, light, points, mis, si, bsdf, active)
        if self.bsdf_samples:
            samples = dr.opaque(mi.Float, self.samples)
            L_o += mis.bsdf_samples(
                scene, light, lambda d, L, active: samples * light.tables.pdf(d, active)[0], sampler, si, bsdf, active
            )
        return L_o

    def _proposal(
        self,
        light: MapLight[RegionSampler],
        x: DirectionSample,
        mis: MisWithBsdf,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> tuple[mi.Vector3f, mi.Spectrum, mi.Float, mi.Float]:
        """Direction in the world, g = L f cos (times the weight of MIS), q (0 where nothing can arrive), and p."""
        d = light.to_world @ x.d
        valid = active & (x.pdf > 0)
        density = dr.opaque(mi.Float, self.samples) * x.pdf
        g = light.radiance(si, x.uv, d, valid) * mis.eval(si, bsdf, si.to_local(d), density, valid)
        return d, g, dr.select(valid, target(g), 0), x.pdf

    @dr.syntax
    def _importance_sampling(
        self,
        scene: Scene,
        light: MapLight[RegionSampler],
        points: Points,
        mis: MisWithBsdf,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        N = dr.opaque(mi.UInt32, self.samples)
        rng = points.start()
        L_o = mi.Spectrum(0)
        j = mi.UInt32(0)
        while dr.hint(j < N, max_iterations=SUM):
            # ----------------- (2): a direction from the density of the map -----------------
            d, g, q, pdf = self._proposal(light, points.draw(light.tables, j, rng, active), mis, si, bsdf, active)
            lit = (q > 0) | (active & (pdf > 0) & light.differentiated)
            L_o += arriving(scene, si, d, g / pdf, lit)
            j += 1
        return L_o / mi.Float(N)

    @dr.syntax
    def _resampling(
        self,
        scene: Scene,
        light: MapLight[RegionSampler],
        points: Points,
        mis: MisWithBsdf,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        N = dr.opaque(mi.UInt32, self.samples)
        M0 = dr.opaque(mi.UInt32, self.proposals)

        # ---------------- (3): weights of all proposals ----------------
        rng = points.start()
        w_sum = mi.Float(0)
        i = mi.UInt32(0)
        while i < M0:
            d, g, q, pdf = self._proposal(light, points.draw(light.tables, i, rng, active), mis, si, bsdf, active)
            w_sum += dr.select(q > 0, q / pdf, 0)
            i += 1

        # ------ The same proposals again, the chosen ones with a shadow ray ------
        rng = points.start()
        ξ = points.offset
        L_o = mi.Spectrum(0)
        w_before = mi.Float(0)  # Σ of the weights before proposal i
        taken = mi.UInt32(0)  # How many survivors have been drawn so far
        i = mi.UInt32(0)
        while i < M0:
            d, g, q, pdf = self._proposal(light, points.draw(light.tables, i, rng, active), mis, si, bsdf, active)
            w_before += dr.select(q > 0, q / pdf, 0)
            # Survivor k is the proposal on which (k + ξ) / N · Σ w falls.
            upto = mi.UInt32(dr.clip(dr.ceil(w_before / w_sum * mi.Float(N) - ξ), 0, mi.Float(N)))
            times = dr.select((q > 0) & (upto > taken), upto - taken, 0)
            taken += times
            L_o += arriving(scene, si, d, g / q * mi.Float(times), times > 0)
            i += 1
        return dr.select(w_sum > 0, L_o * (w_sum / mi.Float(M0 * N)), 0)

    def to_string(self) -> str:
        return (
            f"DirectImportance[samples = {self.samples}, proposals = {self.proposals}, "
            f"bsdf_samples = {self.bsdf_samples}, sequence = {self.sequence}]"
        )


class Points:
    """The random numbers of one shading point, which can be drawn again from the start."""

    def __init__(self, sampler: mi.Sampler, sequence: str, active: mi.Bool) -> None:
        self._sobol = sequence == "sobol"
        seed, scramble = sampler.next_2d(active), sampler.next_2d(active)
        self._seed = _bits(seed.x), _bits(seed.y)
        self._scramble = _bits(scramble.x), _bits(scramble.y)
        self.offset = sampler.next_1d(active)

    def start(self) -> mi.PCG32:
        """A generator at the beginning of this point's stream."""
        v0, v1 = mi.sample_tea_32(*self._seed)
        return mi.PCG32(initstate=v0, initseq=v1)

    def draw(self, tables: RegionSampler, i: mi.UInt32, rng: mi.PCG32, active: mi.Bool) -> DirectionSample:
        """The ``i``-th direction from the density of the whole map."""
        whole = mi.UInt32(0)
        inside = mi.Point2f(rng.next_float32(active), rng.next_float32(active))
        fine = mi.Point2f(rng.next_float32(active), rng.next_float32(active))
        if not self._sobol:
            return tables.sample(whole, fine, inside, active)
        u = mi.Point2f(mi.radical_inverse_2(i, self._scramble[0]), mi.sobol_2(i, self._scramble[1]))
        return tables.sample_2d(whole, u, fine, inside, active)


def _bits(u: mi.Float) -> mi.UInt32:
    """32 scrambled bits of a uniform float."""
    return mi.sample_tea_32(mi.UInt32(u * 2.0**23), 0)[0]


PLUGINS = {"direct_importance": DirectImportance}
