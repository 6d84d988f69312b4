"""What every direct-light integrator of ours shares: everything but the light of the environment map."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from ..errors import InputError
from ..sampling.recording import no_garbage_collection, one_at_a_time
from . import derivatives
from .backdrop import background_of
from .catcher import CatcherCache
from .derivatives import SUM
from .environment import MapLight
from .other_emitters import OtherEmitters, has_delta
from .sight import Sight
from .straight import Arrival, Obstacles, Scene, first_surface, visible

LEAST = 1e-30
"""In place of an energy that is 0."""


class DirectIntegrator(mi.SamplingIntegrator):
    """Camera ray, visible emitters, and the emitters that Mitsuba samples; the map's light is left to a subclass.

    Camera rays and light pass what has a ``Null`` lobe, as masks have, in the share that it transmits
    (:mod:`.straight`); a bump map or normal map around a mask does not tell that (Mitsuba 3.9), and is opaque.

    The property ``background`` says what those see that meet nothing: ``map``, which is the scene's own (the default);
    ``none``, of alpha 0; a colour; an emitter all around, as another ``envmap``; or a texture that lies over the film.
    Light comes from the scene's own map all the same. ``hide_emitters`` hides lights of the scene, but not another
    background than the map. :class:`InputError` is raised for anything else.

    The property ``catcher`` names a flat shape that shows the background, less the share of the map's light that is
    blocked on its way there (:mod:`.catcher`). Without a background, it is black, with that share, in luminance, for
    alpha; as an estimate, it may be a bit beyond 1.

    A subclass implements ``prepare(scene)``, which returns what ``environment_light`` needs, or None if the scene has
    no environment map, and ``environment_light`` itself.
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self.background = background_of(props)
        self.catcher = str(props.get("catcher", ""))
        self._catchers = CatcherCache(self.catcher) if self.catcher else None
        self._sensor: mi.Sensor | None = None

    def prepare(self, scene: mi.Scene) -> Any:
        raise NotImplementedError

    def environment_light(
        self,
        scene: Scene,
        prepared: Any,
        sampler: mi.Sampler,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        """Direct light of the environment map at ``si`` from smooth lobes, less what ``scene`` keeps off."""
        raise NotImplementedError

    def sample(
        self,
        scene: mi.Scene,
        sampler: mi.Sampler,
        ray: mi.RayDifferential3f,
        medium: mi.Medium | None = None,
        active: mi.Bool | bool = True,
    ) -> tuple[mi.Spectrum, mi.Bool, list[mi.Float]]:
        """Radiance along ``ray``, its alpha, and no AOVs (Mitsuba's integrator interface)."""
        with no_garbage_collection():
            prepared = self.prepare(scene)
            sight = self.sight(scene, prepared, self._sensor)
            others = OtherEmitters(scene, prepared is not None, derivatives.wanted(scene), sight.obstacles)
            L, alpha = self.radiance(scene, prepared, others, sight, sampler, ray, active)
            # All that Mitsuba can be told is whether there is something.
            return L, sampler.next_1d(active) < alpha if sight.fades else alpha, []

    @one_at_a_time
    def render(
        self,
        scene: mi.Scene,
        sensor: mi.Sensor | int = 0,
        seed: int | mi.UInt32 = 0,
        spp: int = 0,
        develop: bool = True,
        evaluate: bool = True,
    ) -> mi.TensorXf:
        """As Mitsuba's; one thread at a time."""
        self._sensor = scene.sensors()[sensor] if isinstance(sensor, int) else sensor
        try:
            if self._fades():
                return self._render_faded(scene, self._sensor, seed, spp, develop)
            return super().render(scene, sensor, seed, spp, develop, evaluate)
        finally:
            self._sensor = None

    def sight(self, scene: mi.Scene, prepared: Any, sensor: mi.Sensor | None) -> Sight:
        """What rays see of ``scene``. Without a ``sensor``, a picture behind it is that of the scene's first one."""
        catcher = self._catchers.get(scene, prepared) if self._catchers is not None else None
        return Sight(scene, self.background, self.hide_emitters, sensor, catcher)

    def _fades(self) -> bool:
        """Whether alpha is a share, which Mitsuba's own loop over a film does not know of."""
        none = self.background == "none" or (self.background == "map" and self.hide_emitters)
        return bool(self.catcher) and none

    def _render_faded(
        self, scene: mi.Scene, sensor: mi.Sensor, seed: int | mi.UInt32, spp: int, develop: bool
    ) -> mi.TensorXf:
        film, common = sensor.film(), mi.ad.integrators.common.ADIntegrator
        with no_garbage_collection(), dr.suspend_grad():
            sampler, spp = common.prepare(self, sensor, seed, spp, [])
            sensor.sampler().set_sample_count(spp)
            prepared = self.prepare(scene)
            sight = self.sight(scene, prepared, sensor)
            others = OtherEmitters(scene, prepared is not None, obstacles=sight.obstacles)
            ray, weight, pos = common.sample_rays(self, scene, sensor, sampler)
            L, alpha = self.radiance(scene, prepared, others, sight, sampler, ray, True)
            block = film.create_block()
            common._splat_to_block(block, film, pos, L * weight, 1.0, alpha, [], ray.wavelengths)
            film.put_block(block)
            return film.develop() if develop else mi.TensorXf()

    @one_at_a_time
    def render_forward(
        self, scene: mi.Scene, params: Any, sensor: mi.Sensor | int = 0, seed: int | mi.UInt32 = 0, spp: int = 0
    ) -> mi.TensorXf:
        """As Mitsuba's; raises :class:`InputError` where something moves, or lets more through."""
        derivatives.refuse_motion(scene, sensor)
        derivatives.refuse_transmission(scene)
        self._refuse_catcher()
        # Forward through a symbolic loop, Dr.Jit 1.5 fails where other scenes with more kinds of BSDF are alive.
        with dr.scoped_set_flag(dr.JitFlag.SymbolicLoops, False):
            image = self.render(scene, sensor, seed, spp, develop=True, evaluate=False)
            dr.forward_to(image)
        return dr.grad(image)

    @one_at_a_time
    def render_backward(
        self,
        scene: mi.Scene,
        params: Any,
        grad_in: mi.TensorXf,
        sensor: mi.Sensor | int = 0,
        seed: int | mi.UInt32 = 0,
        spp: int = 0,
    ) -> None:
        """As Mitsuba's; raises :class:`InputError` where something moves, or lets more through."""
        derivatives.refuse_motion(scene, sensor)
        derivatives.refuse_transmission(scene)
        self._refuse_catcher()
        image = self.render(scene, sensor, seed, spp, develop=True, evaluate=False)
        dr.backward_from(image * grad_in)

    def _refuse_catcher(self) -> None:
        if self.catcher:
            raise InputError(f"no derivatives with a catcher ('{self.catcher}'): its light is a constant")

    def radiance(
        self,
        scene: mi.Scene,
        prepared: Any,
        others: OtherEmitters,
        sight: Sight,
        sampler: mi.Sampler,
        ray: mi.RayDifferential3f,
        active: mi.Bool | bool,
    ) -> tuple[mi.Spectrum, mi.Bool | mi.Float]:
        """Radiance along ``ray``, and its alpha, whether or how much; ``prepared`` is what :meth:`prepare` returns."""
        active = mi.Bool(active)
        with dr.suspend_grad():  # no shape moves here; those of other scenes that live may
            seen = self._first_surface(scene, sight, sampler, ray, active)
        si = seen.si

        # ----------------------- Visible emitters -----------------------
        L = mi.Spectrum(0)
        valid = active & si.is_valid()
        caught = valid & sight.catcher.met(si) if sight.catcher is not None else mi.Bool(False)
        shown = active if sight.backdrop is None else valid & ~caught
        if not self.hide_emitters:
            L += seen.emitted(si.emitter(scene, shown).eval(si, shown))
        if sight.backdrop is not None:
            bare = active & (~valid | caught)
            behind = dr.select(bare, sight.backdrop.radiance(ray, bare), 0)
            L += seen.behind(behind)

        # ----------------------- Reflected light ------------------------
        bsdf = si.bsdf(ray)
        obstacles = sight.obstacles
        if sight.catcher is not None:
            si, bsdf = sight.catcher.whitened(si, bsdf, ray.d, caught)
            seen.shaded = dr.select(caught, seen.behind(-sight.catcher.weight * behind), seen.shaded)
            obstacles = Obstacles(scene, sight.masks, caught)
        smooth = valid & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        if prepared is not None:
            L_map = self.environment_light(obstacles or scene, prepared, sampler, si, bsdf, smooth)
            L += seen.reflected(L_map)
            self.weigh(sampler, seen)
        if sight.catcher is not None:
            smooth &= ~caught
        if others.lights:
            L += seen.reflected(others.emitter_sampling(scene, sampler, si, bsdf, smooth))
        if others.found_by_bsdf or has_delta(scene):
            L += seen.reflected(others.bsdf_sampling(scene, sampler, si, bsdf, valid & ~caught))
        if sight.catcher is not None and sight.fades:
            return L, dr.select(caught, target(sight.catcher.weight * L_map), dr.select(valid, mi.Float(1), 0))
        if sight.backdrop is not None:
            return L, active if sight.backdrop.covers else valid
        # As in Mitsuba's path: an environment that can be seen covers all that is behind.
        return L, valid if self.hide_emitters or scene.environment() is None else active

    def weigh(self, sampler: mi.Sampler, seen: Arrival) -> None:
        """Give what an estimate has left in ``sampler`` the weight of the reflected light; here, that is nothing."""

    def _first_surface(
        self, scene: mi.Scene, sight: Sight, sampler: mi.Sampler, ray: mi.RayDifferential3f, active: mi.Bool
    ) -> Arrival:
        if sight.straight:

            def transmission(si: mi.SurfaceInteraction3f, T: mi.Spectrum) -> mi.Spectrum:
                T = sight.catcher.transmission(si, ray.d, T) if sight.catcher is not None else T
                return dr.select(emits(si), 1, T) if self.hide_emitters else T

            return first_surface(scene, ray, sampler.next_1d(active), transmission, not self.hide_emitters, active)
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=active)
        return Arrival(si)


