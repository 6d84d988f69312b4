"""Pictures under a map, and the same under the lights that stand for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..maps.envmap import EnvironmentMap
from ..rigs.harmonics import ambient_map
from ..rigs.lights import Lights, frame_towards
from ..rigs.quality import disks
from ..scenes.demo import demo_mesh
from ..scenes.load import envmap
from ..scenes.materials import material
from ..scenes.stage import stage

SPHERES, OBJECT = (600, 190), (480, 320)
"""Sizes of the pictures."""
_SPP = 32
_SPP_OF_ALL = 64
"""Samples per pixel of all lights together, at least."""
_DETAIL = 3
_APART = 2.3


@dataclass(frozen=True)
class View:
    """Linear pictures (H, W, 3) of one view: under the map, and under the lights and their ambient light."""

    title: str
    under_map: NDArray[np.float32]
    under_rig: NDArray[np.float32]


def views(environment: EnvironmentMap, lights: Lights) -> list[View]:
    """A matte sphere, a glossy one and a mirror, in the air, and an object on a matte floor: direct light, without what
    is behind. A variant must be active."""
    return [
        _view("Spheres: matte, glossy, and a mirror", _spheres(), environment, lights),
        _view("An object", _object(), environment, lights),
    ]


def _view(title: str, scene: dict[str, Any], environment: EnvironmentMap, lights: Lights) -> View:
    return View(title, _under(scene, envmap(environment)), _under_lights(scene, lights))


def _under(scene: dict[str, Any], emitter: dict[str, Any]) -> NDArray[np.float32]:
    integrator = mi.load_dict({"type": "direct_stratified", "hide_emitters": True})
    return _picture(mi.load_dict({**scene, "emitter": emitter}), integrator, _SPP, 0)


def _under_lights(scene: dict[str, Any], lights: Lights) -> NDArray[np.float32]:
    """The sum over lights, one at a time: light that a path picks at random would be noise."""
    directions, colours = disks(lights)
    shine = np.flatnonzero(colours.any(axis=1))
    lit = mi.load_dict({**scene, "lamp": {"type": "directional", "direction": [0, -1, 0], "irradiance": _rgb(1)}})
    integrator = mi.load_dict({"type": "direct", "emitter_samples": 1, "bsdf_samples": 0, "hide_emitters": True})
    params = mi.traverse(lit)
    place, irradiance = "lamp.to_world", "lamp.irradiance.value"
    turn, colour = type(params[place]), type(params[irradiance])
    spp = max(1, -(-_SPP_OF_ALL // max(len(shine), 1)))
    total = np.zeros((*reversed(lit.sensors()[0].film().size()), 3), dtype=np.float32)
    for number, k in enumerate(shine):
        towards = np.eye(4)
        towards[:3, :3] = frame_towards(-directions[k])
        params[place], params[irradiance] = turn(towards), colour(*colours[k].tolist())
        params.update()
        total += _picture(lit, integrator, spp, number)
    if lights.ambient is not None:
        total += _under(scene, envmap(EnvironmentMap(ambient_map(lights.ambient))))
    return total


def _picture(scene: mi.Scene, integrator: mi.Integrator, spp: int, seed: int) -> NDArray[np.float32]:
    image = np.array(mi.render(scene, integrator=integrator, spp=spp, seed=seed), dtype=np.float32)
    return np.ascontiguousarray(image[..., :3])


def _object() -> dict[str, Any]:
    made = stage(demo_mesh(_DETAIL), material("clay"), {}, OBJECT)
    return {name: part for name, part in made.items() if name != "emitter"}


def _spheres() -> dict[str, Any]:
    T = mi.ScalarTransform4f
    spheres = {
        f"sphere{k}": {"type": "sphere", "center": [_APART * (k - 1), 1, 0], "bsdf": material(name)}
        for k, name in enumerate(("clay", "plastic", "mirror"))
    }
    width, height = SPHERES
    film = {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb", "rfilter": {"type": "box"}}
    sensor = {
        "type": "perspective",
        "fov": 26,
        "to_world": T().look_at([0, 1, 15.5], [0, 1, 0], [0, 1, 0]),
        "film": film,
        "sampler": {"type": "independent"},
    }
    return {"type": "scene", "sensor": sensor, **spheres}


def _rgb(value: float) -> dict[str, Any]:
    return {"type": "rgb", "value": value}
