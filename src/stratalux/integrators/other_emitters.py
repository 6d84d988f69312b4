"""Light of all that shines but the environment map, and of the map in mirrors (Mitsuba)."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from .derivatives import SUM
from .straight import Obstacles, behind, has_masks, visible


class OtherEmitters:
    """All emitters but the environment map, sampled as Mitsuba's ``direct`` does: one emitter and one BSDF sample.

    Those of ``sampling_weight`` 0 are left to the BSDF sample alone. Delta lobes reflect the environment map as well,
    and only a BSDF sample can find it.
    """

    def __init__(
        self,
        scene: mi.Scene,
        environment_apart: bool,
        differentiated: bool = False,
        obstacles: Obstacles | None = None,
    ) -> None:
        self.environment = scene.environment() if environment_apart else None
        self._differentiated, self._obstacles = differentiated, obstacles
        emitters = [emitter for emitter in scene.emitters() if emitter is not self.environment]
        weights = [0.0 if e is self.environment else float(dr.slice(e.sampling_weight(), 0)) for e in scene.emitters()]
        self.lights = any(weights)
        self.found_by_bsdf = any(not mi.has_flag(emitter.flags(), mi.EmitterFlags.Delta) for emitter in emitters)
        # The sample of a BSDF is spent where it counts. What goes straight on is the camera ray's own way.
        self._kinds = int(mi.BSDFFlags.All if self.found_by_bsdf else mi.BSDFFlags.Delta)
        if obstacles is not None and not has_masks(scene):
            self._kinds &= ~int(mi.BSDFFlags.Null)
        if self.lights:
            self._emitters = scene.emitters_dr()
            self._distribution = mi.DiscreteDistribution(weights)

    def arrays(self) -> tuple[Any, ...]:
        """What kernels read besides the scene's own."""
        return (self._emitters, self._distribution) if self.lights else ()

    def emitter_sampling(
        self, scene: mi.Scene, sampler: mi.Sampler, si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr, active: mi.Bool
    ) -> mi.Spectrum:
        index, pmf = self._distribution.sample_pmf(sampler.next_1d(active), active)
        emitter = dr.gather(mi.EmitterPtr, self._emitters, index, active)
        ds, weight = emitter.sample_direction(si, sampler.next_2d(active), active)
        active = active & (ds.pdf != 0)
        if self._differentiated:
            ds = dr.detach(ds)
            weight = dr.replace_grad(weight, emitter.eval_direction(si, ds, active) / ds.pdf)
        V, active = visible(self._obstacles or scene, si.spawn_ray_to(ds.p), active)
        wo = si.to_local(ds.d)
        value, bsdf_pdf = bsdf.eval_pdf(mi.BSDFContext(), si, wo, active)
        mis = dr.detach(dr.select(ds.delta, 1, power_heuristic(ds.pdf * pmf, bsdf_pdf)))
        return dr.select(active, mis * value * weight * V / pmf, 0)

    def bsdf_sampling(
        self, scene: mi.Scene, sampler: mi.Sampler, si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr, active: mi.Bool
    ) -> mi.Spectrum:
        ctx = mi.BSDFContext()
        ctx.type_mask = self._kinds
        bs, weight = bsdf.sample(ctx, si, sampler.next_1d(active), sampler.next_2d(active), active)
        delta = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
        if self._differentiated:
            active = active & (bs.pdf > 0)
            value = weight * bs.pdf  # of a delta lobe, the pdf is the probability of having chosen it
            bs = dr.detach(bs)
            if self.found_by_bsdf:
                smooth, pdf = bsdf.eval_pdf(ctx, si, bs.wo, active & ~delta)
                value, bs.pdf = dr.select(delta, value, smooth), dr.select(delta, bs.pdf, dr.detach(pdf))
            weight = dr.select(bs.pdf > 0, value / bs.pdf, 0)
        else:
            active = active & dr.any(weight != 0)
        if not self.found_by_bsdf:
            active &= delta
        ray = si.spawn_ray(si.to_world(bs.wo))
        if self._obstacles is not None:
            active &= ~mi.has_flag(bs.sampled_type, mi.BSDFFlags.Null)  # that is the camera ray's own way on
            return dr.select(active, weight * self._found_straight(scene, si, ray, bs.pdf, delta, active), 0)
        with dr.suspend_grad():
            hit = scene.ray_intersect(ray, active)
        value, mis, active = self.found(scene, si, hit, bs.pdf, delta, active)
        return dr.select(active, weight * value * mis, 0)

    def found(
        self,
        scene: mi.Scene,
        si: mi.SurfaceInteraction3f,
        hit: mi.SurfaceInteraction3f,
        bsdf_pdf: mi.Float,
        delta: mi.Bool,
        active: mi.Bool,
    ) -> tuple[mi.Spectrum, mi.Float, mi.Bool]:
        """Radiance of what a BSDF sample at ``si`` has ``hit``, its weight for MIS, and where there is any."""
        emitter = hit.emitter(scene, active)
        active = active & (emitter != None)  # noqa: E711
        environment = active & (emitter == mi.EmitterPtr(self.environment)) if self.environment else mi.Bool(False)
        # The environment map's light through smooth lobes is complete without this sample.
        active &= delta | ~environment
        ds = mi.DirectionSample3f(scene, hit, si)
        pdf = mi.Float(0)
        if self.lights:
            pmf = emitter.sampling_weight() * self._distribution.normalization()
            pdf = dr.select(delta, 0, emitter.pdf_direction(si, ds, active & ~delta) * pmf)
        return emitter.eval(hit, active), dr.detach(power_heuristic(bsdf_pdf, pdf)), active

    @dr.syntax
    def _found_straight(
        self,
        scene: mi.Scene,
        si: mi.SurfaceInteraction3f,
        ray: mi.Ray3f,
        bsdf_pdf: mi.Float,
        delta: mi.Bool,
        active: mi.Bool,
    ) -> mi.Spectrum:
        """Weighted radiance of all that ``ray`` meets, one behind the other."""
        going = mi.Bool(active)
        L, V = mi.Spectrum(0), mi.Spectrum(1)
        layers = mi.UInt32(0)
        while dr.hint(going, max_iterations=SUM):
            with dr.suspend_grad():
                hit = scene.ray_intersect(ray, going)
            value, mis, lit = self.found(scene, si, hit, bsdf_pdf, delta, going)
            L += dr.select(lit, V * value * mis, 0)
            layers += 1
            with dr.suspend_grad():
                V, ray, going = behind(hit, ray, V, layers, going)
        return L


def has_delta(scene: mi.Scene) -> bool:
    """Whether some surface of the scene may have a delta lobe besides ``Null`` (instances do not tell their BSDFs)."""
    shapes = scene.shapes()
    kinds = int(mi.BSDFFlags.Delta) & ~int(mi.BSDFFlags.Null)
    return any(shape.class_name() == "Instance" or int(shape.bsdf().flags()) & kinds for shape in shapes)


def power_heuristic(a: mi.Float, b: mi.Float) -> mi.Float:
    """Veach's power heuristic for one sample of density ``a`` against one of density ``b``, β = 2."""
    ratio = b / a
    return dr.select(a > 0, dr.rcp(1 + ratio * ratio), 0)
