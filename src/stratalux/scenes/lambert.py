"""Mitsuba's `principled` with a matte part that is Lambert's, under its reflection, as glTF and Cycles have it.

Its own is Disney's, which is up to twice as bright at the rim of rough things. Samples are those of `principled`, whose
matte lobe follows the cosine.

Sources: Khronos Group, "glTF 2.0 Specification", appendix B.3 (`fresnel_mix` and `diffuse_brdf`); Burley, "Physically
Based Shading at Disney" (2012), section 5.3, as Mitsuba 3.9 has it.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi

from .around import around


def lambertian(principled: dict[str, Any]) -> Any:
    """The BSDF of a dictionary of `principled` that has neither `flatness` nor a tint of its reflection.

    It is made for the variant that is active.
    """
    given = {name: mi.load_dict(v) if isinstance(v, dict) else v for name, v in principled.items()}
    return _kind(mi.variant())(given)


@cache
def _kind(variant: str) -> Any:
    class Lambertian(around(variant)):  # type: ignore[misc]
        def __init__(self, given: dict[str, Any]) -> None:
            super().__init__(mi.load_dict(given))
            self.base, self.eta, self.roughness = (_opaque(given[key]) for key in ("base_color", "eta", "roughness"))
            self.metallic, self.transmission = (_opaque(given.get(key, 0.0)) for key in ("metallic", "spec_trans"))

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
            """Lambert's part less that of Disney."""
            cos_i, cos_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
            active = active & (cos_i > 0) & (cos_o > 0)
            h = dr.normalize(si.wi + wo)
            cos_d = dr.dot(h, wo)
            matte = (1 - _number(self.metallic, si, active)) * (1 - _number(self.transmission, si, active))
            F_i, F_o = _schlick(cos_i), _schlick(cos_o)
            R = 2 * _number(self.roughness, si, active) * cos_d * cos_d
            disney = (1 - 0.5 * F_i) * (1 - 0.5 * F_o) + R * (F_o + F_i + F_o * F_i * (R - 1))
            F = mi.fresnel(cos_d, self.eta)[0]
            value = self.base.eval(si, active) * (matte * cos_o / dr.pi * (1 - F - disney))
            return dr.select(active, value, 0)

    return Lambertian


def _opaque(value: Any) -> Any:
    """A number as an input of kernels, in which materials that differ in numbers alone are then one."""
    return dr.opaque(mi.Float, value) if isinstance(value, float) else value


def _number(value: Any, si: mi.SurfaceInteraction3f, active: Any) -> Any:
    return value.eval_1(si, active) if isinstance(value, mi.Texture) else value


def _schlick(cos: mi.Float) -> mi.Float:
    return (1 - dr.clip(cos, 0, 1)) ** 5
