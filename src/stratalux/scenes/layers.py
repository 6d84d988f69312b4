"""Layers over a surface as glTF has them: a clear coat, and the sheen of fibres.

Either covers a share of what is below, which depends on the direction to the eye alone: they are Mitsuba's `blendbsdf`.
So no more light leaves than comes, and as in glTF, light cannot be followed backwards exactly.

Sources: Khronos Group, KHR_materials_clearcoat and KHR_materials_sheen; Estevez and Kulla, "Production Friendly
Microfacet Sheen BRDF" (2017), whose distribution, shadowing and scale of what is below are taken.
"""

from __future__ import annotations

from functools import cache, lru_cache
from types import SimpleNamespace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from .around import around, number, opaque
from .number_texture import number_texture

_COAT_ETA = 1.5
_SMALLEST_ALPHA = 0.001
"""Of coats."""
SMOOTHEST = 0.07
"""Roughness of sheen at least: of less, all is seen within a degree of the rim."""
_TABLE = (64, 32)
"""Steps of the root of the cosine, and of the roughness."""
_LEAST = 1e-4
"""Share that sheen covers where hardly any fibre is seen."""


def coated(base: Any, strength: Any, roughness: Any, normals: Any = None) -> Any:
    """The BSDF `base` under a coat with an index of refraction of 1.5, on the front. For the active variant.

    `strength`: the share of the surface that has a coat, and `roughness`, whose square is the α of GGX: numbers or
    textures. `normals`: the texture of a map of the coat's normals, or None.
    """
    kinds = _kinds(mi.variant())
    coat: dict[str, Any] = {
        "type": "roughconductor",
        "distribution": "ggx",
        "material": "none",
        "alpha": kinds.Alpha(roughness),
    }
    if normals is not None:
        coat = {"type": "normalmap", "normalmap": normals, "bsdf": coat}
    return _layered(base, coat, kinds.CoatShare(strength, normals))


def sheened(base: Any, colour: Any, roughness: Any) -> Any:
    """The BSDF `base` below fibres of a `colour`, a texture or the dictionary of one, on the front.

    `roughness`: how far they stand apart, a number or a texture. For the active variant.
    """
    kinds = _kinds(mi.variant())
    colour = mi.load_dict(colour) if isinstance(colour, dict) else colour
    albedo = kinds.Albedo(roughness)
    return _layered(base, kinds.Fibres(colour, roughness, albedo), kinds.SheenShare(colour, albedo))


def _layered(base: Any, layer: Any, share: Any) -> Any:
    base, layer = (mi.load_dict(each) if isinstance(each, dict) else each for each in (base, layer))
    blend = mi.load_dict({"type": "blendbsdf", "weight": share, "first": base, "second": layer})
    return _kinds(mi.variant()).Layered(blend, base)


def charlie(sin_h: Any, cos_i: Any, cos_o: Any, roughness: Any, maths: Any) -> Any:
    """The reflectance of fibres times the cosine of the light; `maths`: drjit, or numpy.

    D = (2 + 1/α) sin^(1/α) θ_h / 2π, divided by 4 cos θ_i (1 + Λ(θ_i) + Λ(θ_o)); α is the square of the roughness.
    """
    alpha = roughness * roughness
    D = (2 + 1 / alpha) * maths.power(sin_h, 1 / alpha) / (2 * np.pi)
    return D / (4 * cos_i * (1 + _shadowing(cos_i, alpha, maths) + _shadowing(cos_o, alpha, maths)))


