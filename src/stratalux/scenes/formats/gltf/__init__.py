"""glTF 2.0, .glb and .gltf: all that a scene has, in the pose, with the morph targets and the look of the file.

Animations are not played, and of several looks of a mesh (KHR_materials_variants) the file's own is shown.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import SceneWarning
from ...model import Camera, Instance, Light, Model, Part
from .container import Document, item
from .lights import camera, light
from .materials import Materials
from .nodes import Nodes, shortened
from .primitives import is_surface, part

_VARIANTS = "KHR_materials_variants"


def read(path: Path) -> Model:
    """What the default scene shows. Primitives of a mesh that several nodes show are read once."""
    document = Document(path)
    nodes, shapes = Nodes(document), _Shapes(document)
    lights: list[Light | None] = []
    cameras: list[Camera | None] = []
    for index in nodes.shown():
        node, matrix = document.list("nodes")[index], nodes.matrices[index]
        lights.append(light(document, node, matrix))
        cameras.append(camera(document, node, matrix))
        if "mesh" in node:
            shapes.add(nodes, index)
    shapes.tell()
    document.left_out.tell(path)
    return Model(
        shapes.parts,
        shapes.instances,
        [each for each in lights if each is not None],
        [each for each in cameras if each is not None],
        metres=1.0,
    )


class _Shapes:
    """The parts and the instances of the nodes that were added."""

    def __init__(self, document: Document) -> None:
        self._document, self._materials = document, Materials(document)
        self.parts: list[Part] = []
        self.instances: list[Instance] = []
        self._known: dict[tuple[object, ...], list[int]] = {}
        self._no_surfaces, self._varied = 0, False

    def add(self, nodes: Nodes, index: int) -> None:
        """The mesh of a node."""
        document = self._document
        node = document.list("nodes")[index]
        mesh = item(document.list("meshes"), node["mesh"])
        weights = tuple(node.get("weights") or mesh.get("weights") or ())
        surfaces = [primitive for primitive in mesh["primitives"] if is_surface(primitive)]
        skin = node.get("skin") if all("JOINTS_0" in surface["attributes"] for surface in surfaces) else None
        key = (node["mesh"], weights, skin)
        if key not in self._known:
            self._note(mesh, surfaces)
            joints = None if skin is None else nodes.joints(skin)
            name = str(node.get("name") or mesh.get("name") or f"mesh {node['mesh']}")
            self._known[key] = list(range(len(self.parts), len(self.parts) + len(surfaces)))
            for surface in surfaces:
                material = self._materials.material(surface.get("material"))
                self.parts.append(part(document, surface, weights, joints, material, name))
        # A skin says by itself where its mesh stands.
        places = nodes.instances(index) if skin is None else [np.eye(4)]
        self.instances += [Instance(which, matrix) for matrix in places for which in self._known[key]]

    def _note(self, mesh: dict[str, Any], surfaces: list[dict[str, Any]]) -> None:
        self._document.left_out.extensions_of(mesh, *surfaces)
        self._no_surfaces += len(mesh["primitives"]) - len(surfaces)
        self._varied |= any(_VARIANTS in surface.get("extensions", {}) for surface in surfaces)

    def tell(self) -> None:
        """Warn of what the meshes have and the parts do not."""
        path = self._document.path
        if self._no_surfaces:
            warnings.warn(
                f"{path}: {self._no_surfaces} primitives are left out, which are points or lines, or have no positions",
                SceneWarning,
                stacklevel=3,
            )
        if self._varied:
            variants = self._document.json.get("extensions", {}).get(_VARIANTS, {}).get("variants", [])
            names = [repr(str(variant.get("name", ""))) for variant in variants]
            warnings.warn(
                f"{path}: shown is the look that surfaces have by default; left out: {shortened(names)} ({_VARIANTS})",
                SceneWarning,
                stacklevel=3,
            )
