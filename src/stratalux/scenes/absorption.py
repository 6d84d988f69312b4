"""Glass that absorbs: what comes along a ray within it is as much darker as the ray is long.

The law of Beer and Lambert, at the surface that the ray leaves the glass by: of a colour c after a distance d, light
keeps c^(t/d) on a way of length t. Source: Khronos Group, KHR_materials_volume.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi

from .around import around

_DARKEST = 1e-9
"""Of a channel: a power of 0 has no derivative."""


def absorbing(glass: Any, colour: tuple[float, float, float], distance: float) -> Any:
    """The BSDF ``glass``, of whose light ``colour`` is left after a ``distance`` within. For the active variant.

    Of a ray that meets a surface from within, the length since its last surface counts. What is enclosed and no glass
    itself does not know that it is: on the way to its surface nothing is absorbed.
    """
    nested = mi.load_dict(glass) if isinstance(glass, dict) else glass
    left = mi.load_dict({"type": "rgb", "value": [max(float(c), _DARKEST) for c in colour]})
    return _kind(mi.variant())(nested, left, distance)


@cache
def _kind(variant: str) -> Any:
    class Absorbing(around(variant)):  # type: ignore[misc]
        def __init__(self, nested: mi.BSDF, left: mi.Texture, distance: float) -> None:
            super().__init__(nested)
            self.left, self.distance = left, dr.opaque(mi.Float, distance)

        def sample(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, u1: mi.Float, u2: mi.Point2f, active: Any = True
        ) -> tuple[mi.BSDFSample3f, mi.Spectrum]:
            bs, weight = self.nested.sample(context, si, u1, u2, active)
            return bs, weight * self._kept(si, active)

        def eval(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: Any = True
        ) -> mi.Spectrum:
            return self.nested.eval(context, si, wo, active) * self._kept(si, active)

        def eval_pdf(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: Any = True
        ) -> tuple[mi.Spectrum, mi.Float]:
            value, pdf = self.nested.eval_pdf(context, si, wo, active)
            return value * self._kept(si, active), pdf

        def _kept(self, si: mi.SurfaceInteraction3f, active: Any) -> mi.Spectrum:
            """The share of light that is not absorbed on the way to ``si``."""
            within = active & (mi.Frame3f.cos_theta(si.wi) < 0) & dr.isfinite(si.t)
            return dr.select(within, dr.power(self.left.eval(si, within), si.t / self.distance), 1)

    return Absorbing
