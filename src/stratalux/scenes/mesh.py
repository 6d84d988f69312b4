"""Triangle meshes, and shading normals for those that have none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from .normals import CREASE_DEGREES, smooth_normals, unit


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """An indexed triangle mesh, counter-clockwise seen from outside.

    `vertices` (V, 3) float32 positions, `faces` (F, 3) uint32 indices into them, `normals` (V, 3) float32
    unit shading normals or None for flat shading. Other dtypes are converted. `attributes` (V, K): what else there is
    of each vertex, by names. Raises InputError when the shapes do not fit together or an index points outside
    `vertices`.
    """

    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]
    normals: npt.NDArray[np.float32] | None = None
    attributes: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, dtype in (("vertices", np.float32), ("faces", np.uint32), ("normals", np.float32)):
            if getattr(self, name) is None:
                continue
            array = np.ascontiguousarray(getattr(self, name), dtype=dtype)
            if array.ndim != 2 or array.shape[1] != 3:
                raise InputError(f"mesh: {name} has shape {array.shape}; give it as (N, 3)")
            object.__setattr__(self, name, array)
        count = len(self.vertices)
        named = {"normals": self.normals, **self.attributes}
        for name, values in named.items():
            if values is not None and len(values) != count:
                raise InputError(f"mesh: {len(values)} {name} for {count} vertices; give one per vertex")
        if self.faces.size and self.faces.max() >= count:
            raise InputError(f"mesh: a face refers to a vertex outside 0..{count - 1}; repair the mesh")

    @property
    def bounds(self) -> npt.NDArray[np.float32]:
        """The lowest and the highest corner of the axis-aligned bounding box, (2, 3)."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    def transformed(self, matrix: npt.ArrayLike) -> TriangleMesh:
        """The mesh under an affine (4, 4) `matrix`; one that mirrors also reverses the winding."""
        matrix = np.asarray(matrix, dtype=np.float64)
        linear = matrix[:3, :3]
        if np.array_equal(linear, np.eye(3)):
            return replace(self, vertices=(self.vertices + matrix[:3, 3]).astype(np.float32))
        normals = self.normals
        if normals is not None:
            # Normals go with the inverse transpose: they still point outwards under a reflection.
            normals = unit(normals @ np.linalg.pinv(linear)).astype(np.float32)
        faces = self.faces[:, ::-1] if np.linalg.det(linear) < 0 else self.faces
        vertices = (self.vertices @ linear.T + matrix[:3, 3]).astype(np.float32)
        return replace(self, vertices=vertices, faces=faces, normals=normals)

    def only(self, chosen: npt.NDArray[np.bool_]) -> TriangleMesh:
        """The mesh with those of its faces (F,) that are `chosen`, and their vertices."""
        used, index = np.unique(self.faces[chosen], return_inverse=True)
        return TriangleMesh(
            self.vertices[used],
            index.reshape(-1, 3).astype(np.uint32),
            None if self.normals is None else self.normals[used],
            {name: values[used] for name, values in self.attributes.items()},
        )


def smooth_shaded(mesh: TriangleMesh, crease_degrees: float = CREASE_DEGREES) -> TriangleMesh:
    """The mesh with new shading normals: smooth, but split where an edge bends more than `crease_degrees`.

    Vertices at the same place count as one, so that a triangle soup comes out smooth too. Corners around
    a vertex share a normal (the mean of their faces', weighted by the corner angles) when they are
    connected through smooth edges; each such group becomes one vertex of the result, or several where vertices at one
    place have different attributes.
    """
    index, faces, normals = smooth_normals(mesh.vertices, mesh.faces, crease_degrees)
    if mesh.attributes:
        corners = np.stack([mesh.faces.ravel().astype(np.int64), faces.ravel()])
        (index, at), faces = _pairs(corners)
        normals = normals[at]
    return TriangleMesh(
        mesh.vertices[index],
        faces.astype(np.uint32),
        normals.astype(np.float32),
        {name: values[index] for name, values in mesh.attributes.items()},
    )


def _pairs(corners: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """The different pairs (2, V) among those of the `corners` (2, 3F), and which one each corner has, (F, 3)."""
    key = corners[0] * (corners[1].max(initial=0) + 1) + corners[1]
    _, first, index = np.unique(key, return_index=True, return_inverse=True)
    return corners[:, first], index.reshape(-1, 3)
