"""Putting one object on a ground, under an environment map, in front of a camera that fits it."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import numpy.typing as npt

from ..errors import InputError
from .assembly import to_mitsuba
from .camera import sensor
from .mesh import TriangleMesh
from .settings import CameraSettings

SAMPLERS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")

GROUND_REFLECTANCE = 0.4
GROUND_RADIUS = 100.0
"""In units of half the object's diagonal: the edge is so close to the horizon that it looks like one."""


def stage(
    mesh: TriangleMesh,
    material: dict[str, Any],
    emitter: object,
    size: tuple[int, int] = (600, 400),
    spp: int = 64,
    ground: bool = True,
    sampler: str = "independent",
) -> dict[str, Any]:
    """A Mitsuba scene dictionary, without an integrator, that shows `mesh` from slightly above.

    The mesh is centred, scaled to a diagonal of 2 and stood on y = 0. `material` is a BSDF dictionary,
    `emitter` a dictionary or a Mitsuba emitter, `size` the (width, height) of the film in pixels, `spp`
    the samples per pixel, `sampler` a Mitsuba sampler. `ground` puts a matte plane under the object.
    Raises InputError for a size, a sample count or a sampler that Mitsuba cannot render with.
    """
    width, height = size
    if width < 1 or height < 1:
        raise InputError(f"size {width}x{height}: width and height must be at least 1 pixel")
    if spp < 1:
        raise InputError(f"spp {spp}: there must be at least 1 sample per pixel")
    if sampler not in SAMPLERS:
        raise InputError(f"sampler '{sampler}' is unknown; use one of {', '.join(SAMPLERS)}")

    placed = standing(mesh)
    scene: dict[str, Any] = {
        "type": "scene",
        "sensor": sensor(CameraSettings(), placed.vertices, (), size, spp, sampler),
        "object": to_mitsuba(placed, material, "object"),
        "emitter": emitter,
    }
    if ground:
        scene["ground"] = matte_ground(placed.bounds)
    return scene


def matte_ground(bounds: npt.ArrayLike) -> dict[str, Any]:
    """A grey disk, as a dictionary, below what has these `bounds` (2, 3)."""
    low, high = np.asarray(bounds, dtype=np.float64)
    half = float(np.linalg.norm(high - low) / 2)
    # A hair below, so that an object with a flat bottom does not fight with it for visibility.
    middle = [(low[0] + high[0]) / 2, low[1] - 1e-4 * half, (low[2] + high[2]) / 2]
    flat = mi.ScalarTransform4f().translate(middle).rotate([1, 0, 0], -90).scale(GROUND_RADIUS * half)
    reflectance = {"type": "rgb", "value": GROUND_REFLECTANCE}
    return {"type": "disk", "to_world": flat, "bsdf": {"type": "diffuse", "reflectance": reflectance}}


def standing(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh scaled to a bounding box diagonal of 2, centred in x and z, with its lowest point at y = 0."""
    low, high = mesh.bounds.astype(np.float64)
    scale = 2 / np.linalg.norm(high - low)
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = -scale * np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return mesh.transformed(matrix)
