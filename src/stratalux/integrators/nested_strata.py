"""Direct light of the environment map from strata that are nested over the samples of a pixel, by itself untuned."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..environment import MapLight
from ..leaf_sampler import LeafSampler
from ..points import mix, shuffle, sobol_2d, unit_float, van_der_corput
from .common import target
from .lobes import Allocation

_LEAVES, _LOBES = 0x3C6EF372, 0x0A54FF53
"""Distinguish the points of the map from those of the BSDF."""


class PixelPoints:
    """Which sample of which pixel a lane works on, in the order in which Mitsuba lays out a wavefront.

    ``index``: number of the sample within its pixel. ``seed``: the same for all samples of a pixel. Another layout
    would cost stratification, but no bias: every lane's points are uniform by themselves.
    """

    def __init__(self, sampler: mi.Sampler, seed: int | mi.UInt32, first_sample: int) -> None:
        per_pixel = mi.UInt32(max(1, sampler.sample_count()))
        first, seed = mi.UInt32(first_sample), mi.UInt32(seed)
        dr.make_opaque(per_pixel, first, seed)  # or every value would be compiled into a kernel of its own
        lane = dr.arange(mi.UInt32, sampler.wavefront_size())
        pixel = lane // per_pixel
        self.index = lane - pixel * per_pixel + first
        self.seed = mix(pixel ^ mix(seed))


class NestedStrata:
    r"""All light samples of a pixel, of all its camera samples together, as one set of strata of the map.

    The map is cut into leaves of equal energy (:mod:`stratalux.leaves`). The light sample k of N of camera sample s is
    number N s' + k of a scrambled van der Corput sequence along the leaves, where s' shuffles the camera samples: N
    consecutive points fall into N strata of equal energy, the N S points of S camera samples (powers of two) into
    N S strata. With the density p of the leaves and K BSDF samples of density p_b,

        L_o ≈ 1/N Σ_k w (L f cos V)(x_k) / p(x_k) + 1/K Σ_k (1 − w) (L f cos V)(y_k) / p_b(y_k)

        w(ω) = N p̃(ω) / (N p̃(ω) + K p_b(ω)),    p̃(ω) = luminance(L(ω)) / ∫ luminance(L) dω.

    The weights are the balance heuristic's but for p̃, which stands for p: it needs no search for the leaf of a
    direction. It is unbiased, as the weights of both techniques depend on the direction alone, add up to 1, and p is
    positive everywhere. N and K follow the concentration of the BSDF, see :class:`~.lobes.Allocation`.
    """

    def __init__(self, allocation: Allocation, points: PixelPoints) -> None:
        self.allocation, self.points = allocation, points

    @dr.syntax
    def estimate(
        self,
        scene: mi.Scene,
        light: MapLight[LeafSampler],
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        """Direct light of the environment map at ``si`` from smooth lobes."""
        ctx = mi.BSDFContext()
        ctx.type_mask = int(mi.BSDFFlags.Smooth)
        N, K = self.allocation.of(bsdf, active)
        n, K_f = mi.Float(N), mi.Float(K)
        density = n / (light.tables.energy * mi.traverse(light.emitter)["scale"])  # N p̃ is this times the luminance
        L_o = mi.Spectrum(0)

        # ---------------- Light samples, one in each stratum ----------------
        seed = mix(self.points.seed ^ _LEAVES)
        first = shuffle(self.points.index, seed) * N
        k = mi.UInt32(0)
        while active & (k < N):
            inside = mix(seed + first + k)
            u = mi.Point2f(mi.Float(inside & 0xFFFF) * 2.0**-16, mi.Float(inside >> 16) * 2.0**-16)
            x = light.tables.sample(van_der_corput(first + k, self.points.seed), u, active)
            d = light.to_world @ x.d
            L = light.radiance(si, x.uv, active)
            if dr.hint(self.allocation.any_bsdf_samples, mode="scalar"):
                f, p_b = bsdf.eval_pdf(ctx, si, si.to_local(d), active)
                p = density * target(L)
                f *= dr.select(K_f * p_b > 0, p / (p + K_f * p_b), 1)
            else:
                f = bsdf.eval(ctx, si, si.to_local(d), active)
            g = L * f
            lit = (x.pdf > 0) & dr.any(g != 0)
            lit &= ~scene.ray_test(si.spawn_ray(d), lit)
            L_o += dr.select(lit, g / (n * x.pdf), 0)
            k += 1

        # ----------------- BSDF samples, where they help ---------------------
        if dr.hint(self.allocation.any_bsdf_samples, mode="scalar"):
            seed = mix(self.points.seed ^ _LOBES)
            first = shuffle(self.points.index, seed) * K
            k = mi.UInt32(0)
            while active & (k < K):
                u_lobe = unit_float(van_der_corput(shuffle(first + k, seed), mix(seed)))
                bs, weight = bsdf.sample(ctx, si, u_lobe, sobol_2d(first + k, seed), active)
                found = (bs.pdf > 0) & dr.any(weight != 0)
                d = si.to_world(bs.wo)
                L = light.radiance_towards(d, si, found)
                g = L * weight * (bs.pdf / (density * target(L) + K_f * bs.pdf))
                found &= dr.any(g != 0)
                found &= ~scene.ray_test(si.spawn_ray(d), found)
                L_o += dr.select(found, g, 0)
                k += 1
        return L_o