def _shadowing(cos: Any, alpha: Any, maths: Any) -> Any:
    """Λ, with the constants of Estevez and Kulla, table 1."""
    p = (1 - alpha) * (1 - alpha)
    a, b, c, d, e = (
        smooth + (rough - smooth) * (1 - p)
        for smooth, rough in (
            (25.3245, 21.5473),
            (3.32435, 3.82987),
            (0.16801, 0.19823),
            (-1.27393, -1.97760),
            (-4.85967, -4.32054),
        )
    )

    def L(x: Any) -> Any:
        return a / (1 + b * maths.power(x, c)) + d * x + e

    low = cos < 0.5
    near, far = L(maths.where(low, cos, 0.5)), L(1 - maths.where(low, 0.5, cos))
    return maths.exp(maths.where(low, near, 2 * L(maths.where(low, 0.5, 0.5)) - far))


@lru_cache(maxsize=1)
def albedos() -> NDArray[np.float32]:
    """What fibres reflect of a light all around, (roughness, root of the cosine), up to 1; the first at `SMOOTHEST`."""
    roughness = np.linspace(SMOOTHEST, 1, _TABLE[1])[:, None, None, None]
    cos_i = np.maximum(np.linspace(0, 1, _TABLE[0]) ** 2, 1e-5)[None, :, None, None]
    nodes, weights = np.polynomial.legendre.leggauss(40)
    t = (nodes + 1) / 2
    cos_o, d_cos = t[:, None] ** 2, (weights * t)[:, None]  # more of them near the rim
    phi = (np.arange(40) + 0.5) * np.pi / 40
    dot = np.sqrt((1 - cos_i**2) * (1 - cos_o**2)) * np.cos(phi) + cos_i * cos_o
    cos_h = (cos_i + cos_o) / np.sqrt(np.maximum(2 + 2 * dot, 1e-12))
    sin_h = np.sqrt(np.maximum(1 - cos_h**2, 0))
    total = (charlie(sin_h, cos_i, cos_o, roughness, np) * d_cos).sum(axis=(2, 3)) * (2 * np.pi / 40)
    return np.maximum(total, _LEAST).astype(np.float32)


