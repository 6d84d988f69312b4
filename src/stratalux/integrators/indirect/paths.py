"""Paths that bring what direct light leaves out."""

from __future__ import annotations

from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi

from ...sampling.points import DIMENSIONS, mix, shuffle, sobol
from ..automatic.nested_strata import PixelPoints
from ..common import emits
from ..sight import Sight
from ..straight import LAYERS
from .vertex import VertexLight

_VERTICES = 0x6A09E667
"""Distinguishes the points of paths from those of direct light."""
ENOUGH = 0.95
"""Probability of going on, at most, from ``rr_depth`` on: Mitsuba's."""


class FirstPoints(PixelPoints):
    """Of the way on from the first surface: coordinates of one sequence with the place in the pixel, while there are
    such. What a small pixel sees in a narrow lobe depends on both."""

    def __init__(self, index: mi.UInt32, seed: mi.UInt32) -> None:
        super().__init__(index, seed)
        self._coordinates = iter(range(2, DIMENSIONS))

    def next_1d(self, active: mi.Bool | bool = True) -> mi.Float:
        coordinate = next(self._coordinates, None)
        return super().next_1d(active) if coordinate is None else sobol(self.index, coordinate, self.next_seed())

    def next_2d(self, active: mi.Bool | bool = True) -> mi.Point2f:
        return mi.Point2f(self.next_1d(active), self.next_1d(active))


class Way:
    """What is left of a path at its first vertex: the ``ray`` that leaves it, its weight β, the square root η of the
    scale that refraction has given that, how many surfaces were ``met``, whether the ray was drawn from a lobe without
    width: ``delta``, whether it meets another surface: is ``alive``, and κ of light paths, if there are such."""

    DRJIT_STRUCT: ClassVar = {
        "ray": mi.Ray3f,
        "β": mi.Spectrum,
        "η": mi.Float,
        "met": mi.UInt32,
        "delta": mi.Bool,
        "alive": mi.Bool,
        "κ": mi.Float,
    }

    def __init__(self) -> None:
        self.ray, self.β, self.η = dr.zeros(mi.Ray3f), mi.Spectrum(1), mi.Float(1)
        self.met, self.delta, self.alive = mi.UInt32(0), mi.Bool(False), mi.Bool(False)
        self.κ = mi.Float(0)

    def at(self, lanes: mi.UInt32) -> Way:
        """Those of the ``lanes`` alone."""
        some = Way()
        for name in self.DRJIT_STRUCT:
            value = getattr(self, name)  # of the active variant's type, which need not be that of the import
            setattr(some, name, dr.gather(type(value), value, lanes))
        return some

    def white(self) -> Way:
        """The same with the weight 1: another one, as what is recorded must not change what it is given."""
        other = Way()
        for name in self.DRJIT_STRUCT:
            setattr(other, name, getattr(self, name))
        other.β = mi.Spectrum(1)
        return other


