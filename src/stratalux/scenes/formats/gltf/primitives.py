"""The triangles of glTF's meshes, and what their corners have: topologies, attributes and morph targets.

Source: Khronos Group, "glTF 2.0 Specification", section 3.7.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...model import Floats, Indices, Material, Part
from ...polygons import fan, strip
from .accessors import array, normalised, whole
from .container import Document
from .draco import Decoded, is_compressed
from .skins import skinned

TRIANGLES, STRIP, FAN = 4, 5, 6


def is_surface(primitive: dict[str, Any]) -> bool:
    """Whether a primitive has triangles, and not points or lines, and positions for them."""
    return primitive.get("mode", TRIANGLES) in (TRIANGLES, STRIP, FAN) and "POSITION" in primitive["attributes"]


def part(
    document: Document,
    primitive: dict[str, Any],
    weights: Sequence[float],
    joints: Floats | None,
    material: Material | None = None,
    name: str = "",
) -> Part:
    """The triangles of a surface of a `material`, with its morph targets by their `weights`.

    `joints` (J, 4, 4): for a mesh with a skin the matrices from its own coordinates to the scene, one for each joint.
    """
    attributes = primitive["attributes"]
    packed = Decoded(document, primitive) if is_compressed(document, primitive) else None
    targets = [
        (target, weight) for target, weight in zip(primitive.get("targets", []), weights, strict=False) if weight
    ]
    count: int | None = None

    def values(name: str, *sizes: int) -> Any:
        """The values (V, n) of an attribute, n being one of the `sizes`, in their own type; None where it has none."""
        if name not in attributes:
            return None
        unpacked = packed.attribute(name) if packed else None
        found = array(document, attributes[name], *sizes) if unpacked is None else unpacked
        if found.shape[1] not in sizes:
            raise ValueError(f"{name} has {found.shape[1]} numbers, not {' or '.join(map(str, sizes))}")
        if count is not None and len(found) != count:
            raise ValueError(f"{name} has {len(found)} elements, not {count}")
        # Whole numbers mean no colours, though some files forget to mark them as fractions.
        return normalised(found, name == "COLOR_0")

    def posed(name: str, *sizes: int) -> Any:
        """The values of an attribute in double precision, with the displacements of the morph targets."""
        stored = values(name, *sizes)
        if stored is None:
            return None
        with np.errstate(invalid="ignore"):  # of numbers that are none
            found = stored.astype(np.float64)
        for target, weight in targets:
            if name in target:
                added = array(document, target[name], *((3,) if name == "TANGENT" else sizes))
                if len(added) != len(found):
                    raise ValueError(f"a morph target has {len(added)} elements of {name}, not {len(found)}")
                with np.errstate(all="ignore"):
                    found[:, : added.shape[1]] += weight * added
        return found

    positions: Floats = posed("POSITION", 3)
    count = len(positions)
    normals, tangents = posed("NORMAL", 3), posed("TANGENT", 4)
    faces = packed.triangles if packed else _faces(document, primitive, len(positions))
    if faces.size and faces.max() >= len(positions):
        raise ValueError(f"a face refers to vertex {faces.max()} of {len(positions)}")
    if joints is not None and "JOINTS_0" in attributes:
        influences = [name[7:] for name in sorted(attributes) if name.startswith("JOINTS_")]
        indices = np.concatenate([whole(values(f"JOINTS_{n}", 4)) for n in influences], axis=1)
        with np.errstate(all="ignore"):
            shares = np.concatenate([values(f"WEIGHTS_{n}", 4) for n in influences], axis=1).astype(np.float64)
            positions, normals, tangents, mirrored = skinned(positions, normals, tangents, indices, shares, joints)
        faces = faces[:, ::-1] if mirrored else faces
    uvs = {int(name[9:]): posed(name, 2) for name in attributes if re.fullmatch(r"TEXCOORD_\d+", name)}
    colours = _colours(posed("COLOR_0", 3, 4))
    # Section 3.7.2.1: flat where there are no normals.
    return Part(positions, faces, normals, uvs, colours, tangents, material, name, flat=True)


def _colours(found: Floats | None) -> Floats | None:
    """Colours (V, 4) of those (V, 3 or 4) that a primitive has."""
    if found is None:
        return None
    return np.clip(np.pad(found, [(0, 0), (0, 4 - found.shape[1])], constant_values=1.0), 0.0, None)


def _faces(document: Document, primitive: dict[str, Any], vertices: int) -> Indices:
    """The triangles (T, 3) of a primitive that is not compressed."""
    if "indices" in primitive:
        indices = whole(array(document, primitive["indices"], 1))[:, 0]
    else:
        indices = np.arange(vertices)
    mode = primitive.get("mode", TRIANGLES)
    if mode == TRIANGLES:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    triangles: Indices = indices[(strip if mode == STRIP else fan)(len(indices))]
    return triangles
