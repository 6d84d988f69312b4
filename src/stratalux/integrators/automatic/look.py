"""What each pixel shows, seen without chance: by rays through its corners."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from ..identities import by_identity

_GOLDEN = 0.6180339887
SMOOTH = 0.99
"""Length of the mean of a pixel's normals from which on it shows a surface that is smooth for it: 8 degrees apart."""
_WHOLE = 0.999
"""The same of its marks, from which on all of its corners show one shape."""


@dataclass
class Look:
    """Of each pixel: what kind of thing it shows, and whether that is ``detailed``, 0 or 1.

    ``marks``: two coordinates, alike for pixels that show the same shapes in the same shares. Detailed are pixels with
    the rim of a shape, and those whose normals turn. As nothing here is random, whatever follows from it, for its own
    pixel too, leaves an estimate unbiased.
    """

    marks: tuple[mi.Float, mi.Float]
    detailed: mi.UInt32


def shape_numbers(scene: mi.Scene) -> mi.UInt32:
    """The place of each shape in the scene's list, by its identity."""
    return by_identity(scene.shapes_dr(), dr.arange(mi.UInt32, len(scene.shapes())), 0)


def look(
    scene: mi.Scene,
    sensor: mi.Sensor,
    width: mi.UInt32,
    extent: mi.Vector2f,
    numbers: mi.UInt32,
    corner: mi.UInt32,
    pixel: mi.UInt32,
) -> Look:
    """At each ``pixel`` of a film of that ``width``, by rays through every ``corner``, row by row."""
    row = corner // (width + 1)
    place = mi.Point2f(mi.Float(corner - row * (width + 1)), mi.Float(row))
    time = mi.Float(sensor.shutter_open())
    ray, _ = sensor.sample_ray(time, mi.Float(0.5), mi.Point2f(place / extent), mi.Point2f(0.5))
    si = scene.ray_intersect(ray, mi.RayFlags.ShadingFrame, coherent=False, active=mi.Bool(True))
    hit = si.is_valid()
    identity = dr.reinterpret_array(mi.UInt32, si.shape)
    # Those of instances are not in the list. Multiples of the golden angle keep the others apart.
    turns = _GOLDEN * mi.Float(dr.gather(mi.UInt32, numbers, identity, hit & (identity < dr.width(numbers))))
    angle = dr.two_pi * (turns - dr.floor(turns))
    n = dr.mulsign(si.sh_frame.n, -dr.dot(si.sh_frame.n, ray.d))
    corners = [dr.select(hit, value, 0) for value in (dr.cos(angle), dr.sin(angle), n.x, n.y, n.z)]
    dr.eval(corners)

    first = pixel + pixel // width
    around = first, first + 1, first + width + 1, first + width + 2
    means = [sum(dr.gather(mi.Float, values, corner) for corner in around) / 4 for values in corners]
    marks, n = mi.Vector2f(means[:2]), mi.Vector3f(means[2:])
    seen = dr.any(marks != 0)
    uniform = (dr.norm(marks) > _WHOLE) & (dr.norm(n) > SMOOTH)
    return Look((marks.x, marks.y), mi.UInt32(dr.select(seen & ~uniform, 1, 0)))
