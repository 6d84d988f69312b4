"""Putting one object on a ground, under an environment map, in front of a camera that fits it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InputError
from .assembly import to_mitsuba
from .camera import sensor
from .mesh import TriangleMesh
from .settings import CameraSettings
from .surroundings import ground as ground_below

SAMPLERS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")


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
        scene["ground"] = ground_below("matte", placed.bounds)
    return scene


def standing(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh scaled to a bounding box diagonal of 2, centred in x and z, with its lowest point at y = 0."""
    low, high = mesh.bounds.astype(np.float64)
    scale = 2 / np.linalg.norm(high - low)
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = -scale * np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return mesh.transformed(matrix)
