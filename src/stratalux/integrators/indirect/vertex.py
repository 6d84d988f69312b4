"""Light that arrives at the later vertices of a path: samples of the map, and what samples of the BSDF find."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ...sampling.leaf_sampler import LeafSampler
from ...sampling.points import mix, shuffle, van_der_corput
from ..automatic.nested_strata import PixelPoints, Survivor
from ..common import LEAST, target
from ..environment import MapLight, looked_up
from ..light_samples import FreshLight, SharedLight
from ..other_emitters import OtherEmitters
from ..straight import Scene, arriving

PROPOSALS = 4
"""Samples of the map for each ray towards it: half of them lie below the horizon."""


class VertexLight:
    r"""One ray towards the map and one to another emitter at each vertex, combined with the sample of the BSDF.

    Of M samples x_j of the map, with the density p of its leaves, one gets a ray and stands for all, as in
    :class:`~.nested_strata.NestedStrata`. With the density p_b of the sample ω of the BSDF,

        L_o ≈ 1/M Σ_j w(x_j) (L f cos V)(x_j) / p(x_j) + (1 − w(ω)) (L f cos V)(ω) / p_b(ω)

        w(ω) = M p̃(ω) / (M p̃(ω) + p_b(ω)),    p̃(ω) = luminance(L(ω)) / ∫ luminance(L) dω,

    where p̃ stands for p, as it does there. Other emitters, and environments that are no image, are sampled as
    Mitsuba's ``path`` does. ``light``: the map, None without one; ``samples`` of it.
    """

    def __init__(
        self,
        scene: mi.Scene,
        obstacles: Scene,
        others: OtherEmitters,
        light: MapLight[LeafSampler] | None,
        samples: FreshLight | SharedLight | None,
    ) -> None:
        self._scene, self._obstacles, self._others = scene, obstacles, others
        self._light, self._samples = light, samples

    def sampled(
        self, points: PixelPoints, si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr, active: mi.Bool
    ) -> mi.Spectrum:
        """What samples of the lights bring to ``si``."""
        active = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        L_o = mi.Spectrum(0)
        if self._light is not None:
            L_o += self._of_map(points, si, bsdf, active)
        if self._others.lights:
            L_o += self._others.emitter_sampling(self._scene, points, si, bsdf, active)
        return L_o

    @dr.syntax
    def _of_map(
        self, points: PixelPoints, si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr, active: mi.Bool
    ) -> mi.Spectrum:
        light, samples, ctx = self._light, self._samples, mi.BSDFContext()
        assert light is not None and samples is not None
        M = dr.opaque(mi.UInt32, PROPOSALS)
        seed = points.next_seed()
        first = shuffle(points.index, seed) * M
        kept = Survivor()
        j = mi.UInt32(0)
        while active & (j < M):
            point = first + j
            where = van_der_corput(point, mix(seed))  # in units of 2⁻³² along the leaves
            d, luminance, L_p = samples.draw(where >> (32 - light.tables.depth), where, si, active)
            f, pdf = bsdf.eval_pdf(ctx, si, si.to_local(d), active)
            p = self._density(luminance)
            kept.offer(d, L_p * f * (dr.select(p > 0, p / (p + pdf), 0) / PROPOSALS), mix(seed ^ ~point))
            j += 1
        return arriving(self._obstacles, si, kept.d, kept.g, active & dr.any(kept.g != 0))

    def found(
        self, before: mi.Interaction3f, hit: mi.SurfaceInteraction3f, pdf: mi.Float, delta: mi.Bool, active: mi.Bool
    ) -> mi.Spectrum:
        """Weighted radiance of what a sample of the BSDF at ``before`` has ``hit``; of that ``pdf``, or ``delta``."""
        value, weight, lit = self._others.found(self._scene, before, hit, pdf, delta, active)
        L = dr.select(lit, value * weight, 0)
        light = self._light
        if light is not None:
            bare = active & ~hit.is_valid() & ~delta
            value = looked_up(lambda lanes: light.emitter.eval(hit, lanes), bare)
            L += dr.select(bare, value * (pdf / dr.maximum(pdf + self._density(target(value)), LEAST)), 0)
        return L

    def _density(self, luminance: mi.Float) -> mi.Float:
        """M p̃ where the map has this luminance."""
        assert self._light is not None
        energy = dr.maximum(self._light.tables.total * self._light.scale, LEAST)
        return dr.maximum(luminance, 0) * (PROPOSALS / energy)
