"""The triangles of glTF's meshes: topologies, morph targets and skins.

Source: Khronos Group, "glTF 2.0 Specification", section 3.7.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...model import Floats, Indices, Part
from ...polygons import fan, strip
from .accessors import array
from .container import Document
from .draco import Decoded, is_compressed

TRIANGLES, STRIP, FAN = 4, 5, 6


def is_surface(primitive: dict[str, Any]) -> bool:
    """Whether a primitive has triangles, and not points or lines, and positions for them."""
    return primitive.get("mode", TRIANGLES) in (TRIANGLES, STRIP, FAN) and "POSITION" in primitive["attributes"]


def part(document: Document, primitive: dict[str, Any], weights: Sequence[float], joints: Floats | None) -> Part:
    """The triangles of a surface, with its morph targets by their `weights`.

    `joints` (J, 4, 4): for a mesh with a skin the matrices from its own coordinates to the scene, one for each joint.
    """
    attributes = primitive["attributes"]
    packed = Decoded(document, primitive) if is_compressed(document, primitive) else None

    def values(name: str, size: int) -> Any:
        if name not in attributes:
            return None
        unpacked = packed.attribute(name) if packed else None
        found = array(document, attributes[name], size) if unpacked is None else unpacked
        if found.shape[1] != size:
            raise ValueError(f"{name} has {found.shape[1]} numbers, not {size}")
        return found

    positions: Floats = values("POSITION", 3).astype(np.float64)
    stored = values("NORMAL", 3)
    normals: Floats | None = None if stored is None else stored.astype(np.float64)
    faces = packed.triangles if packed else _faces(document, primitive, len(positions))
    if faces.size and faces.max() >= len(positions):
        raise ValueError(f"a face refers to vertex {faces.max()} of {len(positions)}")
    positions, normals = _morphed(document, primitive, weights, positions, normals)
    if joints is not None and "JOINTS_0" in attributes:
        influences = [name[7:] for name in sorted(attributes) if name.startswith("JOINTS_")]
        indices = np.concatenate([values(f"JOINTS_{n}", 4) for n in influences], axis=1).astype(np.int64)
        shares = np.concatenate([values(f"WEIGHTS_{n}", 4) for n in influences], axis=1).astype(np.float64)
        positions, normals, mirrored = _skinned(positions, normals, indices, shares, joints)
        faces = faces[:, ::-1] if mirrored else faces
    return Part(positions, faces, normals)


def _faces(document: Document, primitive: dict[str, Any], vertices: int) -> Indices:
    """The triangles (T, 3) of a primitive that is not compressed."""
    if "indices" in primitive:
        indices = array(document, primitive["indices"], 1)[:, 0].astype(np.int64)
    else:
        indices = np.arange(vertices)
    mode = primitive.get("mode", TRIANGLES)
    if mode == TRIANGLES:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    triangles: Indices = indices[(strip if mode == STRIP else fan)(len(indices))]
    return triangles


def _morphed(
    document: Document, primitive: dict[str, Any], weights: Sequence[float], positions: Floats, normals: Floats | None
) -> tuple[Floats, Floats | None]:
    """Positions and normals with the displacements of the morph targets."""
    for target, weight in zip(primitive.get("targets", []), weights, strict=False):
        if weight and "POSITION" in target:
            positions = positions + weight * array(document, target["POSITION"], 3)
        if weight and normals is not None and "NORMAL" in target:
            normals = normals + weight * array(document, target["NORMAL"], 3)
    return positions, normals


def _skinned(
    positions: Floats, normals: Floats | None, indices: Indices, shares: Floats, joints: Floats
) -> tuple[Floats, Floats | None, bool]:
    """Positions and normals in the scene, and whether the joints mirror: linear blend skinning.

    `indices` and `shares` (V, K): the joints of each vertex, and their weights.
    """
    total = shares.sum(axis=1, keepdims=True)
    shares = np.where(total > 0, shares / np.where(total > 0, total, 1), 0)
    if np.any((indices < 0) | (indices >= len(joints)) & (shares != 0)):
        raise ValueError(f"a vertex refers to a joint beyond the {len(joints)} of its skin")
    blended = np.zeros((len(positions), 3, 4))
    for index, share in zip(np.minimum(indices, len(joints) - 1).T, shares.T, strict=True):
        blended += share[:, None, None] * joints[index, :3]
    linear, offset = blended[:, :, :3], blended[:, :, 3]
    positions = np.einsum("vij,vj->vi", linear, positions) + offset
    determinants = np.linalg.det(linear)
    if normals is not None:
        # Times its determinant, the inverse transpose is the matrix of cofactors, which exists for every matrix.
        rows = [linear[:, row] for row in range(3)]
        cofactors = np.stack([np.cross(rows[row - 2], rows[row - 1]) for row in range(3)], axis=1)
        normals = np.einsum("vij,vj->vi", cofactors, normals) * np.where(determinants < 0, -1, 1)[:, None]
    return positions, normals, bool(np.median(determinants, axis=0) < 0) if len(determinants) else False
