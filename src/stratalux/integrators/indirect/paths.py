"""Paths that bring what direct light leaves out."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ...sampling.points import mix
from ..automatic.nested_strata import PixelPoints
from ..common import emits
from ..sight import Sight
from ..straight import LAYERS
from .vertex import VertexLight

_VERTICES = 0x6A09E667
"""Distinguishes the points of paths from those of direct light."""
_ENOUGH = 0.95
"""Probability of going on, at most, from ``rr_depth`` on: Mitsuba's."""


class Paths:
    r"""What arrives along camera rays after two scatterings or more.

    From the camera's first surface x_1 on, the BSDF of each surface draws the way to the next one. With the weights
    f cos / p of those samples, the light L_o that :class:`VertexLight` tells, and at most D = ``max_depth`` segments,

        L ≈ Σ_{k=2}^{D−1} L_o(x_k) Π_{i<k} (f cos / p)(x_i).

    Light that was scattered once is left to others, at x_1 and along each way that leads from it to a lamp.

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

    @dr.syntax
    def radiance(
        self,
        scene: mi.Scene,
        light: VertexLight,
        sight: Sight,
        index: mi.UInt32,
        seed: mi.UInt32,
        ray: mi.Ray3f,
        active: mi.Bool,
    ) -> mi.Spectrum:
        """Of each camera ``ray``, sample number ``index`` of a pixel with that ``seed``."""
        most = dr.opaque(mi.UInt32, self.max_depth - 1 if self.max_depth > 0 else 0xFFFFFFFF)
        roulette = dr.opaque(mi.UInt32, self.rr_depth)
        seed = mix(seed ^ _VERTICES)

        ray = mi.Ray3f(ray.o, ray.d, ray.maxt, ray.time, ray.wavelengths)
        L, β, η = mi.Spectrum(0), mi.Spectrum(1), mi.Float(1)
        scattered = mi.UInt32(0)  # How often the path was
        met, layers = mi.UInt32(0), mi.UInt32(0)  # Surfaces on the path, and those that were passed on its last segment
        x = dr.zeros(mi.Interaction3f)  # The last vertex
        pdf, delta = mi.Float(0), mi.Bool(True)  # Of the sample of its BSDF
        going = mi.Bool(active)
        while going:
            si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=going)
            L += β * light.found(x, si, pdf, delta, going & (scattered >= 2))
            going &= si.is_valid()

            # ------ What is not seen by the camera, in front of the first vertex ------
            unseen, dark = self._not_seen(sight, si, ray, going & (scattered == 0))
            going &= ~dark & (unseen | (scattered < most))

            # ------------------------- Light that arrives here ------------------------
            points = PixelPoints(index, mix(seed + met * 0x9E3779B9))
            bsdf = si.bsdf()
            L += β * light.sampled(points, si, bsdf, going & ~unseen & (scattered >= 1))

            # ------------------------------- The way on -------------------------------
            bs, weight = bsdf.sample(mi.BSDFContext(), si, points.next_1d(), points.next_2d(), going & ~unseen)
            straight = mi.Bool(unseen)
            if dr.hint(sight.masks, mode="scalar"):
                null = going & ~unseen & mi.has_flag(bs.sampled_type, mi.BSDFFlags.Null)
                opaque = dr.all(bsdf.eval_null_transmission(si, null) == 0)
                going &= ~(null & (opaque | (layers >= LAYERS)))
                straight |= null
            β = dr.select(unseen, β, β * weight)
            d = dr.select(straight, ray.d, si.to_world(bs.wo))
            scatters = going & ~straight
            x.p = dr.select(scatters, si.p, x.p)
            x.n = dr.select(scatters, si.n, x.n)
            x.time, x.wavelengths = si.time, si.wavelengths
            pdf = dr.select(scatters, bs.pdf, pdf)
            delta = dr.select(scatters, mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta), delta)
            η = dr.select(scatters, η * bs.eta, η)
            scattered += dr.select(scatters, 1, 0)
            layers = dr.select(scatters, 0, layers + 1)
            met += 1
            going &= dr.any(β != 0)

            # ---------------------------- Russian roulette ----------------------------
            q = dr.minimum(dr.max(β) * η * η, _ENOUGH)
            ends = scatters & (scattered >= roulette)
            going &= ~ends | (points.next_1d() < q)
            β = dr.select(ends, β / q, β)

            ray = si.spawn_ray(d)
        return L

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
