"""The paper's scenes: Grace Cathedral, the Utah teapot and the Happy Buddha, on the package's stage."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import mitsuba as mi
import numpy as np
import trimesh
from numpy.typing import NDArray

from ..assets import Assets
from ..maps.envmap import EnvironmentMap
from ..maps.geometry import texel_solid_angle
from ..scenes.load import envmap
from ..scenes.materials import material
from ..scenes.mesh import TriangleMesh
from ..scenes.shapes import load_mesh
from ..scenes.stage import stage
from ..scenes.surroundings import GROUND_REFLECTANCE
from .settings import Settings
from .view import View

FLIP = 180.0
"""Degrees about the x axis: the map's file is upside down in a scene whose y axis points up."""
GROUND_LUMINANCE = 0.2
"""The map is scaled until open ground has this luminance, which makes the images' mean about that."""

EXPONENT = 100
ALPHA = (2 / (EXPONENT + 2)) ** 0.5
"""Beckmann roughness 0.14, about the lobe of a Blinn-Phong exponent of 100 (Walter et al. 2007, section 5.4)."""
SHINY_ALPHA = 0.05


def _rough_metal(alpha: float) -> dict[str, Any]:
    """Cook and Torrance's microfacet metal: Beckmann's distribution, the Fresnel term of aluminium."""
    metal = {"type": "roughconductor", "distribution": "beckmann", "alpha": alpha, "material": "Al"}
    return {"type": "twosided", "bsdf": metal}


MATERIALS: dict[str, dict[str, Any]] = {
    "diffuse": material("diffuse"),
    "glossy": _rough_metal(ALPHA),
    "shiny": _rough_metal(SHINY_ALPHA),
}


@dataclass(frozen=True)
class Subject:
    """A mesh in a material of :data:`MATERIALS`, each of its triangles cut into four ``subdivisions`` times."""

    mesh: str
    material: str = "diffuse"
    subdivisions: int = 0


@dataclass(frozen=True)
class Frame:
    """From where: an image of ``size`` (width, height), ``grid`` x ``grid`` camera rays in each pixel.

    ``crop``: left, top, right and bottom of the part that is rendered, in pixels.
    """

    subject: Subject
    size: tuple[int, int]
    grid: int = 1
    crop: tuple[int, int, int, int] | None = None

    @property
    def lanes(self) -> int:
        """Camera rays."""
        left, top, right, bottom = self.crop or (0, 0, *self.size)
        return (right - left) * (bottom - top) * self.grid**2


class Workbench:
    """What the items share: settings, the map, and scenes, which are loaded only when something has to be computed."""

    def __init__(self, settings: Settings, assets: Assets) -> None:
        self.settings, self.assets = settings, assets
        self._digest = lru_cache(maxsize=None)(self._read_digest)
        self._mesh = lru_cache(maxsize=None)(self._load_mesh)
        # Only the scenes in use: that of the subdivided mesh is large.
        self.view = lru_cache(maxsize=2)(self._view)

    @cached_property
    def environment(self) -> EnvironmentMap:
        """Grace Cathedral, as in its file."""
        return EnvironmentMap.load(self.assets.require("grace"))

    @cached_property
    def scale(self) -> float:
        """Factor on the map's radiance that gives open ground its luminance: ρ E / π = 0.2."""
        height, width = self.environment.height, self.environment.width
        below = np.maximum(-np.cos(np.linspace(0, np.pi, height)), 0)[:, None]  # what the flip puts above the ground
        light = self.environment.luminance * texel_solid_angle(height, width) * below
        irradiance = float(light.sum(dtype=np.float64))
        return GROUND_LUMINANCE * np.pi / (GROUND_REFLECTANCE * irradiance) if irradiance > 0 else 1.0

    def to_world(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Directions (N, 3) of the map's frame in that of the scenes: the flip."""
        return directions * [1, -1, -1]

    def files(self, *names: str) -> dict[str, str]:
        """SHA-256 of the named asset files: part of the key of every step that depends on them."""
        return {name: self._digest(name) for name in names}

    def triangles(self, name: str) -> int:
        """Number of triangles of a mesh as it is in its file."""
        return len(self._mesh(name).faces)

    def fingerprint(self, frame: Frame) -> dict[str, Any]:
        """What an image of ``frame`` depends on, apart from the technique."""
        subject = frame.subject
        return {
            "files": self.files("grace", subject.mesh),
            "material": MATERIALS[subject.material],
            "subdivisions": subject.subdivisions,
            "frame": [frame.size, frame.grid, frame.crop],
        }

    def _read_digest(self, name: str) -> str:
        return hashlib.sha256(self.assets.require(name).read_bytes()).hexdigest()

    def _load_mesh(self, name: str) -> TriangleMesh:
        return load_mesh(self.assets.require(name))

    def _view(self, frame: Frame) -> View:
        subject = frame.subject
        mesh = self._mesh(subject.mesh)
        if subject.subdivisions:
            mesh = subdivided(mesh, subject.subdivisions)
        emitter = envmap(self.environment) | {
            "scale": self.scale,
            "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], FLIP),
        }
        scene = mi.load_dict(stage(mesh, MATERIALS[subject.material], emitter, frame.size))
        return View(scene, frame.size, frame.grid, frame.crop)


def subdivided(mesh: TriangleMesh, times: int) -> TriangleMesh:
    """Each triangle cut into four, ``times`` times: the same surface, at another cost."""
    vertices, faces, attributes = mesh.vertices, mesh.faces, {}
    if mesh.normals is not None:
        attributes["normals"] = mesh.normals
    for _ in range(times):
        vertices, faces, attributes = trimesh.remesh.subdivide(vertices, faces, vertex_attributes=attributes)
    normals = attributes.get("normals")
    if normals is not None:
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return TriangleMesh(vertices, faces, normals)
