"""Light that goes straight on: surfaces with a ``Null`` lobe, such as masks, let a part of it through as it comes.

A camera ray that meets one goes on with the probability of its transmission, or is shaded there by the other lobes. A
shadow ray carries the product of the transmissions of all that it passes. Transmissions have no derivatives.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

LAYERS = 64
"""A ray ends, black, at as many surfaces that let light through, one behind the other."""


def lets_through(scene: mi.Scene) -> bool:
    """Whether some surface of ``scene`` has a ``Null`` lobe, those of instances included."""
    shapes = scene.shapes()
    if any(shape.bsdf() is not None and mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Null) for shape in shapes):
        return True
    if all(shape.class_name() != "Instance" for shape in shapes):
        return False
    # Instances do not tell what they are made of; what is in the scene besides them does.
    return any(mi.has_flag(bsdf.flags(), mi.BSDFFlags.Null) for bsdf in _bsdfs(scene))


def has_masks(scene: mi.Scene) -> bool:
    """Whether some BSDF is a ``mask``, which draws nothing of what it covers if it may not draw its ``Null`` lobe."""
    return any(bsdf.class_name() == "MaskBSDF" for bsdf in _bsdfs(scene))


def _bsdfs(scene: mi.Scene) -> list[mi.BSDF]:
    """All in the scene, those within others and of instances too."""
    return [part for part in mi.traverse(scene).hierarchy if isinstance(part, mi.BSDF)]


class Arrival:
    """Where camera rays end. ``si``: there, not valid where that is nowhere.

    ``through``: weight of what leaves that place, for all that was passed. ``shaded``: of what is reflected there, as
    not all rays that come there stay. ``L``: radiance of lights that were passed. None where nothing can be passed.
    """

    def __init__(
        self,
        si: mi.SurfaceInteraction3f,
        through: mi.Spectrum | None = None,
        shaded: mi.Spectrum | None = None,
        L: mi.Spectrum | None = None,
    ) -> None:
        self.si, self._through, self.shaded, self._L = si, through, shaded, L

    def emitted(self, L: mi.Spectrum) -> mi.Spectrum:
        """What arrives at the camera if ``L`` leaves the place by itself."""
        return L if self._L is None else self._L + self.behind(L)

    def behind(self, L: mi.Spectrum) -> mi.Spectrum:
        """What arrives at the camera of ``L`` that shines behind all that is passed."""
        return L if self._through is None else self._through * L

    def reflected(self, L: mi.Spectrum) -> mi.Spectrum:
        """What arrives at the camera if ``L`` is reflected there."""
        return L if self.shaded is None else self.shaded * L


@dr.syntax
def first_surface(
    scene: mi.Scene,
    ray: mi.Ray3f,
    u: mi.Float,
    transmission: Callable[[mi.SurfaceInteraction3f, mi.Spectrum], mi.Spectrum],
    lights: bool,
    active: mi.Bool,
) -> Arrival:
    """Follow ``ray`` to where it is shaded, through layers of transmissions T_1, T_2 … with luminances p_k.

    It passes n of them where the random number ``u`` is less than p_1 … p_n. So one number does for all, and the
    samples of a pixel, whose numbers are spread evenly, pass each layer in nearly the right number. ``transmission``:
    that of a surface, from what its BSDF says. ``lights``: whether those that are passed are seen.
    """
    ray = mi.Ray3f(ray.o, ray.d, ray.maxt, ray.time, ray.wavelengths)
    si = dr.zeros(mi.SurfaceInteraction3f)
    going = mi.Bool(active)
    through, stays = mi.Spectrum(1), mi.Float(0)  # Weight, and 1 − p of the last surface
    reach = mi.Float(1)  # p_1 … p_n
    L = mi.Spectrum(0)
    layers = mi.UInt32(0)
    while going:
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=going)
        hit = going & si.is_valid()
        T = transmission(si, si.bsdf().eval_null_transmission(si, hit))
        p = dr.clip(_luminance(T), 0, 1)
        stays = 1 - p
        going = hit & (u < reach * p)
        if dr.hint(lights, mode="scalar"):
            L += dr.select(going, through * si.shape.emitter().eval(si, going), 0)
        through = dr.select(going, through * T / p, through)
        reach = dr.select(going, reach * p, reach)
        ray.o = dr.select(going, si.spawn_ray(ray.d).o, ray.o)
        layers += 1
        through = dr.select(going & (layers >= LAYERS), 0, through)
        going &= layers < LAYERS
    return Arrival(si, through, dr.select(stays > 0, through / stays, 0), L)


def behind(
    si: mi.SurfaceInteraction3f, ray: mi.Ray3f, V: mi.Spectrum, layers: mi.UInt32, active: mi.Bool
) -> tuple[mi.Spectrum, mi.Ray3f, mi.Bool]:
    """Share of light V and the ray behind what ``ray`` has met at ``si``, and where it goes on: layer by layer."""
    hit = active & si.is_valid()
    T = si.bsdf().eval_null_transmission(si, hit)
    V = dr.select(hit, dr.select(layers < LAYERS, V * T, 0), V)
    o = dr.select(hit, si.spawn_ray(ray.d).o, ray.o)
    maxt = dr.select(hit, ray.maxt - si.t, ray.maxt)
    return V, mi.Ray3f(o, ray.d, maxt, ray.time, ray.wavelengths), hit & dr.any(V > 0)


@dr.syntax
def transmittance(scene: mi.Scene, ray: mi.Ray3f, active: mi.Bool) -> mi.Spectrum:
    """Share of the light that gets through along ``ray``: the product of the transmissions of all that it meets."""
    ray = mi.Ray3f(ray.o, ray.d, ray.maxt, ray.time, ray.wavelengths)
    going = mi.Bool(active)
    V = mi.Spectrum(1)
    layers = mi.UInt32(0)
    while going:
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=going)
        layers += 1
        V, ray, going = behind(si, ray, V, layers, going)
    return V


class Obstacles:
    """In place of a scene, for techniques, where a ray test does not do.

    ``masks``: whether what is in the way of light may let some of it through. ``caught``: where to count the light
    that is blocked, and not what gets through (see :class:`~.catcher.Catcher`); None if nowhere.
    """

    def __init__(self, scene: mi.Scene, masks: bool = True, caught: mi.Bool | None = None) -> None:
        self._scene, self._masks, self.caught = scene, masks, caught

    def visible(self, ray: mi.Ray3f, active: mi.Bool) -> mi.Spectrum:
        """V, from 0 to 1, along ``ray``."""
        with dr.suspend_grad():
            if self._masks:
                return transmittance(self._scene, ray, active)
            return dr.select(self._scene.ray_test(ray, active), mi.Spectrum(0), 1)

    def counted(self, V: mi.Spectrum) -> mi.Spectrum:
        """What of light is counted that arrives in the share ``V``."""
        return V if self.caught is None else dr.select(self.caught, 1 - V, V)


Scene = Any
"""A scene of Mitsuba, or :class:`Obstacles` in its place."""


def arriving(scene: Scene, si: mi.SurfaceInteraction3f, d: mi.Vector3f, g: mi.Spectrum, active: mi.Bool) -> mi.Spectrum:
    """What counts at ``si`` of the light ``g`` that comes from the direction ``d`` of the world: g V."""
    V, lit = visible(scene, si.spawn_ray(d), active)
    return dr.select(lit, g * V, 0)


def visible(scene: Scene, ray: mi.Ray3f, active: mi.Bool) -> tuple[Any, mi.Bool]:
    """V along ``ray``, or what is counted instead, and where that is not known to be 0."""
    if isinstance(scene, Obstacles):
        return scene.counted(scene.visible(ray, active)), active
    return 1, active & ~scene.ray_test(ray, active)


def _luminance(T: mi.Spectrum) -> mi.Float:
    return mi.luminance(T) if mi.is_rgb else dr.mean(T)
