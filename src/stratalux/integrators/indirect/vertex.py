"""Light that arrives at the later vertices of a path: samples of the map, and what samples of the BSDF find."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from ...sampling.points import mix, shuffle, van_der_corput
from ..automatic.nested_strata import PixelPoints, Survivor
from ..automatic.sample import AllocatedLight
from ..both_ways import BothWays
from ..common import LEAST, target
from ..environment import looked_up
from ..light_samples import FreshLight, SharedLight
from ..other_emitters import OtherEmitters
from ..straight import Scene, arriving

PROPOSALS, MORE = 4, 16
"""Samples of the map for each ray towards it, half of which lie below the horizon: usually, and on what has gloss alone
where the map has so much detail inside of its lobes that direct light takes :data:`DETAIL` for each ray, or more."""
DETAIL = 4


class VertexLight:
    r"""One ray towards the map and one to another emitter at each vertex, combined with the sample of the BSDF.

    (Or N rays to the map, by as many strata: then M below is N M.) Of M samples x_j of the map, with the density p of
    its leaves, one gets a ray and stands for all, as in :class:`~.nested_strata.NestedStrata`. With the density p_b of
    the sample ω of the BSDF,

        L_o ≈ 1/M Σ_j w(x_j) (L f cos V)(x_j) / p(x_j) + (1 − w(ω)) (L f cos V)(ω) / p_b(ω)

        w(ω) = M p̃(ω) / (M p̃(ω) + p_b(ω)),    p̃(ω) = luminance(L(ω)) / ∫ luminance(L) dω,

    where p̃ stands for p, as it does there, less what the tables leave to the samples of the BSDF. A part of the map
    that is alike from everywhere, a grey ``level`` c, can be theirs alone: samples of the map bring L − c then, and to
    a sample of the BSDF that meets nothing, w c is added. As much as surfaces send, and it makes little difference
    whether one is met. Other emitters, and
    environments that are no image, are sampled as Mitsuba's ``path`` does. ``light``: the map, None without one;
    ``samples`` of it.
    """

    def __init__(
        self,
        scene: mi.Scene,
        obstacles: Scene,
        others: OtherEmitters,
        light: AllocatedLight[Any] | None,
        samples: FreshLight | SharedLight | None,
        ways: BothWays | None = None,
    ) -> None:
        self._scene, self._obstacles, self._others = scene, obstacles, others
        self._light, self._samples, self.ways = light, samples, ways

    def proposals(self, shape: mi.ShapePtr, bsdf: mi.BSDFPtr, active: mi.Bool) -> mi.UInt32:
        """M at a vertex on that ``shape`` with that ``bsdf``."""
        few, many = dr.opaque(mi.UInt32, PROPOSALS), dr.opaque(mi.UInt32, MORE)
        if self._light is None:
            return few
        *_, M, matte = self._light.allocation.of(shape, bsdf, mi.UInt32(0), active)
        return mi.UInt32(dr.select(~matte & (M >= DETAIL), many, few))

    def rays(self, shape: mi.ShapePtr, bsdf: mi.BSDFPtr, first: mi.Bool, active: mi.Bool) -> mi.UInt32:
        """N, those to the map at a vertex there, which may be the ``first`` one of its path."""
        return mi.UInt32(1)

    @property
    def level(self) -> mi.Float:
        """The grey part of the map that is left to the sample of the BSDF at the first vertex, where that is wanted."""
        return mi.Float(0)

    def sampled(
        self,
        points: PixelPoints,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        M: mi.UInt32,
        active: mi.Bool,
        N: mi.UInt32 | None = None,
        level: mi.Float | None = None,
        κ: mi.Float | None = None,
    ) -> mi.Spectrum:
        """What samples of the lights bring to ``si``, M of them from the map, for each of N rays (one, unless told)."""
        active = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        L_o = mi.Spectrum(0)
        if self._light is not None:
            N, level = mi.UInt32(1) if N is None else N, mi.Float(0) if level is None else level
            L_o += self._of_map(points, si, bsdf, M, N, level, κ, active)
        if self._others.lights:
            L_o += self._others.emitter_sampling(self._scene, points, si, bsdf, active)
        return L_o

    @dr.syntax
    def _of_map(
        self,
        points: PixelPoints,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        M: mi.UInt32,
        N: mi.UInt32,
        level: mi.Float,
        κ: mi.Float | None,
        active: mi.Bool,
    ) -> mi.Spectrum:
        light, samples, ctx = self._light, self._samples, mi.BSDFContext()
        assert light is not None and samples is not None
        share = dr.rcp(mi.Float(N * M))
        seed = points.next_seed()
        first = shuffle(points.index, seed) * (N * M)
        L_o = mi.Spectrum(0)
        k = mi.UInt32(0)
        while active & (k < N):
            kept = Survivor()
            p_kept, pdf_kept = mi.Float(0), mi.Float(0)
            j = mi.UInt32(0)
            while active & (j < M):
                point = first + j * N + k
                where = van_der_corput(point, mix(seed))  # in units of 2⁻³² along the leaves
                d, luminance, L_p, inverse = samples.draw(where >> (32 - light.tables.depth), where, si, active)
                f, pdf = bsdf.eval_pdf(ctx, si, si.to_local(d), active)
                p = self.density(luminance, N * M)
                g = (L_p - level * inverse) * f * (dr.select(pdf > 0, p / (p + pdf), 1) * share)
                taken = kept.offer(d, g, mix(seed ^ ~point))
                p_kept, pdf_kept = dr.select(taken, p, p_kept), dr.select(taken, pdf, pdf_kept)
                j += 1
            g = kept.g
            lit = active & dr.any(g != 0)
            if dr.hint(κ is not None, mode="scalar"):
                g *= self._not_from_the_map(si, bsdf, kept.d, p_kept, pdf_kept, N * M, κ, lit)
            L_o += arriving(self._obstacles, si, kept.d, g, lit)
            k += 1
        return L_o

    def _not_from_the_map(
        self,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        d: mi.Vector3f,
        p: mi.Float,
        pdf: mi.Float,
        M: mi.UInt32,
        κ: mi.Float,
        active: mi.Bool,
    ) -> mi.Float:
        """What is left of a weight at ``si`` for light from ``d`` where light paths find a part of it."""
        assert self.ways is not None
        active = active & (κ > 0) & (pdf > 0) & self.ways.targeted(si.shape, active)
        q = κ * self.ways.at(si, bsdf, si.to_local(d), pdf, active) * pdf * p / (mi.Float(M) * self.ways.area(d))
        return dr.select(active, (p + pdf) / (p + pdf + q), 1)

    def found(
        self,
        before: mi.Interaction3f,
        hit: mi.SurfaceInteraction3f,
        pdf: mi.Float,
        delta: mi.Bool,
        M: mi.UInt32,
        active: mi.Bool,
        level: mi.Float | None = None,
        κ: mi.Float | None = None,
    ) -> mi.Spectrum:
        """Weighted radiance of what a sample of the BSDF at ``before`` has ``hit``; of that ``pdf``, or ``delta``.

        M: samples of the map that there were.
        """
        value, weight, lit = self._others.found(self._scene, before, hit, pdf, delta, active)
        L = dr.select(lit, value * weight, 0)
        light = self._light
        if light is not None:
            bare = active & ~hit.is_valid() & ~delta
            value = looked_up(lambda lanes: light.emitter.eval(hit, lanes), bare)
            p = self.density(target(value), M)
            total = pdf + p
            if κ is not None:
                assert self.ways is not None
                from_map = bare & (κ > 0)
                total += dr.select(from_map, κ * pdf * p / (mi.Float(M) * self.ways.area(hit.wi)), 0)
            of_bsdf = pdf / dr.maximum(total, LEAST)
            L += dr.select(bare, value * of_bsdf, 0)
            if level is not None:
                L += dr.select(bare, level * (1 - of_bsdf), 0)
        return L

    def density(self, luminance: mi.Float, M: mi.UInt32) -> mi.Float:
        """M p̃ where the map has this luminance."""
        assert self._light is not None
        tables, scale = self._light.tables, self._light.scale
        energy = dr.maximum(tables.total * scale, LEAST)
        return dr.maximum(luminance - tables.spared * scale, 0) * (mi.Float(M) / energy)