class Paths:
    r"""What arrives along camera rays after two scatterings or more.

    From the camera's first surface x_1 on, the BSDF of each surface draws the way to the next one. With the weights
    f cos / p of those samples, the light L_o that :class:`VertexLight` tells, and at most D = ``max_depth`` segments,

        L ≈ Σ_{k=2}^{D−1} L_o(x_k) Π_{i<k} (f cos / p)(x_i).

    Light that was scattered once is left to others, at x_1 and along each way that leads from it to a lamp. So most
    paths end right there, where the way leads nowhere: they :meth:`begin` apart from what :meth:`follow` makes of the
    others.

    Surfaces that let light go straight on (:mod:`.straight`) are no vertices and count for no depth. One that is met
    is passed where its BSDF draws its ``Null`` lobe. A catcher scatters nothing towards the camera; light comes back
    from it by its own BSDF. From ``rr_depth`` scatterings on, paths end at random, as Mitsuba's do.
    """

    def __init__(self, max_depth: int, rr_depth: int, hide_emitters: bool) -> None:
        self.max_depth, self.rr_depth, self._hide_emitters = max_depth, rr_depth, hide_emitters

    @property
    def any(self) -> bool:
        """Whether there is anything beyond direct light."""
        return self.max_depth < 0 or self.max_depth > 2

    def limits(self) -> tuple[mi.UInt32, mi.UInt32]:
        """Surfaces of a path, at most, and those from which on it ends at random, for kernels."""
        most = self.max_depth - 1 if self.max_depth > 0 else 0xFFFFFFFF
        return dr.opaque(mi.UInt32, most), dr.opaque(mi.UInt32, self.rr_depth)

    @dr.syntax
    def begin(
        self, scene: mi.Scene, sight: Sight, index: mi.UInt32, seed: mi.UInt32, ray: mi.Ray3f, active: mi.Bool
    ) -> Way:
        """The first vertices of camera rays; ``index``: of the sample in its pixel, whose ``seed`` it is."""
        way = Way()
        way.ray = mi.Ray3f(ray.o, ray.d, ray.maxt, ray.time, ray.wavelengths)
        seed = mix(seed ^ _VERTICES)
        going = mi.Bool(active)
        while going:
            si = scene.ray_intersect(way.ray, mi.RayFlags.All, coherent=False, active=going)
            unseen, dark = self._not_seen(sight, si, way.ray, going & si.is_valid())
            going &= si.is_valid() & ~dark
            own = mix(seed + way.met * 0x9E3779B9)
            # Behind what was passed, the same points in another order, or they would repeat those that passed it.
            points = FirstPoints(dr.select(way.met == 0, index, shuffle(index, own)), own)
            bs, weight, straight, lost = self._way_on(sight, si, points, unseen, way.met, going)
            going &= ~lost
            way.β = dr.select(going & ~unseen, way.β * weight, way.β)
            way.η = dr.select(going & ~straight, way.η * bs.eta, way.η)
            way.delta |= going & ~straight & mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            if sight.ways is not None:
                way.κ = sight.ways.after(way.κ, si, bs, mi.Bool(True), going)
            way.met += 1
            way.alive |= going & ~straight & dr.any(way.β != 0)
            if dr.hint(self.rr_depth <= 1, mode="scalar"):
                q, survives = self._survives(way.β, way.η, points)
                way.alive &= straight | survives
                way.β = dr.select(going & ~straight, way.β / q, way.β)
            way.ray = si.spawn_ray(dr.select(straight, way.ray.d, si.to_world(bs.wo)))
            going &= straight
        way.alive &= scene.ray_test(way.ray, way.alive)
        return way

    @dr.syntax
    def follow(
        self, scene: mi.Scene, light: VertexLight, sight: Sight, index: mi.UInt32, seed: mi.UInt32, way: Way
    ) -> mi.Spectrum:
        """What each ``way`` brings on and after its second vertex."""
        most, roulette = self.limits()
        seed = mix(seed ^ _VERTICES)

        L, β, η, ray = mi.Spectrum(0), mi.Spectrum(way.β), mi.Float(way.η), mi.Ray3f(way.ray)
        scattered = mi.UInt32(1)  # How often the path was
        met, layers = mi.UInt32(way.met), mi.UInt32(0)  # Surfaces, and those passed since the last vertex
        x = dr.zeros(mi.Interaction3f)  # The last vertex
        pdf, delta = mi.Float(0), mi.Bool(True)  # Of the sample of its BSDF
        M = mi.UInt32(0)  # Samples of the map there
        ways: Any = light.ways  # None where there are no light paths
        κ = None if ways is None else mi.Float(way.κ)
        aimed = mi.Bool(False)  # Whether light paths begin at the last vertex
        going = mi.Bool(way.alive)
        while going:
            si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=going)
            beside = None if ways is None else dr.select(aimed, κ, 0)
            L += β * light.found(x, si, pdf, delta, M, going & (scattered >= 2), κ=beside)
            reflects = scattered < most  # else, what the last sample of a BSDF finds may still be behind masks
            going &= si.is_valid() & (reflects | sight.masks)

            # ------------------------- Light that arrives here ------------------------
            points = PixelPoints(index, mix(seed + met * 0x9E3779B9))
            M_here = light.proposals(si.shape, si.bsdf(), going)
            L += β * light.sampled(points, si, si.bsdf(), M_here, going & reflects, κ=κ)

            # ------------------------------- The way on -------------------------------
            bs, weight, straight, lost = self._way_on(sight, si, points, mi.Bool(False), layers, going)
            β *= weight
            going &= ~lost & dr.any(β != 0) & (straight | reflects)
            scatters = going & ~straight
            x.p, x.n = dr.select(scatters, si.p, x.p), dr.select(scatters, si.n, x.n)
            x.time, x.wavelengths = si.time, si.wavelengths
            pdf, M = dr.select(scatters, bs.pdf, pdf), dr.select(scatters, M_here, M)
            delta = dr.select(scatters, mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta), delta)
            if dr.hint(ways is not None, mode="scalar"):
                κ = dr.select(scatters, ways.after(κ, si, bs, mi.Bool(False), scatters), κ)
                aimed = dr.select(scatters, ways.targeted(si.shape, scatters), aimed)
            η = dr.select(scatters, η * bs.eta, η)
            scattered += dr.select(scatters, 1, 0)
            layers = dr.select(scatters, 0, layers + 1)
            met += 1

            # ---------------------------- Russian roulette ----------------------------
            q, survives = self._survives(β, η, points)
            ends = scatters & (scattered >= roulette)
            going &= ~ends | survives
            β = dr.select(ends, β / q, β)

            ray = si.spawn_ray(dr.select(straight, ray.d, si.to_world(bs.wo)))
        return L

    @dr.syntax
    def whole(
        self, scene: mi.Scene, light: VertexLight, index: mi.UInt32, seed: mi.UInt32, ray: mi.Ray3f, active: mi.Bool
    ) -> tuple[mi.Spectrum, mi.Bool]:
        """All that arrives along camera rays, where nothing lets light go straight on: Σ_{k=0}^{D−1}, with what can be
        seen for k = 0 and one sample of the BSDF of each surface for the map and for the way on; and alpha."""
        most, roulette = self.limits()
        seed = mix(seed ^ _VERTICES)

        L, β, η = mi.Spectrum(0), mi.Spectrum(1), mi.Float(1)
        ray = mi.Ray3f(ray.o, ray.d, ray.maxt, ray.time, ray.wavelengths)
        scattered = mi.UInt32(0)
        x = dr.zeros(mi.Interaction3f)  # The last vertex
        pdf, delta = mi.Float(1), mi.Bool(True)  # Of the sample of its BSDF; the camera's is of one direction
        M = mi.UInt32(0)  # Samples of the map there
        shown = not self._hide_emitters
        ways: Any = light.ways  # None where there are no light paths
        κ = None if ways is None else mi.Float(0)
        aimed = mi.Bool(False)  # Whether light paths begin at the last vertex
        joined = FirstPoints(index, mix(seed))
        u_first, v_first = joined.next_1d(), joined.next_2d()
        going, seen = mi.Bool(active), mi.Bool(False)
        while going:
            si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=going)
            first = scattered == 0
            seen |= first & si.is_valid()
            level = dr.select(scattered == 1, light.level, 0)
            beside = None if ways is None else dr.select((scattered > 1) & aimed, κ, 0)
            L += β * light.found(x, si, pdf, delta, M, going & (~first | shown), level, beside)
            going &= si.is_valid() & (scattered < most)

            # ------------------------- Light that arrives here ------------------------
            points = PixelPoints(index, mix(seed + scattered * 0x9E3779B9))
            M, N = light.proposals(si.shape, si.bsdf(), going), light.rays(si.shape, si.bsdf(), first, going)
            L += β * light.sampled(points, si, si.bsdf(), M, going, N, dr.select(first, light.level, 0), κ)
            M *= N

            # ------------------------------- The way on -------------------------------
            u, v = points.next_1d(), points.next_2d()
            u, v = dr.select(first, u_first, u), dr.select(first, v_first, v)
            bs, weight = si.bsdf().sample(mi.BSDFContext(), si, u, v, going)
            β *= weight
            going &= dr.any(β != 0)
            if dr.hint(ways is not None, mode="scalar"):
                κ = ways.after(κ, si, bs, first, going)
                aimed = ways.targeted(si.shape, going)
            x.p, x.n, x.time, x.wavelengths = si.p, si.n, si.time, si.wavelengths
            pdf, delta = bs.pdf, mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            η *= bs.eta
            scattered += 1

            # ---------------------------- Russian roulette ----------------------------
            q, survives = self._survives(β, η, points)
            ends = scattered >= roulette
            going &= ~ends | survives
            β = dr.select(ends, β / q, β)
            ray = si.spawn_ray(si.to_world(bs.wo))
        return L, active if shown and scene.environment() is not None else seen

    def _way_on(
        self,
        sight: Sight,
        si: mi.SurfaceInteraction3f,
        points: PixelPoints,
        unseen: mi.Bool,
        layers: mi.UInt32,
        active: mi.Bool,
    ) -> tuple[mi.BSDFSample3f, mi.Spectrum, mi.Bool, mi.Bool]:
        """A sample of the BSDF and its weight, whether the way goes straight on, and where it ends."""
        bsdf = si.bsdf()
        bs, weight = bsdf.sample(mi.BSDFContext(), si, points.next_1d(), points.next_2d(), active & ~unseen)
        straight, lost = mi.Bool(unseen), mi.Bool(False)
        if sight.masks:
            null = active & ~unseen & mi.has_flag(bs.sampled_type, mi.BSDFFlags.Null)
            lost = null & (dr.all(bsdf.eval_null_transmission(si, null) == 0) | (layers + 1 >= LAYERS))
            straight |= null
        return bs, weight, straight, lost

    @staticmethod
    def _survives(β: mi.Spectrum, η: mi.Float, points: PixelPoints) -> tuple[mi.Float, mi.Bool]:
        """The probability to go on where paths end at random, and whether each does."""
        q = dr.minimum(dr.max(β) * η * η, ENOUGH)
        return q, points.next_1d() < q

    def _not_seen(
        self, sight: Sight, si: mi.SurfaceInteraction3f, ray: mi.Ray3f, active: mi.Bool
    ) -> tuple[mi.Bool, mi.Bool]:
        """Whether the camera sees through what its ray has met, and whether nothing is reflected there."""
        unseen, dark = mi.Bool(False), mi.Bool(False)
        if sight.catcher is not None:
            caught = active & sight.catcher.met(si)
            through = dr.all(sight.catcher.transmission(si, ray.d, mi.Spectrum(0)) > 0)
            unseen, dark = caught & through, caught & ~through
        if self._hide_emitters:
            unseen |= active & emits(si)
        return unseen, dark
