"""A flat ground that is not seen itself, but for the shadows that fall on it (Mitsuba)."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from ..errors import InputError
from ..maps.irradiance import irradiance
from .environment import MapCache, MapLight

_PLACES = 64
"""Where the normal of a catcher is looked at."""
_FLAT = 0.9999
"""Cosine between normals of what is flat: within 0.8 degrees."""


class Catcher:
    """What shows of one: the share of the map's light that gets through to it, 1 − B / E.

    E = ∫ L cos dω is what would arrive on that side if nothing were in the way, known from the map, and
    B = ∫ L cos (1 − V) dω what is blocked, which any technique estimates that counts 1 − V for V. Where nothing is in
    the way, that is 0 without noise. E is that of :func:`.maps.irradiance.irradiance`, exact to 10⁻⁵ unless all light
    comes from a sun on the horizon. The share is off by as little, and by nothing where nothing is blocked. A channel
    without light has a share of 1.

    ``weight``: π / E, of the light that a white matte surface does not reflect. Seen from behind, it is not there. As
    every shape, it blocks light.
    """

    def __init__(self, shape: mi.Shape, white: mi.BSDF, normal: mi.Vector3f, weight: mi.Spectrum) -> None:
        self.white, self.weight = white, weight
        self._shape, self._normal = shape, normal

    def arrays(self) -> tuple[mi.Vector3f | mi.Spectrum, ...]:
        """What kernels read."""
        return self._normal, self.weight

    def met(self, si: mi.SurfaceInteraction3f) -> mi.Bool:
        """Whether it is this that a ray has met."""
        return si.is_valid() & (si.shape == mi.ShapePtr(self._shape))

    def transmission(self, si: mi.SurfaceInteraction3f, d: mi.Vector3f, T: mi.Spectrum) -> mi.Spectrum:
        """T of what a camera ray with direction ``d`` meets: of this, all or nothing."""
        return dr.select(self.met(si), dr.select(dr.dot(self._normal, d) > 0, 1, 0), T)

    def whitened(
        self, si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr, d: mi.Vector3f, caught: mi.Bool
    ) -> tuple[mi.SurfaceInteraction3f, mi.BSDFPtr]:
        """The surface and its BSDF, white and even where a ray with direction ``d`` is ``caught``."""
        frame = mi.Frame3f(self._normal)
        si.sh_frame = dr.select(caught, frame, si.sh_frame)
        si.wi = dr.select(caught, frame.to_local(-d), si.wi)
        return si, dr.select(caught, mi.BSDFPtr(self.white), bsdf)


class CatcherCache:
    """Finds the catcher of a scene by the ``name`` of its shape; its light is kept while the map stays the same."""

    def __init__(self, name: str) -> None:
        if mi.is_spectral:
            raise InputError("catcher: its light is known in RGB; use an RGB or monochromatic variant (llvm_ad_rgb)")
        self._name = name
        self.white = mi.load_dict({"type": "diffuse", "reflectance": 1.0})
        self._normal = np.zeros(3)
        self._cache: MapCache[list[float]] | None = None

    def get(self, scene: mi.Scene, light: MapLight | None) -> Catcher:
        """The catcher of ``scene``, under ``light``; raises :class:`InputError` where there can be none."""
        if light is None:
            raise InputError(f"catcher '{self._name}': the scene has no environment map, whose shadows it could show")
        shape = _shape(scene, self._name)
        normal = _normal(shape, self._name)
        in_map = light.from_world(mi.Vector3f(*normal)).numpy().ravel()
        if self._cache is None or not np.allclose(in_map, self._normal, atol=1e-6):
            channels = dr.size_v(mi.Spectrum)
            self._cache = MapCache(lambda environment: irradiance(environment.texels, in_map)[:channels].tolist())
            self._normal = in_map
        known = self._cache.get(scene)
        assert known is not None
        E = mi.Spectrum(*known.tables) * known.scale
        n, weight = mi.Vector3f(*normal), dr.select(E > 0, dr.pi / E, 0)
        dr.make_opaque(n, weight)
        return Catcher(shape, self.white, n, weight)


def _shape(scene: mi.Scene, name: str) -> mi.Shape:
    shapes = scene.shapes()
    for shape in shapes:
        if shape.id() == name:
            return shape
    names = ", ".join([shape.id() for shape in shapes][:8]) + (" …" if len(shapes) > 8 else "")
    raise InputError(
        f"catcher '{name}': the scene has no shape of that name; it has {names or 'none'} "
        "(meshes that share a BSDF are merged: give it one of its own)"
    )


def _normal(shape: mi.Shape, name: str) -> list[float]:
    if shape.class_name() == "Instance":
        raise InputError(f"catcher '{name}': is an instance; use a flat shape")
    side = int(np.sqrt(_PLACES))
    x, y = np.meshgrid(*[(np.arange(side) + 0.5) / side] * 2)
    with dr.suspend_grad():
        n = shape.sample_position(0.0, mi.Point2f(x.ravel(), y.ravel())).n.numpy().reshape(3, -1).astype(np.float64)
    mean = n.mean(axis=1)
    mean /= max(float(np.linalg.norm(mean)), 1e-30)
    if not (mean @ n > _FLAT).all():
        raise InputError(f"catcher '{name}': is not flat; use a flat shape, such as a rectangle")
    return [float(value) for value in mean]
