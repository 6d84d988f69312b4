"""Triangle meshes: joining the parts of a file, turning them y-up, and giving them shading normals."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..errors import InputError, SceneWarning
from .formats import READERS, read_model
from .model import Floats, Model, Part
from .normals import CREASE_DEGREES, cross, smooth_normals, unit

FORMATS = tuple(READERS)

FAR = 8.0
"""A mesh whose centre is as many diagonals away from the origin is moved there: single precision would spoil it."""

# Proper rotations that take the named axis of the file to +y.
_TO_Y_UP: dict[str, tuple[tuple[int, int, int], ...]] = {
    "x": ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    "-x": ((0, 1, 0), (-1, 0, 0), (0, 0, 1)),
    "y": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-y": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "z": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "-z": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
}


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """An indexed triangle mesh, counter-clockwise seen from outside.

    `vertices` (V, 3) float32 positions, `faces` (F, 3) uint32 indices into them, `normals` (V, 3) float32
    unit shading normals or None for flat shading. Other dtypes are converted. Raises InputError when the
    shapes do not fit together or an index points outside `vertices`.
    """

    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]
    normals: npt.NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        for name, dtype in (("vertices", np.float32), ("faces", np.uint32), ("normals", np.float32)):
            if getattr(self, name) is None:
                continue
            array = np.ascontiguousarray(getattr(self, name), dtype=dtype)
            if array.ndim != 2 or array.shape[1] != 3:
                raise InputError(f"mesh: {name} has shape {array.shape}; give it as (N, 3)")
            object.__setattr__(self, name, array)
        count = len(self.vertices)
        if self.normals is not None and len(self.normals) != count:
            raise InputError(f"mesh: {len(self.normals)} normals for {count} vertices; give one per vertex")
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
        normals = self.normals
        if normals is not None:
            # Normals go with the inverse transpose: they still point outwards under a reflection.
            normals = unit(normals @ np.linalg.pinv(linear)).astype(np.float32)
        faces = self.faces[:, ::-1] if np.linalg.det(linear) < 0 else self.faces
        return TriangleMesh((self.vertices @ linear.T + matrix[:3, 3]).astype(np.float32), faces, normals)


def load_mesh(path: str | Path, up: str | None = None) -> TriangleMesh:
    """Read a mesh from a .ply, .obj, .stl, .glb, .gltf or .off file, turned so that y is up.

    All shapes of a file are joined where they stand; materials and textures are ignored. `up`
    names the axis of the file that points up ('x', 'y', 'z', '-x', '-y', '-z'); by default y, but z for
    .stl as is usual in CAD. Shading normals are those of the file, or else smooth across edges that bend
    less than `CREASE_DEGREES`. Faces without area and vertices without a face are dropped. A mesh that is `FAR` from
    the origin is centred there; :func:`read_model` tells where it was. Raises InputError for a file
    that is missing, unreadable, truncated, of another format, or without a surface.
    """
    path = Path(path)
    up = ("z" if path.suffix.lower() == ".stl" else "y") if up is None else up
    if up not in _TO_Y_UP:
        raise InputError(f"{path}: up axis '{up}' is unknown; use one of {' '.join(_TO_Y_UP)}")
    try:
        return _joined(path, read_model(path), np.array(_TO_Y_UP[up], dtype=np.float64))
    except MemoryError:
        raise InputError(f"{path}: its triangles do not fit into memory; make it smaller") from None


def smooth_shaded(mesh: TriangleMesh, crease_degrees: float = CREASE_DEGREES) -> TriangleMesh:
    """The mesh with new shading normals: smooth, but split where an edge bends more than `crease_degrees`.

    Vertices at the same place count as one, so that a triangle soup comes out smooth too. Corners around
    a vertex share a normal (the mean of their faces', weighted by the corner angles) when they are
    connected through smooth edges; each such group becomes one vertex of the result.
    """
    index, faces, normals = smooth_normals(mesh.vertices, mesh.faces, crease_degrees)
    return TriangleMesh(mesh.vertices[index], faces.astype(np.uint32), normals.astype(np.float32))


def _joined(path: Path, model: Model, turn: Floats) -> TriangleMesh:
    """All instances of a model as one mesh, turned by a (3, 3) rotation. `path` is what errors speak of."""
    known: dict[tuple[int, bytes], tuple[TriangleMesh | None, Floats]] = {}
    shapes: list[TriangleMesh] = []
    places: list[Floats] = []
    replaced = 0
    for instance in model.instances:
        linear = turn @ instance.matrix[:3, :3]
        # Creases and shading normals depend on angles: a map that changes these comes before them.
        before, after = (np.eye(3), linear) if _keeps_angles(linear) else (linear, np.eye(3))
        key = (instance.part, before.tobytes())
        if key not in known:
            shape, centre, count = _shape(path, model.parts[instance.part], before)
            known[key] = shape, centre
            replaced += count
        shape, centre = known[key]
        if shape is not None:
            places.append(after @ centre + turn @ instance.matrix[:3, 3])
            shapes.append(shape.transformed(np.block([[after, np.zeros((3, 1))], [np.eye(4)[3:]]])))
    if replaced:
        warnings.warn(
            f"{path}: the normals of {replaced} faces are not usable; they are computed from the faces",
            SceneWarning,
            stacklevel=3,
        )
    if not shapes:
        raise InputError(f"{path}: the mesh has zero extent (no face has an area); export it again")
    firsts = np.cumsum([0] + [len(shape.vertices) for shape in shapes])
    if firsts[-1] > np.iinfo(np.uint32).max:
        raise InputError(f"{path}: {firsts[-1]} vertices are too many for one mesh; make it smaller")
    bounds = np.array([shape.bounds + place for shape, place in zip(shapes, places, strict=True)])
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    centre = (low + high) / 2
    origin = centre if np.abs(centre).max() > FAR * np.linalg.norm(high - low) else np.zeros(3)
    with np.errstate(over="ignore"):
        vertices = [(s.vertices + (place - origin)).astype(np.float32) for s, place in zip(shapes, places, strict=True)]
    mesh = TriangleMesh(
        np.concatenate(vertices),
        np.concatenate([shape.faces + np.uint32(first) for shape, first in zip(shapes, firsts, strict=False)]),
        np.concatenate([shape.normals for shape in shapes if shape.normals is not None]),
    )
    if not np.isfinite(mesh.vertices).all():
        raise InputError(f"{path}: a vertex is not a finite float32 number; repair the mesh")
    return mesh


def _shape(path: Path, part: Part, linear: Floats) -> tuple[TriangleMesh | None, Floats, int]:
    """A part under a linear map (3, 3), without faces that have no area, moved so that its centre is the origin.

    Returns it with normals (None where nothing is left), where its centre was, and how many faces have normals in the
    file that are not usable.
    """
    with np.errstate(all="ignore"):
        vertices = part.vertices @ linear.T
        points = vertices[part.faces]
        faces = part.faces[np.any(cross(points) != 0, axis=1)]
    if not np.isfinite(points).all():
        raise InputError(f"{path}: a vertex is not a finite float32 number; repair the mesh")
    if not len(faces):
        return None, np.zeros(3), 0
    used, index = np.unique(faces, return_inverse=True)
    triangles: npt.NDArray[np.uint32] = index.reshape(-1, 3).astype(np.uint32)
    if np.linalg.det(linear) < 0:
        triangles = triangles[:, ::-1]
    vertices = vertices[used]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre = low + (high - low) / 2
    with np.errstate(over="ignore"):
        local = (vertices - centre).astype(np.float32)
    if not np.isfinite(local).all():
        raise InputError(f"{path}: a vertex is not a finite float32 number; repair the mesh")
    if part.normals is None:
        return smooth_shaded(TriangleMesh(local, triangles)), centre, 0
    # Normals go with the inverse transpose.
    with np.errstate(all="ignore"):
        normals = unit(part.normals[used] @ np.linalg.pinv(linear))
        usable = np.all(np.abs(np.linalg.norm(normals, axis=1) - 1)[triangles] < 1e-3, axis=1)
    given = np.any(~np.isnan(part.normals[used].sum(axis=1))[triangles], axis=1)
    return _shaded(local, triangles, normals.astype(np.float32), usable), centre, int(np.sum(given & ~usable))


def _shaded(
    vertices: npt.NDArray[np.float32],
    faces: npt.NDArray[np.uint32],
    normals: npt.NDArray[np.float32],
    usable: npt.NDArray[np.bool_],
) -> TriangleMesh:
    """A mesh with its normals where those at a face are usable, and with smooth ones elsewhere."""
    if usable.all():
        return TriangleMesh(vertices, faces, normals)
    new = smooth_shaded(TriangleMesh(vertices, faces[~usable]))
    assert new.normals is not None
    used, index = np.unique(faces[usable], return_inverse=True)
    return TriangleMesh(
        np.concatenate([vertices[used], new.vertices]),
        np.concatenate([index.reshape(-1, 3), new.faces + len(used)]).astype(np.uint32),
        np.concatenate([normals[used], new.normals]),
    )


def _keeps_angles(linear: Floats) -> bool:
    """Whether a linear map (3, 3) is a rotation or a reflection, times a scale."""
    gram = linear.T @ linear
    scale = np.trace(gram) / 3
    return bool(scale > 0 and np.abs(gram - scale * np.eye(3)).max() < 1e-5 * scale)
