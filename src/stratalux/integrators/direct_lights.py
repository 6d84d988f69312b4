"""``direct_lights``: the environment map replaced by a rig of directional lights."""

from __future__ import annotations

import sys

import drjit as dr
import mitsuba as mi
import numpy as np

from ..errors import InputError
from ..rigs import RIGS, LightRig, Method, light_rig
from .common import DirectIntegrator
from .derivatives import SUM
from .environment import MapCache, MapLight
from .straight import Scene, arriving
from .techniques import Property, Technique, Value, properties_from

_PROPERTIES = {
    "lights": Property(64, "directional lights, one shadow ray each", minimum=1),
    "jitter": Property(False, "move each light to a random texel of its stratum at each shading point"),
}
_RIG = {"rig": Property("median-cut", "technique that places the lights", choices=tuple(RIGS))}


def _source(method: Method) -> str:
    """What the first line of the method's file says."""
    return str(sys.modules[method.__module__].__doc__).splitlines()[0].rstrip(".")


TECHNIQUES = tuple(
    Technique(
        name=name,
        plugin="direct_lights",
        summary=f"directional lights placed by {name}",
        source=_source(method),
        unbiased=False,
        properties=_PROPERTIES,
        fixed={"rig": name},
        rays=("lights",),
    )
    for name, method in RIGS.items()
)
_ANY_RIG = Technique("direct_lights", "direct_lights", "", "", False, _RIG | _PROPERTIES)


class DirectLights(DirectIntegrator):
    r"""Direct lighting by directional lights that stand for the strata of the environment map. Biased.

    ================= ======= ==================================================================================
    ``rig``           string  ``median-cut``, ``structured``, ``kmeans``, ``lloyd`` or ``penrose``
                              (default: ``median-cut``)
    ``lights``        int     Number of lights N (default: 64); a map with little in it may give fewer
    ``jitter``        bool    Replace each light's direction, at each shading point, by that of a uniformly random
                              texel of its stratum (default: false)
    ``hide_emitters`` bool    Hide directly visible emitters (default: false)
    ================= ======= ==================================================================================

    With C_i = ∫ L dω over stratum i and ω_i the light's direction,

        L_o ≈ Σ_i C_i (f cos)(ω_i) V(ω_i),

    which takes the light of each stratum to come from one direction: shadows have bands, and highlights are missed.
    Jitter turns the bands into noise and keeps a bias, as C_i is not the light of the texel. Other emitters and delta
    lobes are sampled as Mitsuba's ``direct`` does. For RGB and monochromatic variants.
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        settings: dict[str, Value] = properties_from(_ANY_RIG, props)
        self.rig = str(settings["rig"])
        self.lights = int(settings["lights"])
        self.jitter = bool(settings["jitter"])
        if mi.is_spectral:
            raise InputError("direct_lights: a rig has RGB colours; use an RGB or monochromatic variant (llvm_ad_rgb)")
        self._cache = MapCache(lambda environment: RigTables(light_rig(self.rig, environment, self.lights)))

    def prepare(self, scene: mi.Scene) -> MapLight[RigTables] | None:
        """Build (or fetch) the rig for ``scene``; rendering calls this by itself."""
        return self._cache.get(scene)

    @dr.syntax
    def environment_light(
        self,
        scene: Scene,
        light: MapLight[RigTables],
        sampler: mi.Sampler,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        ctx = mi.BSDFContext()
        N = dr.opaque(mi.UInt32, light.tables.count)
        L_o = mi.Spectrum(0)
        i = mi.UInt32(0)
        while dr.hint(i < N, max_iterations=SUM):
            if dr.hint(self.jitter, mode="scalar"):
                ω = light.tables.jittered(i, sampler.next_1d(active), active)
            else:
                ω = light.tables.direction(i, active)
            d = light.to_world @ ω
            g = light.tables.colour(i, active) * bsdf.eval(ctx, si, si.to_local(d), active)
            L_o += arriving(scene, si, d, g, active & dr.any(g != 0))
            i += 1
        return L_o * mi.traverse(light.emitter)["scale"]

    def to_string(self) -> str:
        return f"DirectLights[rig = {self.rig}, lights = {self.lights}, jitter = {self.jitter}]"


class RigTables:
    """A light rig on the device."""

    def __init__(self, rig: LightRig) -> None:
        self.count = len(rig)
        self.height, self.width = rig.shape
        self._direction = mi.Float(rig.direction.astype(np.float32).ravel())
        self._colour = mi.Float(rig.colour.astype(np.float32).ravel())
        order, offset = rig.texels_by_light()
        self._order, self._offset = mi.UInt32(order.astype(np.uint32)), mi.UInt32(offset.astype(np.uint32))

    def direction(self, i: mi.UInt32, active: mi.Bool) -> mi.Vector3f:
        """Direction of light ``i`` in the map's frame."""
        return dr.gather(mi.Vector3f, self._direction, i, active)

    def colour(self, i: mi.UInt32, active: mi.Bool) -> mi.Spectrum:
        """∫ L dω over the stratum of light ``i``, before the emitter's scale."""
        rgb = dr.gather(mi.Color3f, self._colour, i, active)
        return mi.Spectrum(rgb.x) if mi.is_monochromatic else rgb

    def jittered(self, i: mi.UInt32, u: mi.Float, active: mi.Bool) -> mi.Vector3f:
        """Direction of a uniformly random texel of the stratum of light ``i``."""
        first = dr.gather(mi.UInt32, self._offset, i, active)
        count = dr.gather(mi.UInt32, self._offset, i + 1, active) - first
        k = dr.minimum(mi.UInt32(u * mi.Float(count)), count - 1)
        texel = dr.gather(mi.UInt32, self._order, first + k, active)
        y = texel // self.width
        x = texel - y * self.width
        sin_θ, cos_θ = dr.sincos(dr.pi / (self.height - 1) * mi.Float(y))
        sin_φ, cos_φ = dr.sincos(dr.two_pi / self.width * (mi.Float(x) + 0.5))
        return mi.Vector3f(sin_φ * sin_θ, cos_θ, -cos_φ * sin_θ)


PLUGINS = {"direct_lights": DirectLights}
