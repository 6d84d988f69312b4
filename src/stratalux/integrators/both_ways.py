"""Paths that can be found from the camera and from the map: what each of both ways counts for."""

from __future__ import annotations

import math
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from .identities import by_identity, told
from .kinds import made_of

_CAMERAS = ("PerspectiveCamera", "ThinLensCamera")
"""Whose pixels are squares in front of a point, about."""
_FLAT = 1e-3
"""Thickness over size of a shape, up to which it throws no more light on others than a mirror does on a wall."""
ALIKE = ("SmoothDiffuse", "RoughConductor", "SmoothConductor", "RoughPlastic", "SmoothPlastic")
"""BSDFs that draw a direction either way round with densities that are alike but for a cosine, and are 0 in the same
places: c is as good as 1 there, which spares a look-up for each ray."""


class BothWays:
    r"""The balance heuristic between paths from the camera and such from the map, light paths for short.

    A path meets the surfaces x_1 … x_n, the first as seen from the camera, and then the map in direction ω. From the
    camera it is found with the density of its directions up to x_n, times p_b(ω) of the BSDF there, or M p̃(ω) of the
    samples of the map. A light path begins with p̃(ω), at a uniform place of what ω sees, an area A(ω), of a box around
    what has gloss; at x_n, that is. It goes on by the BSDFs the other way round, up to x_1, where a ray to the camera
    closes it. With the densities p_i of the way that leaves x_i away from the camera and p'_i of that towards it, and
    the angles θ_i and θ'_i of both to the normal, it is found

        q = κ p̃(ω) p_b(ω) / A(ω) Π_{i=2}^{n} c_i,    c_i = p'_i |cos θ_i| / (p_i |cos θ'_i|),

        κ = R A_1 |cos θ_1| / p_1

    times as often, in the unit of p_b and M p̃, where R is the number of all light paths for each camera sample of a
    pixel, and A_1 the area at x_1 that a pixel sees. So q joins both in the weights (Veach 1997, chapter 10, with the
    light paths that end at the camera alone). For n = 1 there are no light paths, nor for what has met a lobe without
    width. A weight may be any function of the path that is the same for all ways: so A_1 is that of a pinhole camera.

    ``share``: light paths for each camera sample. ``targets``: what has gloss.
    """

    def __init__(self, scene: mi.Scene, sensor: mi.Sensor, share: float, targets: list[mi.Shape]) -> None:
        low, high = (np.array([np.ravel(getattr(shape.bbox(), side)) for shape in targets]) for side in ("min", "max"))
        low, high = low.min(axis=0), high.max(axis=0)
        centre, sides = (low + high) / 2, high - low
        all_around = scene.bbox()
        far = float(np.linalg.norm(np.ravel(all_around.center()) - centre))
        far += float(np.linalg.norm(np.ravel(all_around.extents()))) / 2
        width, height = (int(side) for side in sensor.film().crop_size())
        params = mi.traverse(sensor)
        to_world = params["to_world"].matrix.numpy().reshape(4, 4)
        focal = int(sensor.film().size()[0]) / (2 * math.tan(math.radians(float(np.ravel(params["x_fov"])[0])) / 2))
        self._centre, self._half = mi.Point3f(centre), mi.Vector3f(sides / 2)
        self._areas = mi.Vector3f(sides[[1, 2, 0]] * sides[[2, 0, 1]])
        self._distance = dr.opaque(mi.Float, 1.001 * far)
        """From the centre to where nothing is any more."""
        self.pixels = dr.opaque(mi.UInt32, width * height)
        targeted = {shape.ptr for shape in targets}
        flags = mi.UInt32([int(shape.ptr in targeted) for shape in scene.shapes()])
        self._targets = by_identity(scene.shapes_dr(), flags, 0)
        self._alike = all(made_of(shape.bsdf(), ALIKE) for shape in scene.shapes())
        self._eye, self._axis = mi.Point3f(to_world[:3, 3]), mi.Vector3f(to_world[:3, 2])
        self._factor = mi.Float(share * width * height / focal**2)
        dr.make_opaque(self._centre, self._half, self._areas, self._eye, self._axis, self._factor)

    @classmethod
    def of(cls, scene: mi.Scene, sensor: mi.Sensor, share: float) -> BothWays | None:
        """For so many light paths for each camera sample; None where nothing gathers light on other things."""
        if sensor.class_name() not in _CAMERAS:
            return None
        targets = [shape for shape in scene.shapes() if _focuses(shape)]
        return cls(scene, sensor, share, targets) if targets else None

    def arrays(self) -> tuple[Any, ...]:
        """What kernels read."""
        box = self._centre, self._half, self._areas, self._distance
        return self._targets, box, self.pixels, self._eye, self._axis, self._factor

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
        return told(self._targets, shape, 0, active) != 0

    def ray(self, d: mi.Vector3f, u: mi.Point2f) -> mi.Ray3f:
        """A ray of light from the direction ``d`` that meets the box at a uniform place of what ``d`` sees of it."""
        shares = self._areas * dr.abs(d) / self.area(d)
        x, y = u.x < shares.x, u.x < shares.x + shares.y
        before = dr.select(x, 0, dr.select(y, shares.x, shares.x + shares.y))
        share = dr.select(x, shares.x, dr.select(y, shares.y, shares.z))
        s, t = 2 * dr.clip((u.x - before) / share, 0, 1) - 1, 2 * u.y - 1
        face = dr.sign(d)
        place = dr.select(
            x, mi.Vector3f(face.x, s, t), dr.select(y, mi.Vector3f(s, face.y, t), mi.Vector3f(s, t, face.z))
        )
        return mi.Ray3f(self._centre + place * self._half + d * self._distance, -d)

    def area(self, d: mi.Vector3f) -> mi.Float:
        """Of what the direction ``d`` sees of the box."""
        return dr.dot(self._areas, dr.abs(d))


def turned(si: mi.SurfaceInteraction3f, wi: mi.Vector3f) -> mi.SurfaceInteraction3f:
    """The same, seen from ``wi``."""
    other = mi.SurfaceInteraction3f(si)
    other.wi = mi.Vector3f(wi)
    return other


def _focuses(shape: mi.Shape) -> bool:
    """Whether it has gloss alone, and may gather light on other things."""
    bsdf = shape.bsdf()
    if bsdf is None or mi.has_flag(bsdf.flags(), mi.BSDFFlags.Diffuse):
        return False
    size = np.ravel(shape.bbox().extents())
    gathers = bool(np.isfinite(size).all() and size.min() > _FLAT * size.max())
    return gathers and bool(mi.has_flag(bsdf.flags(), mi.BSDFFlags.Glossy))
