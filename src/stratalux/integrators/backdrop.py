"""What camera rays see that meet nothing: the map, another light around the scene, a picture, or nothing (Mitsuba)."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from ..errors import InputError
from .environment import looked_up

Background = Any
"""``map``, ``none``, an emitter around the scene, or a texture that lies over the film."""
_WORDS = ("map", "none")
_CAMERAS = ("PerspectiveCamera", "ThinLensCamera", "OrthographicCamera")


def background_of(props: mi.Properties) -> Background:
    """The property ``background``; raises :class:`InputError`. A colour stands for an even light of that radiance."""
    given = props.get("background", "map")
    if isinstance(given, str):
        if given not in _WORDS:
            raise InputError(f"background: '{given}' is unknown; use map, none, a colour, an emitter or a texture")
        return given
    if isinstance(given, mi.Emitter):
        if not mi.has_flag(given.flags(), mi.EmitterFlags.Infinite) or mi.has_flag(
            given.flags(), mi.EmitterFlags.Delta
        ):
            raise InputError(f"background: a {given.class_name()} is not all around the scene; use envmap or constant")
        return given
    if isinstance(given, mi.Texture):
        if mi.is_spectral:
            raise InputError("background: a picture has RGB colours; use an RGB variant (llvm_ad_rgb)")
        return given
    if isinstance(given, mi.ScalarColor3d | mi.ScalarColor3f | float):
        colour = [given] * 3 if isinstance(given, float) else [float(value) for value in given]
        return mi.load_dict({"type": "constant", "radiance": {"type": "rgb", "value": colour}})
    raise InputError(f"background: {given!r} is none; use map, none, a colour, an emitter or a texture")


class Light:
    """An emitter all around, which shines from behind everything, and on nothing but the film."""

    covers = True

    def __init__(self, emitter: mi.Emitter) -> None:
        self._emitter = emitter

    def parts(self) -> tuple[mi.Object, ...]:
        """What it is made of."""
        return (self._emitter,)

    def radiance(self, ray: mi.Ray3f, active: mi.Bool) -> mi.Spectrum:
        """Of the camera's ``ray``."""
        it = dr.zeros(mi.SurfaceInteraction3f)
        it.wi = -ray.d
        it.wavelengths = ray.wavelengths
        return looked_up(lambda lanes: self._emitter.eval(it, lanes), active)


class Nothing:
    """Black, and not there."""

    covers = False

    def parts(self) -> tuple[mi.Object, ...]:
        return ()

    def radiance(self, ray: mi.Ray3f, active: mi.Bool) -> mi.Spectrum:
        return mi.Spectrum(0)


class Plate:
    """A picture that lies over the whole film of the ``sensor``, its first texel in the corner at the upper left."""

    covers = True

    def __init__(self, texture: mi.Texture, sensor: mi.Sensor) -> None:
        if sensor.class_name() not in _CAMERAS:
            raise InputError(
                f"background: a picture needs a camera that it fits: perspective, thinlens or orthographic, "
                f"and not {sensor.class_name()}"
            )
        self._texture, self._sensor = texture, sensor

    def parts(self) -> tuple[mi.Object, ...]:
        return self._texture, self._sensor

    def radiance(self, ray: mi.Ray3f, active: mi.Bool) -> mi.Spectrum:
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.uv = film_position(self._sensor, ray)
        si.wavelengths = ray.wavelengths
        return looked_up(lambda lanes: self._texture.eval(si, lanes), active)


def film_position(sensor: mi.Sensor, ray: mi.Ray3f) -> mi.Point2f:
    """Where a camera ``ray`` comes from: (0, 0) is the upper left corner of the whole film, (1, 1) the lower right."""
    film = sensor.film()
    width, height = (float(side) for side in film.size())
    world = sensor.world_transform()
    local = world.inverse()
    o, d = local @ ray.o, local @ ray.d
    if sensor.class_name() == "OrthographicCamera":
        return mi.Point2f(0.5 * (1 - o.x), 0.5 * (1 - o.y * (width / height)))
    # All rays of a lens to one place of the film meet where it is in focus.
    params = mi.traverse(sensor)
    z = params["focus_distance"] if "focus_distance" in params else dr.sqrt(params["near_clip"] * params["far_clip"])
    it = dr.zeros(mi.SurfaceInteraction3f)
    it.p = ray.o + ray.d * ((z - o.z) / d.z)
    ds, _ = sensor.sample_direction(it, mi.Point2f(0.5))
    uv = ds.uv + mi.Vector2f(film.crop_offset())
    return mi.Point2f(uv.x / width, uv.y / height)
