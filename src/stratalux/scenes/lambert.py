"""Mitsuba's `principled` with a matte part that is Lambert's, under its reflection, as glTF and Cycles have it.

Its own is Disney's, which is up to twice as bright at the rim of rough things. What is no metal may have a reflection
of another strength and colour than its index of refraction says. Samples are those of `principled`, whose matte lobe
follows the cosine.

Sources: Khronos Group, "glTF 2.0 Specification", appendix B.3 (`fresnel_mix` and `diffuse_brdf`), and
KHR_materials_specular; Burley, "Physically Based Shading at Disney" (2012), section 5.3, as Mitsuba 3.9 has it.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi

from .around import around, number, opaque

_SMALLEST_ALPHA = 0.001
"""Of `principled`."""


def lambertian(principled: dict[str, Any], strength: Any = None, colour: Any = None, scale: float = 1.0) -> Any:
    """The BSDF of a dictionary of `principled` that has neither `flatness` nor a tint of its reflection.

    `strength`, a number or a texture, is a factor of what is no metal reflects, and `colour`, a texture or the
    dictionary of one, times `scale`, of what it reflects at right angles, up to 1; without transmission. They may be
    None. It is made for the variant that is active.
    """
    given = {name: mi.load_dict(v) if isinstance(v, dict) else v for name, v in principled.items()}
    colour = mi.load_dict(colour) if isinstance(colour, dict) else colour
    return _kind(mi.variant())(given, strength, colour, scale)


@cache
def _kind(variant: str) -> Any:
    class Lambertian(around(variant)):  # type: ignore[misc]
        def __init__(self, given: dict[str, Any], strength: Any, colour: Any, scale: float) -> None:
            super().__init__(mi.load_dict(given))
            self.base, self.eta, self.roughness = (opaque(given[key]) for key in ("base_color", "eta", "roughness"))
            self.metallic, self.transmission = (opaque(given.get(key, 0.0)) for key in ("metallic", "spec_trans"))
            self.anisotropic = opaque(given.get("anisotropic"))
            self.changed = strength is not None or colour is not None
            self.strength, self.colour = opaque(1.0 if strength is None else strength), colour
            self.scale = opaque(scale)

        def sample(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, u1: mi.Float, u2: mi.Point2f, active: Any = True
        ) -> tuple[mi.BSDFSample3f, mi.Spectrum]:
            bs, weight = self.nested.sample(context, si, u1, u2, active)
            drawn = active & (bs.pdf > 0)
            return bs, dr.select(drawn, weight + self._change(si, bs.wo, drawn) / bs.pdf, 0)

        def eval(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: Any = True
        ) -> mi.Spectrum:
            return self.nested.eval(context, si, wo, active) + self._change(si, wo, active)

        def eval_pdf(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: Any = True
        ) -> tuple[mi.Spectrum, mi.Float]:
            value, pdf = self.nested.eval_pdf(context, si, wo, active)
            return value + self._change(si, wo, active), pdf

        def _change(self, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: Any) -> mi.Spectrum:
            """Lambert's part less that of Disney, and the reflection less that of `principled`."""
            cos_i, cos_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
            active = active & (cos_i > 0) & (cos_o > 0)
            h = dr.normalize(si.wi + wo)
            cos_d = dr.dot(h, wo)
            no_metal = 1 - number(self.metallic, si, active)
            matte = no_metal * (1 - number(self.transmission, si, active))
            roughness = number(self.roughness, si, active)
            F_i, F_o = _schlick(cos_i), _schlick(cos_o)
            R = 2 * roughness * cos_d * cos_d
            disney = (1 - 0.5 * F_i) * (1 - 0.5 * F_o) + R * (F_o + F_i + F_o * F_i * (R - 1))
            F = mi.fresnel(cos_d, self.eta)[0]
            value = mi.Spectrum(0)
            F_most = F
            if self.changed:
                F_new = self._reflected(si, F, active)
                F_most = dr.max(F_new)
                value += no_metal * (F_new - F) * self._facets(si, wo, h, roughness, active) / (4 * cos_i)
            value += self.base.eval(si, active) * (matte * cos_o / dr.pi * (1 - F_most - disney))
            return dr.select(active, value, 0)

        def _reflected(self, si: mi.SurfaceInteraction3f, F: mi.Float, active: Any) -> mi.Spectrum:
            """The share that facets of what is no metal reflect, of which those of glass reflect F.

            From right angles, where it is R_0 times the colour, it grows as that of glass does.
            """
            R_0 = dr.square((self.eta - 1) / (self.eta + 1))
            grown = dr.clip((F - R_0) / (1 - R_0), 0, 1)
            colour = mi.Spectrum(1) if self.colour is None else self.scale * self.colour.eval(si, active)
            return number(self.strength, si, active) * dr.lerp(dr.minimum(R_0 * colour, 1), 1, grown)

        def _facets(
            self, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, h: mi.Vector3f, roughness: mi.Float, active: Any
        ) -> mi.Float:
            """How many facets reflect from one direction to the other: D G, of α as `principled` has it."""
            aspect = mi.Float(1)
            if self.anisotropic is not None:
                aspect = dr.sqrt(1 - 0.9 * number(self.anisotropic, si, active))
            alphas = (dr.maximum(_SMALLEST_ALPHA, roughness * roughness * a) for a in (1 / aspect, aspect))
            facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, *alphas)
            return facets.eval(h) * facets.G(si.wi, wo, h)

    return Lambertian


def _schlick(cos: mi.Float) -> mi.Float:
    return (1 - dr.clip(cos, 0, 1)) ** 5
