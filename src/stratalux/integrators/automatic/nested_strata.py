"""Direct light of the environment map from strata that are nested over the samples of a pixel, by itself untuned."""

from __future__ import annotations

from typing import ClassVar

import drjit as dr
import mitsuba as mi

from ...sampling.leaf_sampler import LeafSampler
from ...sampling.points import mix, shuffle, sobol_2d, unit_float, van_der_corput
from ..common import draw, only, target
from ..derivatives import SUM
from ..environment import MapLight
from ..light_samples import FreshLight, SharedLight, launch_seed
from ..straight import Obstacles, Scene, arriving
from .balance import Balance
from .lobes import Allocation
from .variate import MatteVariate
from .visibility import Visibility

_LEAVES, _LOBES = 0x3C6EF372, 0x0A54FF53
"""Distinguish the points of the map from those of the BSDF."""
WORTH_A_RAY = 0.5
"""Of the mean contribution: what brings less gets a ray at random, and less yet where its visibility is known."""


class PixelPoints:
    """Low-discrepancy points of the sample that each lane works on; stands in for a sampler where one is asked for.

    ``index``: number of the sample within its pixel. ``seed``: the same for all samples of a pixel, and independent
    between pixels. Points of other indices would cost stratification, but no bias: every lane's are uniform.
    ``samples`` of the map that lanes share, and the luminance ``expected`` at each, where a launch knows them.
    """

    def __init__(
        self,
        index: mi.UInt32,
        seed: mi.UInt32,
        samples: SharedLight | None = None,
        expected: mi.Float | None = None,
    ) -> None:
        self.index, self.seed, self.samples, self.expected = index, seed, samples, expected
        self.difference = mi.Spectrum(0)
        """After an estimate that has ``varied``: the variate's integral less its estimate, 0 on average."""
        self.varied = False
        self.detailed = mi.UInt32(0)
        """As in a :class:`~.look.Look`."""
        self.visibility = Visibility(mi.UInt32(0), None)
        self._dimension = 0

    @classmethod
    def of(cls, sampler: mi.Sampler) -> PixelPoints:
        """For Mitsuba's own order of a wavefront."""
        seed = launch_seed(sampler)
        per_pixel = dr.opaque(mi.UInt32, max(1, sampler.sample_count()))
        lane = dr.arange(mi.UInt32, sampler.wavefront_size())
        pixel = lane // per_pixel
        return cls(lane - pixel * per_pixel, mix(pixel ^ seed))

    def next_1d(self, active: mi.Bool | bool = True) -> mi.Float:
        return unit_float(van_der_corput(shuffle(self.index, self.next_seed()), mix(self.next_seed())))

    def next_2d(self, active: mi.Bool | bool = True) -> mi.Point2f:
        seed = self.next_seed()
        return sobol_2d(shuffle(self.index, seed), mix(seed))

    def next_seed(self) -> mi.UInt32:
        """A seed for the next dimension."""
        self._dimension += 1
        return mix(self.seed + mi.UInt32(0x9E3779B9 * self._dimension & 0xFFFFFFFF))


class Survivor:
    """One of the samples offered, kept with a probability in proportion to the luminance q of what it brings.

    ``d``: its direction. ``g``: what it stands for, Σ q · g / q: the paper's resampling, equation (5), in one pass.
    What it brings may be negative; q is not.
    """

    DRJIT_STRUCT: ClassVar = {"d": mi.Vector3f, "ratio": mi.Spectrum, "total": mi.Float}

    def __init__(self) -> None:
        self.d, self.ratio, self.total = mi.Vector3f(0), mi.Spectrum(0), mi.Float(0)

    def offer(self, d: mi.Vector3f, g: mi.Spectrum, random: mi.UInt32) -> mi.Bool:
        """Take ``g`` from direction ``d`` into account; whether it is the one that is kept, for now."""
        q = target(dr.abs(g))
        self.total += q
        keep = (q > 0) & (unit_float(random) * self.total < q)
        self.d = dr.select(keep, d, self.d)
        self.ratio = dr.select(keep, g / q, self.ratio)
        return keep

    @property
    def g(self) -> mi.Spectrum:
        """What the survivor stands for, but for its shadow."""
        return self.ratio * self.total


