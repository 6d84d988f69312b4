"""Paths that can be found from the camera and from the map: what each of both ways counts for."""

from __future__ import annotations

import math
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from .identities import by_identity, told

_CAMERAS = ("PerspectiveCamera", "ThinLensCamera")
"""Whose pixels are squares in front of a point, about."""
_FLAT = 1e-3
"""Thickness over size of a shape, up to which it throws no more light on others than a mirror does on a wall."""


class BothWays:
    r"""The balance heuristic between paths from the camera and such from the map, light paths for short.

    A path meets the surfaces x_1 … x_n, the first as seen from the camera, and then the map in direction ω. From the
    camera, it is found with the density that its directions were drawn with, up to x_n, times p_b(ω) of the BSDF there,
    or M p̃(ω) of the samples of the map. A light path begins with p̃(ω), on a disc of radius r that faces the map around
    ``centre``, and its directions are drawn by the BSDFs the other way round, up to x_1, where a ray to the camera
    closes it. With the densities p_i of the way that leaves x_i away from the camera and p'_i of that towards it, and
    the angles θ_i and θ'_i of both to the normal, it is found

        q = κ p̃(ω) p_b(ω) Π_{i=2}^{n} c_i,    c_i = p'_i |cos θ_i| / (p_i |cos θ'_i|),

        κ = R A |cos θ_1| / (p_1 π r²)

    times as often, in the unit of p_b and M p̃, where R is the number of light paths for each camera sample of a pixel
    times the pixels, and A the area of x_1 that a pixel sees. So q joins both of them in the weights
    (Veach 1997, chapter 10, with the light paths that end at the camera alone). For n = 1 there are no light paths, as
    for whatever has met a lobe without width. A weight may be any function of the path that is the same for all ways.
    """

    def __init__(self, scene: mi.Scene, sensor: mi.Sensor, share: float, targets: list[mi.Shape]) -> None:
        low, high = (np.array([np.ravel(getattr(shape.bbox(), side)) for shape in targets]) for side in ("min", "max"))
        low, high = low.min(axis=0), high.max(axis=0)
        centre, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
        all_around = scene.bbox()
        far = float(np.linalg.norm(np.ravel(all_around.center()) - centre))
        far += float(np.linalg.norm(np.ravel(all_around.extents()))) / 2
        width, height = (int(side) for side in sensor.film().crop_size())
        params = mi.traverse(sensor)
        to_world = params["to_world"].matrix.numpy().reshape(4, 4)
        focal = int(sensor.film().size()[0]) / (2 * math.tan(math.radians(float(np.ravel(params["x_fov"])[0])) / 2))
        self.centre, self.radius = mi.Point3f(centre), dr.opaque(mi.Float, radius)
        self.distance = dr.opaque(mi.Float, 1.001 * far)
        """From the centre to where nothing is any more."""
        self.pixels = dr.opaque(mi.UInt32, width * height)
        targeted = {shape.ptr for shape in targets}
        flags = mi.UInt32([int(shape.ptr in targeted) for shape in scene.shapes()])
        self._targets = by_identity(scene.shapes_dr(), flags, 0)
        self._alike = all(_alike(shape.bsdf()) for shape in scene.shapes())
        self._eye, self._axis = mi.Point3f(to_world[:3, 3]), mi.Vector3f(to_world[:3, 2])
        self._factor = mi.Float(share * width * height / (math.pi * radius**2 * focal**2))
        dr.make_opaque(self.centre, self._eye, self._axis, self._factor)

    @classmethod
    def of(cls, scene: mi.Scene, sensor: mi.Sensor, share: float) -> BothWays | None:
        """For so many light paths for each camera sample; None where nothing promises any use of them."""
        if sensor.class_name() not in _CAMERAS:
            return None
        targets = [shape for shape in scene.shapes() if _focuses(shape)]
        return cls(scene, sensor, share, targets) if targets else None

    def arrays(self) -> tuple[Any, ...]:
        """What kernels read."""
        return self._targets, self.centre, self.radius, self.distance, self.pixels, self._eye, self._axis, self._factor

    def first(self, si: mi.SurfaceInteraction3f, d: mi.Vector3f, pdf: mi.Float) -> mi.Float:
        """κ at the first surface, where the way goes on towards ``d``, of that ``pdf``."""
        view = si.p - self._eye
        squared = dr.squared_norm(view)
        view *= dr.rsqrt(squared)
        cos = dr.dot(view, self._axis)
        area = squared * cos * cos * cos / dr.maximum(dr.abs(dr.dot(si.n, view)), 1e-6)
        return dr.select(pdf > 0, self._factor * area * dr.abs(dr.dot(si.n, d)) / pdf, 0)

    def at(
        self, si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr, wo: mi.Vector3f, pdf: mi.Float, active: mi.Bool
    ) -> mi.Float:
        """c of a later surface, where the way goes on towards ``wo``, of that ``pdf``."""
        if self._alike:
            return mi.Float(1)
        back = bsdf.pdf(mi.BSDFContext(), turned(si, wo), si.wi, active)
        return self.ratio(si, wo, pdf, back)

    def after(
        self, κ: mi.Float, si: mi.SurfaceInteraction3f, bs: mi.BSDFSample3f, first: mi.Bool, active: mi.Bool
    ) -> mi.Float:
        """κ Π c after a sample of the BSDF at ``si``, which may be the ``first`` one."""
        active = active & ~mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
        later = active & ~first & (κ > 0)
        c = self.at(si, si.bsdf(), bs.wo, bs.pdf, later)
        κ = dr.select(first, self.first(si, si.to_world(bs.wo), bs.pdf), dr.select(later, κ * c, 0))
        return dr.select(active, κ, 0)

    def ratio(self, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, pdf: mi.Float, back: mi.Float) -> mi.Float:
        """The same where ``back`` is the density of the other way."""
        if self._alike:
            return mi.Float(1)
        on, before = (dr.abs(dr.dot(si.n, si.to_world(w))) for w in (wo, si.wi))
        return dr.select((pdf > 0) & (before > 0), back * on / (pdf * before), 0)

    def targeted(self, shape: mi.ShapePtr, active: mi.Bool) -> mi.Bool:
        """Whether light paths begin on that ``shape``."""
        return active & (told(self._targets, shape, 0, active) != 0)

    def meets(self, p: mi.Point3f, d: mi.Vector3f) -> mi.Bool:
        """Whether light from the direction ``d`` that arrives at ``p`` may have begun as a light path."""
        return dr.squared_norm(dr.cross(p - self.centre, d)) < self.radius * self.radius


