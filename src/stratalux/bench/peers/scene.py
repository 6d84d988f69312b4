"""The scene of a case as plain arrays, for renderers that know nothing of Mitsuba.

``scene.npz``, z-up, triangles counter-clockwise seen from outside: ``vertices`` (V, 3), ``faces`` (F, 3) and
``normals`` (V, 3) of the object, which is smooth; ``ground_vertices`` and ``ground_faces``, which is flat; ``albedo``
of the object and of the ground; ``camera`` (4, 4): columns left, up, forward and position; ``tangent``: of half the
field of view along the shorter side; ``size``: (width, height) of the film in pixels; ``threads``; ``depth``:
segments of a path, at most: 2 is direct light.

``map.exr``: the radiance, scaled, and upright with z as up. The direction d is found in column
W·(½ − atan2(d.y, d.x)/2π), as Blender has it. ``mirrored.exr``: the same in column W·atan2(d.y, d.x)/2π.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ...assets import Assets
from ...errors import InputError
from ...maps.envmap import EnvironmentMap
from ...scenes.camera import FIELD_OF_VIEW_DEGREES, camera_frame
from ...scenes.mesh import smooth_shaded
from ...scenes.shapes import load_mesh
from ...scenes.stage import standing
from ...scenes.surroundings import GROUND_RADIUS, GROUND_REFLECTANCE
from ..cases import FLIPPED, Case
from ..scenes import Setting

ALBEDO = 0.5
"""Of the material ``diffuse``."""
GROUND_HEIGHT = -1e-4
_SIDES = 1024
"""Of the polygon that stands for the ground's disk."""


def export(case: Case, setting: Setting, assets: Assets, folder: Path, depth: int) -> None:
    """Write the scene of ``case`` to ``folder``. Raises :class:`InputError` if it is no diffuse mesh on its ground."""
    if case.material != "diffuse" or not case.ground or case.scene == "matpreview":
        raise InputError(f"case {case.name}: other renderers are told of diffuse meshes on their ground only")
    mesh = standing(load_mesh(assets.require(case.scene)))
    mesh = mesh if mesh.normals is not None else smooth_shaded(mesh)
    assert mesh.normals is not None
    ground_vertices, ground_faces = _disk()
    width, height = setting.size
    camera = camera_frame(mesh.vertices, width / height)
    camera[:3] = z_up(camera[:3].T).T
    np.savez(
        folder / "scene.npz",
        vertices=z_up(mesh.vertices),
        faces=mesh.faces.astype(np.int32),
        normals=z_up(mesh.normals),
        ground_vertices=z_up(ground_vertices),
        ground_faces=ground_faces,
        albedo=np.array([ALBEDO, GROUND_REFLECTANCE]),
        camera=camera,
        tangent=np.tan(np.radians(FIELD_OF_VIEW_DEGREES) / 2),
        size=np.array(setting.size),
        depth=np.array(depth),
        threads=np.array(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1),
    )
    texels = EnvironmentMap.load(assets.require(case.map)).texels
    texels = np.float32(setting.scale) * (turned(texels) if case.map in FLIPPED else texels)
    for name, content in (("map", texels), ("mirrored", mirrored(texels))):
        mi.Bitmap(np.ascontiguousarray(content)).write(str(folder / f"{name}.exr"))


def z_up(points: NDArray[Any]) -> NDArray[Any]:
    """Points (..., 3) of a y-up world in a z-up one, turned so that a direction keeps its column of the map."""
    return np.ascontiguousarray(points[..., [2, 0, 1]])


def turned(texels: NDArray[np.float32]) -> NDArray[np.float32]:
    """A map (H, W, 3) turned by 180 degrees about x, texel by texel; W is even.

    (x, y, z) goes to (x, −y, −z): rows change their order, and the azimuth φ becomes π − φ.
    """
    return mirrored(texels[::-1])


def mirrored(texels: NDArray[np.float32]) -> NDArray[np.float32]:
    """A map (H, W, 3) in which column u, in [0, 1), is what was column ½ − u."""
    return np.roll(texels[:, ::-1], texels.shape[1] // 2, axis=1)


def _disk() -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """The ground, y-up, as a fan about its centre."""
    angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
    rim = np.stack([GROUND_RADIUS * np.sin(angle), np.zeros(_SIDES), GROUND_RADIUS * np.cos(angle)], axis=1)
    corners = np.arange(_SIDES, dtype=np.int32)
    faces = np.stack([np.full_like(corners, _SIDES), corners, (corners + 1) % _SIDES], axis=1)
    return np.add(np.vstack([rim, np.zeros(3)]), [0, GROUND_HEIGHT, 0]).astype(np.float32), faces
