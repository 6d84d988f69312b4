"""Putting one object on a ground, under an environment map, in front of a camera that fits it."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import numpy.typing as npt

from ..errors import InputError
from .mesh import TriangleMesh

SAMPLERS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")

AZIMUTH_DEGREES = 30.0
ELEVATION_DEGREES = 17.0
FIELD_OF_VIEW_DEGREES = 30.0
"""Along the shorter side of the film."""

MARGIN = 0.08
"""The part of the film's width and height that stays free on either side of the object."""

GROUND_REFLECTANCE = 0.4
GROUND_RADIUS = 100.0
"""In units of half the object's diagonal: the edge is so close to the horizon that it looks like one."""


def to_mitsuba(mesh: TriangleMesh, bsdf: dict[str, Any], name: str) -> mi.Mesh:
    """The mesh as a Mitsuba shape called `name` with the BSDF of dictionary `bsdf`.

    Needs a variant to be set; the first one of a process has to be made on the main thread.
    """
    props = mi.Properties()
    props.set_id(name)
    props["bsdf"] = mi.load_dict(bsdf)
    shape = mi.Mesh(
        name,
        vertex_count=len(mesh.vertices),
        face_count=len(mesh.faces),
        has_vertex_normals=mesh.normals is not None,
        has_vertex_texcoords=False,
        props=props,
    )
    params = mi.traverse(shape)
    params["vertex_positions"] = mesh.vertices.ravel()
    params["faces"] = mesh.faces.ravel()
    if mesh.normals is not None:
        params["vertex_normals"] = mesh.normals.ravel()
    params.update()
    return shape


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
        "sensor": {
            "type": "perspective",
            "fov": FIELD_OF_VIEW_DEGREES,
            "fov_axis": "smaller",
            "to_world": mi.ScalarTransform4f(camera_frame(placed.vertices, width / height).tolist()),
            "film": {
                "type": "hdrfilm",
                "width": width,
                "height": height,
                "pixel_format": "rgb",
                "component_format": "float16",
                "rfilter": {"type": "gaussian"},
            },
            "sampler": {"type": sampler, "sample_count": spp},
        },
        "object": to_mitsuba(placed, material, "object"),
        "emitter": emitter,
    }
    if ground:
        # A hair below y = 0, so that an object with a flat bottom does not fight with it for visibility.
        flat = mi.ScalarTransform4f().translate([0, -1e-4, 0]).rotate([1, 0, 0], -90).scale(GROUND_RADIUS)
        scene["ground"] = {
            "type": "disk",
            "to_world": flat,
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": GROUND_REFLECTANCE}},
        }
    return scene


def standing(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh scaled to a bounding box diagonal of 2, centred in x and z, with its lowest point at y = 0."""
    low, high = mesh.bounds.astype(np.float64)
    scale = 2 / np.linalg.norm(high - low)
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = -scale * np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return mesh.transformed(matrix)


def camera_frame(points: npt.ArrayLike, aspect: float) -> npt.NDArray[np.float64]:
    """The (4, 4) camera-to-world matrix of the closest camera that has all (N, 3) `points` in its frame.

    Columns are left, up, forward (Mitsuba's camera axes) and position; `aspect` is width over height.
    The direction of view is fixed. In camera coordinates a point (x, y, z) lies in the frame of a camera
    at (cx, cy, cz) if |x - cx| <= tx (z - cz), and the same for y. The interval that this leaves for cx is
    [max(x - tx z) + tx cz, min(x + tx z) - tx cz]: it is not empty up to a largest cz, which is taken.
    Within the interval, cx makes the free borders on both sides equal.
    """
    azimuth, elevation = np.radians([AZIMUTH_DEGREES, ELEVATION_DEGREES])
    forward = -np.array([np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)])
    left = np.cross([0, 1, 0], forward)
    left /= np.linalg.norm(left)
    axes = np.stack([left, np.cross(forward, left), forward], axis=1)

    shorter = np.tan(np.radians(FIELD_OF_VIEW_DEGREES) / 2) * (1 - 2 * MARGIN)
    slope = shorter * np.array([max(aspect, 1), max(1 / aspect, 1)])
    seen = axes.T @ np.asarray(points, dtype=np.float64).T
    lowest = np.max(seen[:2] - slope[:, None] * seen[2], axis=1)
    highest = np.min(seen[:2] + slope[:, None] * seen[2], axis=1)
    depth = np.min((highest - lowest) / (2 * slope))
    low, high = lowest + slope * depth, highest - slope * depth
    distance = seen[2] - depth
    # Moving the camera one way moves all of the image the other way: halve the interval until centred.
    for _ in range(24):
        centre = (low + high) / 2
        image = (seen[:2] - centre[:, None]) / distance
        further = image.max(axis=1) + image.min(axis=1) > 0
        low, high = np.where(further, centre, low), np.where(further, high, centre)
    frame = np.eye(4)
    frame[:3, :3] = axes
    frame[:3, 3] = axes @ np.array([*(low + high) / 2, depth])
    return frame