@cache
def _kinds(variant: str) -> SimpleNamespace:
    """The classes for a variant, whose own they derive from."""

    Numbers = number_texture(variant)

    class Alpha(Numbers):  # type: ignore[misc, valid-type]
        """The α of GGX."""

        def __init__(self, roughness: Any) -> None:
            super().__init__()
            self.roughness = opaque(roughness)

        def eval_1(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Float:
            return dr.maximum(dr.square(number(self.roughness, si, active)), _SMALLEST_ALPHA)

    class CoatShare(Numbers):  # type: ignore[misc, valid-type]
        """What a coat reflects of the light that comes, or goes, the way of the eye."""

        def __init__(self, strength: Any, normals: Any) -> None:
            super().__init__()
            self.strength, self.normals = opaque(strength), normals

        def eval_1(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Float:
            cos = mi.Frame3f.cos_theta(si.wi)
            front = cos > 0
            if self.normals is not None:
                n = dr.normalize(2 * mi.Vector3f(self.normals.eval_3(si, active)) - 1)
                cos = dr.abs(dr.dot(n, si.wi))
            return dr.select(front, number(self.strength, si, active) * mi.fresnel(cos, _COAT_ETA)[0], 0)

    class Albedo(Numbers):  # type: ignore[misc, valid-type]
        """What fibres reflect in all, of what is seen at the angle of the eye."""

        def __init__(self, roughness: Any) -> None:
            super().__init__()
            self.roughness = opaque(roughness)
            self.table = mi.Texture2f(mi.TensorXf(albedos()[..., None]), wrap_mode=dr.WrapMode.Clamp)

        def fibres(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Float:
            return dr.clip(number(self.roughness, si, active), SMOOTHEST, 1)

        def eval_1(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Float:
            # From the first to the last of the table's texels, whose middles are half of one from its edges.
            x, y = dr.safe_sqrt(mi.Frame3f.cos_theta(si.wi)), (self.fibres(si, active) - SMOOTHEST) / (1 - SMOOTHEST)
            place = mi.Point2f(
                *((along * (steps - 1) + 0.5) / steps for along, steps in zip((x, y), _TABLE, strict=True))
            )
            return self.table.eval(place, active)[0]

    class SheenShare(Numbers):  # type: ignore[misc, valid-type]
        """What fibres take of the light that comes, or goes, the way of the eye: of the colour that they take most."""

        def __init__(self, colour: Any, albedo: Any) -> None:
            super().__init__()
            self.colour, self.albedo = colour, albedo

        def eval_1(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Float:
            share = dr.max(self.colour.eval(si, active)) * self.albedo.eval_1(si, active)
            return dr.select(mi.Frame3f.cos_theta(si.wi) > 0, share, 0)

    class Fibres(mi.BSDF):
        """Fibres that take all light: of their colour, divided by its largest channel. Sampled evenly."""

        def __init__(self, colour: Any, roughness: Any, albedo: Any) -> None:
            super().__init__(mi.Properties())
            self.colour, self.albedo = colour, albedo
            self.m_flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components = [self.m_flags]

        def sample(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, u1: mi.Float, u2: mi.Point2f, active: Any = True
        ) -> tuple[mi.BSDFSample3f, mi.Spectrum]:
            bs = dr.zeros(mi.BSDFSample3f)
            bs.wo = mi.warp.square_to_uniform_hemisphere(u2)
            value, bs.pdf = self.eval_pdf(context, si, bs.wo, active)
            bs.eta = 1.0
            bs.sampled_type, bs.sampled_component = mi.UInt32(+mi.BSDFFlags.GlossyReflection), mi.UInt32(0)
            return bs, dr.select(bs.pdf > 0, value / bs.pdf, 0)

        def eval(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: Any = True
        ) -> mi.Spectrum:
            cos_i, cos_o = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
            active = active & (cos_i > 0) & (cos_o > 0)
            sin_h = mi.Frame3f.sin_theta(dr.normalize(si.wi + wo))
            colour = self.colour.eval(si, active)
            most = dr.max(colour)
            value = charlie(sin_h, cos_i, cos_o, self.albedo.fibres(si, active), _Maths) / self.albedo.eval_1(
                si, active
            )
            return dr.select(active & (most > 0), colour / most * value, 0)

        def pdf(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: Any = True
        ) -> mi.Float:
            active = active & (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)
            return dr.select(active, dr.inv_two_pi, 0)

        def eval_pdf(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: Any = True
        ) -> tuple[mi.Spectrum, mi.Float]:
            return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)

        def traverse(self, callback: Any) -> None:
            pass

        def to_string(self) -> str:
            return f"Fibres[{self.colour}]"

    class Layered(around(variant)):  # type: ignore[misc]
        """A blend that has the colour of what is below the layer."""

        def __init__(self, blend: mi.BSDF, base: mi.BSDF) -> None:
            super().__init__(blend)
            self.base = base

        def sample(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, u1: mi.Float, u2: mi.Point2f, active: Any = True
        ) -> tuple[mi.BSDFSample3f, mi.Spectrum]:
            return self.nested.sample(context, si, u1, u2, active)

        def eval(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: Any = True
        ) -> mi.Spectrum:
            return self.nested.eval(context, si, wo, active)

        def eval_pdf(
            self, context: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: Any = True
        ) -> tuple[mi.Spectrum, mi.Float]:
            return self.nested.eval_pdf(context, si, wo, active)

        def eval_diffuse_reflectance(self, si: mi.SurfaceInteraction3f, active: Any = True) -> mi.Spectrum:
            return self.base.eval_diffuse_reflectance(si, active)

    return SimpleNamespace(
        Alpha=Alpha, CoatShare=CoatShare, Albedo=Albedo, SheenShare=SheenShare, Fibres=Fibres, Layered=Layered
    )


class _Maths:
    """Of Dr.Jit, by NumPy's names."""

    power, exp, where = staticmethod(dr.power), staticmethod(dr.exp), staticmethod(dr.select)
