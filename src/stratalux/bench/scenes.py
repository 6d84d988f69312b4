"""The scene of a case in Mitsuba: a camera for each sampler, and the map with and without compensation."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..assets import Assets
from ..comparison.compare import surface_mask
from ..errors import InputError, SceneWarning
from ..images.metrics import Mask
from ..integrators.environment import image_emitter
from ..maps.envmap import EnvironmentMap
from ..rendering.passes import render
from ..scenes.load import envmap, load_scene
from ..scenes.materials import material
from ..scenes.shapes import load_mesh
from ..scenes.stage import SAMPLERS, stage
from .cases import FLIPPED, ROOM, Case, Suite

MEAN = 0.2
"""Of the image, over pixels that are all surface (over the whole image where there is none)."""
_EXPOSURE_SPP = 64
_PREVIEWED = "matpreview-exterior"
"""The part of the preview that gets the material, as the end of its shape's name."""


@dataclass(frozen=True)
class Setting:
    """A case, loaded and exposed.

    ``plain`` and ``compensated``: the same scene but for the ``mis_compensation`` of its map; ``cameras``: index of
    the sensor with each sampler. ``surface``: mask (H, W) of pixels that are all surface. ``scale``: of the map.
    """

    plain: mi.Scene
    compensated: mi.Scene
    cameras: dict[str, int]
    surface: Mask
    size: tuple[int, int]
    scale: float


def load_setting(case: Case, suite: Suite, assets: Assets) -> Setting:
    """The setting of a case; raises :class:`InputError` for a missing or damaged asset."""
    environment = EnvironmentMap.load(assets.require(case.map))
    preview = case.scene == "matpreview"
    describe = {"matpreview": _preview, ROOM: room}.get(case.scene, _staged)
    turn = mi.ScalarTransform4f().rotate([1, 0, 0], 180 if case.map in FLIPPED else 0)
    scenes = []
    for compensated in (False, True):
        description, orientation = describe(case, suite, assets)
        emitter = {**envmap(environment), "to_world": turn @ orientation, "mis_compensation": compensated}
        scenes.append(mi.load_dict({**description, "map": emitter}))
    cameras = {sensor.id().removeprefix("camera_"): k for k, sensor in enumerate(scenes[0].sensors())}
    surface = surface_mask(scenes[0])
    # Rounded, as sums of many threads differ in their last bits and references are kept under all that they depend on.
    scale = float(f"{MEAN / _mean(scenes[0], cameras['multijitter'], surface, case):.3g}")
    for scene in scenes:
        params = mi.traverse(image_emitter(scene))
        params["scale"] = dr.opaque(mi.Float, scale)  # as a literal, it would make other kernels of every case
        params.update()
    size = suite.preview_size if preview else suite.size
    return Setting(scenes[0], scenes[1], cameras, surface, size, scale)


def _mean(scene: mi.Scene, camera: int, surface: Mask, case: Case) -> float:
    image = render(scene, integrator=mi.load_dict({"type": "direct"}), spp=_EXPOSURE_SPP, camera=camera).image
    mean = float((image[surface] if surface.any() else image).mean(dtype=np.float64))
    if not (np.isfinite(mean) and mean > 0):
        raise InputError(f"case {case.name}: the image is black or not finite; is {case.map} a map with light in it?")
    return mean


def _staged(case: Case, suite: Suite, assets: Assets) -> tuple[dict[str, Any], Any]:
    """A mesh on its stage, and the orientation of the map: upright."""
    mesh = load_mesh(assets.require(case.scene))
    scene = stage(mesh, material(case.material), None, suite.size, ground=case.ground)
    del scene["emitter"]
    sensor = scene.pop("sensor")
    camera = {name: sensor[name] for name in ("fov", "fov_axis", "to_world")}
    return {**scene, **_cameras(camera, suite.size)}, mi.ScalarTransform4f()


