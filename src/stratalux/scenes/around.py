"""A BSDF around another one, which it follows but for what it changes."""

from __future__ import annotations

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi


@cache
def around(variant: str) -> Any:
    """The base class for a variant, whose own BSDF it derives from; it has lobes and densities of what is nested."""

    class Around(mi.BSDF):
        def __init__(self, nested: mi.BSDF) -> None:
            super().__init__(mi.Properties())
            self.nested = nested
            self.m_components = [nested.flags(k) for k in range(nested.component_count())]
            self.m_flags = nested.flags()

        def traverse(self, callback: Any) -> None:
            callback.put("nested", self.nested, mi.ParamFlags.Differentiable)

        def pdf(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: Any = True
        ) -> mi.Float:
            return self.nested.pdf(context, si, wo, active)

        def eval_diffuse_reflectance(self, si: mi.SurfaceInteraction3f, active: Any = True) -> mi.Spectrum:
            return self.nested.eval_diffuse_reflectance(si, active)

        def eval_null_transmission(self, si: mi.SurfaceInteraction3f, active: Any = True) -> mi.Spectrum:
            return self.nested.eval_null_transmission(si, active)

        def to_string(self) -> str:
            return f"{type(self).__name__}[{self.nested}]"

    return Around


def opaque(value: Any) -> Any:
    """A number as an input of kernels, in which materials that differ in numbers alone are then one."""
    return dr.opaque(mi.Float, value) if isinstance(value, float) else value


def number(value: Any, si: mi.SurfaceInteraction3f, active: Any) -> Any:
    """What a number, or a texture of numbers, is at a place."""
    return value.eval_1(si, active) if isinstance(value, mi.Texture) else value