class NestedStrata:
    r"""All light samples of a pixel, of all its camera samples together, as one set of strata of the map.

    The map is cut into leaves of equal energy (:mod:`.sampling.leaves`). The light samples of camera sample s are
    numbers N M s' to N M s' + N M − 1 of a scrambled van der Corput sequence along the leaves, where s' shuffles the
    camera samples: N M consecutive points fall into N M strata of equal energy, the N M S points of S camera samples
    (powers of two) into N M S strata. With the density p of the leaves, the part f_g of the BSDF that is its glossy
    lobes, and K M samples of these, of density p_g,

        L_o ≈ 1/NM Σ_j ((f − (1 − w) f_g) L cos V)(x_j) / p(x_j) + 1/KM Σ_j (1 − w) (L f_g cos V)(y_j) / p_g(y_j)

        w(ω) = N p̃(ω) / (N p̃(ω) + K p_g(ω)),    p̃(ω) = luminance(L(ω)) / ∫ luminance(L) dω.

    The weights are the balance heuristic's but for p̃, which stands for p: it needs no search for the leaf of a
    direction. It is unbiased, as the weights of both techniques depend on the direction alone, add up to 1 for f_g, and
    p is positive everywhere. What is matte is left to the light samples: drawn from all lobes, BSDF samples take a part
    of it over and do worse. BSDFs that do not tell their lobes apart have f_g = f. N, K and M follow from the BSDF and
    the map, see :class:`~.lobes.Allocation`.

    Of each M samples of a stratum, or of the BSDF, one gets a ray and stands for all, as in the paper's scheme: a
    :class:`Survivor`. What is left of a light's texture inside of lobes costs so much less than a ray each.

    A :class:`~.variate.MatteVariate` h is estimated along with it, from the same samples and without rays, for the
    part of the BSDF that is matte, with albedo ρ: the points get ρ/π (∫ h dω − its estimate) as their ``difference``.

    Where the points tell the luminance that is expected in all, a sample that would bring less than
    :data:`WORTH_A_RAY` times its share gets a ray with a probability in proportion. So do others where a
    :class:`~.visibility.Visibility` V̂ leaves little doubt. With the probability α, what counts is g (V̂ + (V − V̂) / α)
    with the ray, and g V̂ without it: on average g V, whatever V̂ and α are.
    """

    def __init__(
        self,
        allocation: Allocation,
        points: PixelPoints,
        samples: FreshLight | SharedLight,
        variate: MatteVariate | None = None,
    ) -> None:
        self.allocation, self.points, self.samples, self.variate = allocation, points, samples, variate

    @dr.syntax
    def estimate(
        self,
        scene: Scene,
        light: MapLight[LeafSampler],
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        """Direct light of the environment map at ``si`` from smooth lobes."""
        N, K, M, matte = self.allocation.of(si.shape, bsdf, self.points.detailed, active)
        balance = Balance(self.allocation, light, si, bsdf, (N, K, M, matte), active)
        L_o = mi.Spectrum(0)
        variate = self.variate
        varied = variate is not None
        H = mi.Spectrum(0)  # Of the variate
        normal, albedo = mi.Vector3f(0), mi.Spectrum(0)
        if dr.hint(varied, mode="scalar"):
            normal = si.sh_frame.n * dr.sign(mi.Frame3f.cos_theta(si.wi))
            albedo = dr.select(balance.matte, bsdf.eval_diffuse_reflectance(si, balance.matte) / dr.pi, 0)

        # ------------ Light samples: M in each of N strata, one ray ------------
        seed = mix(self.points.seed ^ _LEAVES)
        first = shuffle(self.points.index, seed) * (N * M)
        k = mi.UInt32(0)
        while active & (k < N):
            kept = Survivor()
            j = mi.UInt32(0)
            while active & (j < M):
                point = first + j * N + k
                d, L_p, f = self._light_sample(light, balance, si, point, active)
                kept.offer(d, L_p * f, mix(seed ^ ~point))
                if dr.hint(varied, mode="scalar"):
                    H += L_p * MatteVariate.cosine(dr.dot(normal, d))
                j += 1
            L_o += self._shadowed(scene, si, kept, N, mix(seed ^ (first + k)), active)
            k += 1

        # -------- BSDF samples, where they help: M for each of K rays ----------
        if dr.hint(self.allocation.any_bsdf_samples, mode="scalar"):
            seed = mix(self.points.seed ^ _LOBES)
            first = shuffle(self.points.index, seed) * (K * M)
            k = mi.UInt32(0)
            while active & (k < K):
                kept = Survivor()
                j = mi.UInt32(0)
                while active & (j < M):
                    point = first + j * K + k
                    d, g, _ = self._lobe_sample(light, balance, si, bsdf, point, seed, active)
                    kept.offer(d, g, mix(seed ^ ~point))
                    j += 1
                L_o += self._shadowed(scene, si, kept, K, mix(seed ^ (first + k)), active)
                k += 1

        if variate is not None:
            integral = variate.integral(light.from_world(normal)) * light.scale
            self.points.difference = albedo * (integral - H)
            self.points.varied = True
        return L_o

    @dr.syntax
    def differentiable(
        self,
        scene: Scene,
        light: MapLight[LeafSampler],
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        """The same with a ray for every sample: which one survives would follow from what is differentiated."""
        N, K, _, matte = self.allocation.of(si.shape, bsdf, self.points.detailed, active)
        balance = Balance(self.allocation, light, si, bsdf, (N, K, mi.UInt32(1), matte), active)
        L_o, L_g = mi.Spectrum(0), mi.Spectrum(0)
        first = shuffle(self.points.index, mix(self.points.seed ^ _LEAVES)) * N
        k = mi.UInt32(0)
        while dr.hint(active & (k < N), max_iterations=SUM):
            d, L_p, f = self._light_sample(light, balance, si, first + k, active)
            L_o += arriving(scene, si, d, L_p * f, active)
            k += 1
        if dr.hint(self.allocation.any_bsdf_samples, mode="scalar"):
            seed = mix(self.points.seed ^ _LOBES)
            first = shuffle(self.points.index, seed) * K
            k = mi.UInt32(0)
            while dr.hint(active & (k < K), max_iterations=SUM):
                d, g, found = self._lobe_sample(light, balance, si, bsdf, first + k, seed, active)
                L_g += arriving(scene, si, d, g, found)
                k += 1
        return L_o + L_g

    def _light_sample(
        self,
        light: MapLight[LeafSampler],
        balance: Balance,
        si: mi.SurfaceInteraction3f,
        point: mi.UInt32,
        active: mi.Bool,
    ) -> tuple[mi.Vector3f, mi.Spectrum, mi.Spectrum]:
        """A direction of the world, L / (N M p) from there, and its part of f cos."""
        where = van_der_corput(point, self.points.seed)  # in units of 2⁻³² along the leaves
        d, luminance, L_p, _ = self.samples.draw(where >> (32 - light.tables.depth), where, si, active)
        f = balance.light_part(si.to_local(d), luminance)
        return d, L_p / balance.n, f

    @staticmethod
    def _lobe_sample(
        light: MapLight[LeafSampler],
        balance: Balance,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        point: mi.UInt32,
        seed: mi.UInt32,
        active: mi.Bool,
    ) -> tuple[mi.Vector3f, mi.Spectrum, mi.Bool]:
        """A direction of the world, what it brings if nothing is in the way, and whether there is one."""
        u_lobe = unit_float(van_der_corput(shuffle(point, seed), mix(seed)))
        ctx = only(mi.BSDFFlags.Glossy)
        bs, weight, found = draw(bsdf, ctx, si, u_lobe, sobol_2d(point, seed), active, light.differentiated)
        d = si.to_world(bs.wo)
        L = light.radiance_towards(d, si, found)
        L = dr.select(found, balance.lobe_part(L, bs.pdf), 0)
        return d, dr.select(found, L * weight * bs.pdf, 0), found

    def _shadowed(
        self,
        scene: Scene,
        si: mi.SurfaceInteraction3f,
        kept: Survivor,
        count: mi.UInt32,
        random: mi.UInt32,
        active: mi.Bool,
    ) -> mi.Spectrum:
        """What ``kept``, one of ``count``, brings to ``si`` by a ray; where that is little, it gets one at random."""
        g, points = kept.g, self.points
        lit = active & dr.any(g != 0)
        V_hat, doubt = points.visibility.expected(kept.d, lit)
        chance, traced = mi.Float(1), lit
        if points.expected is not None:
            share = dr.abs(target(g)) * mi.Float(count) / points.expected
            chance = dr.minimum(doubt * share / WORTH_A_RAY, 1)
            if isinstance(scene, Obstacles) and scene.caught is not None:
                chance = dr.select(scene.caught, 1, chance)  # where nothing is in the way, nothing is left to chance
            traced = lit & (unit_float(random) < chance)
        ray = si.spawn_ray(kept.d)
        if isinstance(scene, Obstacles):
            V = scene.visible(ray, traced)
            hit = unit_float(mix(random)) >= target(V)  # what is learned of rays is whether they get through
        else:
            hit = scene.ray_test(ray, traced)
            V = dr.select(hit, 0, 1)
        points.visibility.note(kept.d, hit, traced)
        found = dr.select(traced, (V - V_hat) / chance, 0)
        V = V_hat + found
        return dr.select(lit, g * (scene.counted(V) if isinstance(scene, Obstacles) else V), 0)