def _preview(case: Case, suite: Suite, assets: Assets) -> tuple[dict[str, Any], Any]:
    """Mitsuba's material preview with its own shapes, camera and orientation of the map; its object changes material.

    The shapes are taken out of the loaded scene, as another map and other samplers need another one.
    """
    path = assets.require(case.scene)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # direct light is what is measured
        loaded = load_scene(path, size=suite.preview_size)
    previewed = [shape for shape in loaded.shapes() if shape.id().endswith(_PREVIEWED)]
    emitter = image_emitter(loaded)
    if len(previewed) != 1 or emitter is None:
        raise InputError(f"{path}: has no shape '{_PREVIEWED}' under a map; is it Mitsuba's material preview?")
    previewed[0].set_bsdf(mi.load_dict(material(case.material)))
    seen = mi.traverse(loaded.sensors()[0])
    camera = {"fov": float(np.ravel(seen["x_fov"])[0]), "fov_axis": "x", "to_world": _matrix(seen["to_world"])}
    shapes = {f"shape_{k}": shape for k, shape in enumerate(loaded.shapes())}
    orientation = _matrix(mi.traverse(emitter)["to_world"])
    return {"type": "scene", **shapes, **_cameras(camera, suite.preview_size)}, orientation


def room(case: Case, suite: Suite, assets: Assets) -> tuple[dict[str, Any], Any]:
    """A ball in a room, 4 by 6 by 2.5, with a window of 2 by 1.2 in a long wall; the map is upright.

    Walls are thick, and no two share a BSDF: see docs/correctness.md on what Mitsuba makes of meshes that do.
    """
    T = mi.ScalarTransform4f
    pale, red, green = [0.75, 0.72, 0.68], [0.6, 0.15, 0.1], [0.2, 0.5, 0.2]
    boxes: dict[str, tuple[list[float], list[float], list[float]]] = {  # Two corners, and the colour
        "floor": ([-2.2, -0.2, -3.2], [2.2, 0, 3.2], pale),
        "ceiling": ([-2.2, 2.5, -3.2], [2.2, 2.7, 3.2], pale),
        "back": ([-2.2, 0, -3.2], [2.2, 2.5, -3], pale),
        "behind": ([-2.2, 0, 3], [2.2, 2.5, 3.2], green),
        "right": ([2, 0, -3], [2.2, 2.5, 3], red),
        "sill": ([-2.2, 0, -3], [-2, 0.8, 3], pale),
        "lintel": ([-2.2, 2, -3], [-2, 2.5, 3], pale),
        "near": ([-2.2, 0.8, 0.5], [-2, 2, 3], pale),
        "far": ([-2.2, 0.8, -3], [-2, 2, -1.5], pale),
    }
    scene: dict[str, Any] = {"type": "scene"}
    for name, (low, high, colour) in boxes.items():
        corners = np.array([low, high])
        middle, half = corners.mean(axis=0).tolist(), (np.diff(corners, axis=0)[0] / 2).tolist()
        bsdf = {"type": "diffuse", "reflectance": {"type": "rgb", "value": colour}}
        scene[name] = {"type": "cube", "to_world": T().translate(middle).scale(half), "bsdf": bsdf}
    scene["ball"] = {"type": "sphere", "center": [0, 0.6, -1], "radius": 0.6, "bsdf": material(case.material)}
    camera = {"fov": 60.0, "fov_axis": "x", "to_world": T().look_at([1.6, 1.4, 2.6], [-0.4, 0.9, -1.2], [0, 1, 0])}
    return {**scene, **_cameras(camera, suite.size)}, T()


def _matrix(transform: Any) -> Any:
    """A transform of a loaded plugin as one that a dictionary takes."""
    return mi.ScalarTransform4f(transform.matrix.numpy().reshape(4, 4))


def _cameras(camera: dict[str, Any], size: tuple[int, int]) -> dict[str, Any]:
    """The same camera with every sampler. Errors of pixels are independent under a box filter."""
    film = {
        "type": "hdrfilm",
        "width": size[0],
        "height": size[1],
        "pixel_format": "rgb",
        "component_format": "float32",
        "rfilter": {"type": "box"},
    }
    return {
        f"camera_{name}": {"type": "perspective", **camera, "film": film, "sampler": {"type": name}}
        for name in SAMPLERS
    }
