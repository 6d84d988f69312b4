"""glTF 2.0, .glb and .gltf: all triangles of a scene, with the morph targets and the skins as the file poses them."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from ....errors import SceneWarning
from ...model import Instance, Model, Part
from .container import Document, item
from .nodes import Nodes
from .primitives import is_surface, part


def read(path: Path) -> Model:
    """The shapes of the default scene. Primitives of a mesh that several nodes show are read once."""
    document = Document(path)
    nodes = Nodes(document)
    meshes = document.list("meshes")
    parts: list[Part] = []
    instances: list[Instance] = []
    known: dict[tuple[object, ...], list[int]] = {}
    left_out = 0
    for index in nodes.shown():
        node = document.list("nodes")[index]
        if "mesh" not in node:
            continue
        mesh = item(meshes, node["mesh"])
        weights = tuple(node.get("weights") or mesh.get("weights") or ())
        surfaces = [primitive for primitive in mesh["primitives"] if is_surface(primitive)]
        skin = node.get("skin") if all("JOINTS_0" in surface["attributes"] for surface in surfaces) else None
        key = (node["mesh"], weights, skin)
        if key not in known:
            left_out += len(mesh["primitives"]) - len(surfaces)
            joints = None if skin is None else nodes.joints(skin)
            known[key] = list(range(len(parts), len(parts) + len(surfaces)))
            parts += [part(document, surface, weights, joints) for surface in surfaces]
        # A skin says by itself where its mesh stands.
        places = nodes.instances(index) if skin is None else [np.eye(4)]
        instances += [Instance(which, matrix) for matrix in places for which in known[key]]
    if left_out:
        warnings.warn(
            f"{path}: {left_out} primitives are left out, which are points or lines, or have no positions",
            SceneWarning,
            stacklevel=2,
        )
    return Model(parts, instances)
