"""The same of ours: what files look like under a map, without a ground, and what base colours and normals they have.

Passes are means over a box of one pixel, as Cycles' are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from stratalux.integrators.straight import first_surface
from stratalux.maps.envmap import EnvironmentMap
from stratalux.scenes.assembly import assembled
from stratalux.scenes.camera import FIELD_OF_VIEW_DEGREES, sensor
from stratalux.scenes.load import envmap
from stratalux.scenes.looks import Looks
from stratalux.scenes.model import Material
from stratalux.scenes.settings import ENV_FRAMES, CameraSettings
from stratalux.scenes.shapes import load_object

Image = NDArray[np.float32]
_TILT = 0.1
"""Slope of the directions from which light tells what a normal is."""


@dataclass(frozen=True)
class Passes:
    """``picture``, ``base`` and ``normals`` (H, W, 3), ``coverage`` (H, W) and ``single``, see :mod:`.blender`."""

    picture: Image
    base: Image
    normals: Image
    coverage: Image
    single: Image | None = None


@dataclass(frozen=True)
class View:
    """A camera in the file's own coordinates, y up: ``matrix`` (4, 4) with columns left, up, forward and position.

    ``angle``: along the longer side of the film, in radians; ``clip``: what is nearer or farther is not seen.
    """

    matrix: NDArray[np.float64]
    angle: float
    clip: tuple[float, float]
    size: tuple[int, int]


class Matte(Looks):
    """White matte surfaces under the normals and the masks of the file."""

    def _surface(self, *_: Any) -> dict[str, Any]:
        return {"type": "diffuse", "reflectance": {"type": "rgb", "value": 1.0}}

    def _layered(self, *about: Any) -> Any:
        return self._bent(*about)


class Painted(Looks):
    """Matte surfaces of the base colours that materials are made with, under the masks of the file."""

    def _bsdf(self, material: Material, *about: Any) -> Any:
        return super()._bsdf(replace(material, unlit=False), *about)

    def _surface(self, *about: Any) -> dict[str, Any]:
        return {"type": "diffuse", "reflectance": super()._surface(*about)["base_color"]}

    def _glass(self, _material: Any, _sets: Any, bsdf: dict[str, Any]) -> dict[str, Any]:
        return bsdf

    def _layered(self, _material: Any, _sets: Any, _mirrored: bool, bsdf: Any, _side: int = 1) -> Any:
        return bsdf


def render(file: Path, environment: Path, size: tuple[int, int], spp: int, flat_spp: int) -> tuple[Passes, View]:
    """The passes of a file under a map that stands as in Blender, and from where they are seen."""
    found = load_object(file)
    seen = sensor(CameraSettings(camera="none"), found.points(), (), size, spp)
    seen["film"]["rfilter"] = {"type": "box"}
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], ENV_FRAMES["blender"])
    emitter = {**envmap(EnvironmentMap.load(environment)), "to_world": turn}

    def scene(looks: type[Looks], **more: Any) -> mi.Scene:
        return mi.load_dict({"type": "scene", "sensor": seen, **assembled(file, found, looks_of=looks), **more})

    lit = scene(Looks, emitter=emitter)
    picture = np.array(mi.render(lit, integrator=mi.load_dict({"type": "direct_stratified"}), spp=spp))
    base, coverage = _mean(scene(Painted), _base, flat_spp)
    normals, _ = _mean(scene(Matte), _normal, flat_spp)
    matrix = np.array(seen["to_world"].matrix, dtype=np.float64)
    matrix[:3, 3] += found.origin
    slope = np.tan(np.radians(FIELD_OF_VIEW_DEGREES) / 2) * max(size) / min(size)
    clip = (seen["near_clip"], seen["far_clip"])
    return Passes(picture[..., :3], base, normals, coverage), View(matrix, float(2 * np.arctan(slope)), clip, size)


def _mean(scene: mi.Scene, value: Any, spp: int) -> tuple[Image, Image]:
    """A value of the surfaces that are seen, over black, and the part of each pixel that is surface."""
    one = scene.sensors()[0]
    width, height = one.film().size()
    sampler = mi.load_dict({"type": "independent"})
    total = width * height * spp
    sampler.seed(0, total)
    index = dr.arange(mi.UInt32, total) // spp
    corner = mi.Point2f(index % width, index // width)
    place = (corner + sampler.next_2d()) / mi.Point2f(width, height)
    ray, _ = one.sample_ray(0.0, 0.0, place, 0.0)
    arrival = first_surface(scene, ray, sampler.next_1d(), lambda _, T: T, False, mi.Bool(True))
    hit = arrival.si.is_valid()
    # As if it were emitted: what is reflected at a mask has the share that it stops already.
    found = arrival.emitted(mi.Color3f(dr.select(hit, value(arrival.si, hit), 0)))
    there = arrival.emitted(mi.Color3f(dr.select(hit, 1, 0)))
    shape = (height, width, spp, 3)
    pixels, coverage = (np.array(each).T.reshape(shape).mean(axis=2) for each in (found, there))
    return pixels.astype(np.float32), coverage[..., 0].astype(np.float32)


def _base(si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
    return si.bsdf().eval_diffuse_reflectance(si, active)


def _normal(si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
    """n / 2 + 1/2, from how much a matte surface reflects of three directions about its geometric normal."""
    place = type(si)(si)
    back = si.wi.z < 0
    side = dr.select(back, -1.0, 1.0)
    place.wi = mi.Vector3f(0, 0, side)
    directions = np.array([[_TILT * np.cos(a), _TILT * np.sin(a), 1.0] for a in 2 * np.pi * np.arange(3) / 3])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    inverse = np.linalg.inv(directions)
    context = mi.BSDFContext()
    reflected = [
        si.bsdf().eval(context, place, mi.Vector3f(x, y, side * z), active)[0] for x, y, z in directions.tolist()
    ]
    local = [sum(float(row[k]) * reflected[k] for k in range(3)) for row in inverse]
    bent = mi.Vector3f(local[0], local[1], side * local[2])
    # Glass has two different sides, and its matte stand-in no back.
    n = dr.normalize(si.to_world(dr.select(dr.norm(bent) > 0, bent, mi.Vector3f(0, 0, side))))
    return mi.Color3f(n * 0.5 + 0.5)
