"""Where things stand in a glTF scene: the tree of nodes, instances, and the poses of skins.

Sources: Khronos Group, "glTF 2.0 Specification", sections 3.5 and 3.7.3; "EXT_mesh_gpu_instancing" and
"KHR_node_visibility".
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from ....errors import InputError, SceneWarning
from ...model import Floats
from .accessors import array
from .container import Document, item
from .extensions import shortened


class Nodes:
    """The nodes of a document: `matrices` (4, 4) from the coordinates of each node to the scene, by their indices."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._nodes = document.list("nodes")
        children = [child for node in self._nodes for child in node.get("children", [])]
        if len(set(children)) < len(children):
            raise InputError(f"{document.path}: a node has two parents; export it again")
        self.matrices: dict[int, Floats] = {}
        waiting: list[tuple[int, Floats]] = [
            (index, np.eye(4)) for index in set(range(len(self._nodes))) - set(children)
        ]
        while waiting:
            index, parent = waiting.pop()
            node = item(self._nodes, index)
            with np.errstate(all="ignore"):  # a place that is none is refused where it is shown
                self.matrices[index] = parent @ _local(node)
            waiting += [(child, self.matrices[index]) for child in node.get("children", [])]

    def shown(self) -> list[int]:
        """The indices of the nodes that the default scene shows."""
        found: list[int] = []
        waiting = list(reversed(self._roots()))
        while waiting:
            index = waiting.pop()
            if index not in self.matrices:
                raise InputError(f"{self._document.path}: a node is its own ancestor, or is missing; export it again")
            node = self._nodes[index]
            if node.get("extensions", {}).get("KHR_node_visibility", {}).get("visible", True):
                found.append(index)
                self._checked(self.matrices[index])
                self._document.left_out.extensions_of(self._nodes[index])
                waiting += reversed(node.get("children", []))
        return found

    def instances(self, index: int) -> list[Floats]:
        """The matrices (4, 4) of all instances of a node's mesh: its own, or those that stand in a table."""
        table = self._nodes[index].get("extensions", {}).get("EXT_mesh_gpu_instancing", {}).get("attributes", {})
        columns = {
            name: array(self._document, table[name], size).astype(np.float64)
            for name, size in (("TRANSLATION", 3), ("ROTATION", 4), ("SCALE", 3))
            if name in table
        }
        if not columns:
            return [self.matrices[index]]
        count = min(len(column) for column in columns.values())
        with np.errstate(all="ignore"):
            local = _transforms(
                columns.get("TRANSLATION", np.zeros((count, 3)))[:count],
                columns.get("ROTATION", np.tile([0.0, 0, 0, 1], (count, 1)))[:count],
                columns.get("SCALE", np.ones((count, 3)))[:count],
            )
            return list(self._checked(self.matrices[index] @ local))

    def joints(self, skin: int) -> Floats:
        """The matrices (J, 4, 4) that take a mesh with the skin to the scene, in the pose that the nodes have."""
        found = item(self._document.list("skins"), skin)
        matrices = self._checked(np.stack([self.matrices[joint] for joint in found["joints"]]))
        if "inverseBindMatrices" not in found:
            return matrices
        inverse = array(self._document, found["inverseBindMatrices"], 16).astype(np.float64)
        with np.errstate(all="ignore"):
            return self._checked(matrices @ inverse[: len(matrices)].reshape(-1, 4, 4).transpose(0, 2, 1))  # by columns

    def _checked(self, matrices: Floats) -> Floats:
        if not np.isfinite(matrices).all():
            raise InputError(f"{self._document.path}: the place of a node is not a finite number; repair or export it")
        return matrices

    def _roots(self) -> list[int]:
        """The nodes of the default scene; those of the first where none is named, and all where there is none."""
        scenes = self._document.list("scenes")
        if not scenes:
            return sorted(set(self.matrices) - {child for node in self._nodes for child in node.get("children", [])})
        chosen = self._document.json.get("scene", 0)
        scene = item(scenes, chosen)
        self._document.left_out.extensions_of(scene)
        names = [repr(other.get("name", f"number {n}")) for n, other in enumerate(scenes) if n != chosen]
        if names:
            warnings.warn(
                f"{self._document.path}: shown is the scene {scene.get('name', f'number {chosen}')!r}; "
                f"left out: {shortened(names)}",
                SceneWarning,
                stacklevel=2,
            )
        roots: list[int] = scene.get("nodes", [])
        return roots


def _local(node: dict[str, Any]) -> Floats:
    """The matrix (4, 4) from the coordinates of a node to those of its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    defaults = {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}
    parts = (np.array([node.get(name, default)], dtype=np.float64) for name, default in defaults.items())
    transform: Floats = _transforms(*parts)[0]
    return transform


def _transforms(translations: Floats, rotations: Floats, scales: Floats) -> Floats:
    """The matrices (N, 4, 4) of translations (N, 3), quaternions (x, y, z, w) and scales (N, 3)."""
    lengths = np.linalg.norm(rotations, axis=1, keepdims=True)
    x, y, z, w = (rotations / np.where(lengths > 0, lengths, 1)).T
    matrices = np.zeros((len(translations), 4, 4))
    matrices[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1)
    matrices[:, 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1)
    matrices[:, 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1)
    matrices[:, :3, :3] *= scales[:, None]
    matrices[:, :3, 3] = translations
    matrices[:, 3, 3] = 1
    return matrices