class MisWithBsdf:
    """The balance heuristic between the samples that a technique takes of the map and K samples of the BSDF.

    ``density(ω, L)`` is the expected number of map samples per steradian, the sum of the pdfs of all of them, or
    something like it that depends on ω alone; ω is in the map's frame, and L the radiance from there. A map sample
    counts with weight density / (density + K p_b) and a BSDF sample contributes L f cos / (density + K p_b), where p_b
    is the BSDF's pdf (Veach and Guibas 1995, the multi-sample model). As the weights depend on the direction alone,
    they stay right where the map sample is the survivor of a resampling.
    Delta lobes take no part: they are left to :class:`OtherEmitters`. Weights and densities have no derivatives.
    """

    def __init__(self, count: int, differentiated: bool = False) -> None:
        self.count, self._differentiated = count, differentiated
        self.ctx = only(mi.BSDFFlags.Smooth) if count else mi.BSDFContext()

    def eval(
        self, si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr, wo: mi.Vector3f, density: mi.Float, active: mi.Bool
    ) -> mi.Spectrum:
        """f cos for the local direction ``wo`` of a map sample, times the weight of that sample."""
        if not self.count:
            return bsdf.eval(self.ctx, si, wo, active)
        value, pdf = bsdf.eval_pdf(self.ctx, si, wo, active)
        return value * dr.detach(dr.select(density > 0, density / self.total(density, pdf), 0))

    def total(self, density: mi.Float, pdf: mi.Float) -> mi.Float:
        """Expected number of samples per steradian, of the map and of the BSDF."""
        return dr.detach(density + self.count * pdf)

    @dr.syntax
    def bsdf_samples(
        self,
        scene: Scene,
        light: MapLight,
        density: Callable[[mi.Vector3f, mi.Spectrum, mi.Bool], mi.Float],
        sampler: mi.Sampler,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        """Sum of the contributions of the K BSDF samples, one ray each."""
        K = dr.opaque(mi.UInt32, self.count)
        L_o = mi.Spectrum(0)
        k = mi.UInt32(0)
        while dr.hint(k < K, max_iterations=SUM):
            u = sampler.next_1d(active), sampler.next_2d(active)
            bs, weight, found = draw(bsdf, self.ctx, si, *u, active, self._differentiated)
            d = si.to_world(bs.wo)
            V, found = visible(scene, si.spawn_ray(d), found)
            L = light.radiance_towards(d, si, found)
            total = self.total(density(light.from_world(d), L, found), bs.pdf)
            L_o += dr.select(found, L * weight * (bs.pdf / total) * V, 0)
            k += 1
        return L_o


def only(kinds: mi.BSDFFlags) -> mi.BSDFContext:
    """For smooth lobes of these ``kinds``. ``Null`` along with them: without, Mitsuba's ``mask`` would draw nothing of
    what it covers. So some that are drawn are no smooth ones; :func:`draw` tells."""
    ctx = mi.BSDFContext()
    ctx.type_mask = int(kinds) | int(mi.BSDFFlags.Null)
    return ctx


def draw(
    bsdf: mi.BSDFPtr,
    ctx: mi.BSDFContext,
    si: mi.SurfaceInteraction3f,
    u: mi.Float,
    uv: mi.Point2f,
    active: mi.Bool | bool = True,
    differentiated: bool = False,
) -> tuple[mi.BSDFSample3f, mi.Spectrum, mi.Bool]:
    """A sample of ``bsdf``, its weight, and whether it is one of a smooth lobe with light to carry.

    With derivatives it counts even if its weight is 0, as that may be about to change.
    """
    with dr.suspend_grad(when=differentiated):
        bs, weight = bsdf.sample(ctx, si, u, uv, active)
        found = active & (bs.pdf > 0) & ~mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
    if not differentiated:
        return bs, weight, found & dr.any(weight != 0)
    value, pdf = bsdf.eval_pdf(ctx, si, bs.wo, found)
    bs.pdf = dr.detach(pdf)
    return bs, value / bs.pdf, found & (bs.pdf > 0)


def emits(si: mi.SurfaceInteraction3f) -> mi.Bool:
    return si.shape.emitter() != None  # noqa: E711


def target(g: mi.Spectrum) -> mi.Float:
    """The scalar q that resampling follows: luminance in RGB, else the mean over wavelengths; 0 only where g is."""
    if mi.is_rgb:
        return mi.luminance(g)
    return dr.mean(g)