def turned(si: mi.SurfaceInteraction3f, wi: mi.Vector3f) -> mi.SurfaceInteraction3f:
    """The same, seen from ``wi``."""
    other = mi.SurfaceInteraction3f(si)
    other.wi = mi.Vector3f(wi)
    return other


_ALIKE = ("SmoothDiffuse", "RoughConductor", "SmoothConductor", "RoughPlastic", "SmoothPlastic")


def _alike(bsdf: mi.BSDF | None) -> bool:
    """Whether a ray is drawn either way round with densities that are alike but for a cosine, and never of 0 one way
    alone."""
    if bsdf is None:
        return False
    if bsdf.class_name() == "TwoSidedBRDF":
        sides = [line for line in str(bsdf).splitlines() if line.startswith("  brdf[")]
        return bool(sides) and all(side.partition(" = ")[2].partition("[")[0] in _ALIKE for side in sides)
    return bsdf.class_name() in _ALIKE


def _focuses(shape: mi.Shape) -> bool:
    """Whether its gloss may gather light on other things."""
    bsdf = shape.bsdf()
    if bsdf is None or not mi.has_flag(bsdf.flags(), mi.BSDFFlags.Glossy):
        return False
    size = np.ravel(shape.bbox().extents())
    return bool(np.isfinite(size).all() and size.min() > _FLAT * size.max())
