"""Meshes that follow the joints of a skin.

Source: Khronos Group, "glTF 2.0 Specification", section 3.7.3.
"""

from __future__ import annotations

import numpy as np

from ...model import Floats, Indices


def skinned(
    positions: Floats,
    normals: Floats | None,
    tangents: Floats | None,
    indices: Indices,
    shares: Floats,
    joints: Floats,
) -> tuple[Floats, Floats | None, Floats | None, bool]:
    """Positions, normals and tangents in the scene, and whether the joints mirror: linear blend skinning.

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
    if tangents is not None:
        along = np.einsum("vij,vj->vi", linear, tangents[:, :3])
        signs = tangents[:, 3] * np.where(determinants < 0, -1, 1)  # a mirror turns the bitangent around
        tangents = np.column_stack([along, signs])
    mirrored = bool(np.median(determinants, axis=0) < 0) if len(determinants) else False
    return positions, normals, tangents, mirrored
