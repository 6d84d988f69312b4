"""From what a file holds to meshes that can be rendered: y up, in single precision, with shading normals."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError, SceneWarning
from .formats import READERS, read_model
from .mesh import TriangleMesh, smooth_shaded
from .model import Camera, Floats, Indices, Light, Material, Model, Part
from .normals import CREASE_DEGREES, cross, unit

FORMATS = tuple(READERS)

FAR = 8.0
"""An object whose centre is as many diagonals away from the origin is moved there: single precision would spoil it."""

_BLOCK = 1 << 15
"""Faces that are looked at together."""
_FLAT_DEGREES = 0.01
"""Faces that bend less may share their vertices, though all are flat: nobody sees it."""

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
class Shape:
    """A mesh of one material, and the affine (4, 4) matrices of all the places where it stands.

    Attributes of the mesh: "uv" and, for further sets of coordinates, "uv1" and so on (V, 2); "colour" (V, 4).
    """

    mesh: TriangleMesh
    places: Sequence[Floats]
    material: Material | None = None
    name: str = ""


@dataclass(frozen=True, eq=False)
class Object:
    """What a file holds, with y up and near the origin: `origin` (3,), in the file's lengths, is what was taken off."""

    shapes: Sequence[Shape]
    lights: Sequence[Light]
    cameras: Sequence[Camera]
    bounds: Floats
    origin: Floats
    metres: float | None = None

    def points(self) -> Floats:
        """All vertices where they stand, (N, 3)."""
        return np.concatenate([_at(shape.mesh.vertices, place) for shape in self.shapes for place in shape.places])

    def measure(self) -> str:
        """How large it is, in words: width, height and depth, in metres if the file says how long a unit is."""
        sides = (self.bounds[1] - self.bounds[0]) * (1 if self.metres is None else self.metres)
        return f"{' x '.join(f'{side:.3g}' for side in sides)} {'units' if self.metres is None else 'm'}"


def load_object(path: str | Path, up: str | None = None) -> Object:
    """Read what there is in a file (.glb, .gltf, .obj, .ply, .stl, .off, ...), turned so that y is up.

    `up` names the axis of the file that points up ('x', 'y', 'z', '-x', '-y', '-z'); by default what the file says or
    its format is known for: y, but z for .stl as is usual in CAD. Shading normals are those of the file, or else smooth
    across edges that bend less than `CREASE_DEGREES`, or flat for a part that asks for that. Faces without area and
    vertices without a face are dropped. What is `FAR` from the origin is centred there. Raises InputError for a file
    that is missing, unreadable, truncated, of another format, or without a surface.
    """
    path = Path(path)
    try:
        return object_of(path, read_model(path), up)
    except MemoryError:
        raise InputError(f"{path}: its triangles do not fit into memory; make it smaller") from None


def load_mesh(path: str | Path, up: str | None = None) -> TriangleMesh:
    """All shapes of a file as one mesh, joined where they stand, without what they are made of; see `load_object`."""
    shapes = load_object(path, up).shapes
    count = sum(len(shape.mesh.vertices) * len(shape.places) for shape in shapes)
    if count > np.iinfo(np.uint32).max:
        raise InputError(f"{path}: {count} vertices are too many for one mesh; make it smaller")
    try:
        return joined([shape.mesh.transformed(place) for shape in shapes for place in shape.places])
    except MemoryError:
        raise InputError(f"{path}: its triangles do not fit into memory; make it smaller") from None


def joined(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Meshes that have normals as one, without their attributes."""
    firsts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    return TriangleMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + np.uint32(first) for mesh, first in zip(meshes, firsts, strict=False)]),
        np.concatenate([mesh.normals for mesh in meshes if mesh.normals is not None]),
    )


def object_of(path: Path, model: Model, up: str | None = None) -> Object:
    """The object of a model; see :func:`load_object`. `path` is what errors speak of."""
    if up is not None and up not in _TO_Y_UP:
        raise InputError(f"{path}: up axis '{up}' is unknown; use one of {' '.join(_TO_Y_UP)}")
    turn: Floats = np.array(_TO_Y_UP[model.up if up is None else up], dtype=np.float64)
    known: dict[tuple[int, bytes], tuple[TriangleMesh | None, Floats]] = {}
    places: dict[tuple[int, bytes], list[Floats]] = {}
    replaced = 0
    for instance in model.instances:
        linear = turn @ instance.matrix[:3, :3]
        # Creases and shading normals depend on angles: a map that changes these comes before them.
        before, after = (np.eye(3), linear) if _keeps_angles(linear) else (linear, np.eye(3))
        key = (instance.part, before.tobytes())
        if key not in known:
            mesh, centre, count = _mesh(path, model.parts[instance.part], before)
            known[key] = mesh, centre
            replaced += count
        mesh, centre = known[key]
        if mesh is not None:
            place = np.eye(4)
            place[:3, :3] = after
            place[:3, 3] = after @ centre + turn @ instance.matrix[:3, 3]
            places.setdefault(key, []).append(place)
    if replaced:
        warnings.warn(
            f"{path}: the normals of {replaced} faces are not usable; they are computed from the faces",
            SceneWarning,
            stacklevel=3,
        )
    if not places:
        raise InputError(f"{path}: the mesh has zero extent (no face has an area); export it again")
    shapes = []
    for key, where in places.items():
        mesh, part = known[key][0], model.parts[key[0]]
        assert mesh is not None
        shapes.append(Shape(mesh, where, part.material, part.name))
    return _centred(path, model, shapes, turn)


def _centred(path: Path, model: Model, shapes: list[Shape], turn: Floats) -> Object:
    """The object, at the origin if it was far from there."""
    boxes = [_box(shape.mesh, place) for shape in shapes for place in shape.places]
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    centre = (low + high) / 2
    if not np.isfinite([low, high]).all() or np.abs([low, high]).max() > np.finfo(np.float32).max:
        raise InputError(f"{path}: a vertex is not a finite float32 number; repair the mesh")
    origin = centre if np.abs(centre).max() > FAR * np.linalg.norm(high - low) else np.zeros(3)
    turned = np.eye(4)
    turned[:3, :3], turned[:3, 3] = turn, -origin
    for shape in shapes:
        for place in shape.places:
            place[:3, 3] -= origin
    lights = [replace(light, matrix=turned @ light.matrix) for light in model.lights]
    cameras = [replace(camera, matrix=turned @ camera.matrix) for camera in model.cameras]
    return Object(shapes, lights, cameras, np.stack([low, high]) - origin, origin, model.metres)


def _box(mesh: TriangleMesh, place: Floats) -> Floats:
    """The bounding box (2, 3) of a mesh at a place."""
    if _is_one(place[:3, :3]):
        return mesh.bounds.astype(np.float64) + place[:3, 3]
    points = _at(mesh.vertices, place)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _at(points: npt.NDArray[Any], place: Floats) -> Floats:
    return np.asarray(points @ place[:3, :3].T + place[:3, 3])


def _mesh(path: Path, part: Part, linear: Floats) -> tuple[TriangleMesh | None, Floats, int]:
    """A part under a linear map (3, 3), without faces that have no area, moved so that its centre is the origin.

    Returns it with normals (None where nothing is left), where its centre was, and how many faces have normals in the
    file that are not usable.
    """
    with np.errstate(all="ignore"):
        vertices = part.vertices if _is_one(linear) else part.vertices @ linear.T
        finite = np.asarray(np.isfinite(vertices).all(axis=1))
        if not finite.all() and not finite[part.faces].all():
            raise InputError(f"{path}: a vertex is not a finite float32 number; repair the mesh")
        real = _have_area(vertices, part.faces)
    faces = part.faces if real.all() else part.faces[real]
    if not len(faces):
        return None, np.zeros(3), 0
    used, triangles = _in_use(faces, len(vertices))
    if np.linalg.det(linear) < 0:
        triangles = triangles[:, ::-1]
    vertices = vertices[used]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre = low + (high - low) / 2
    with np.errstate(over="ignore"):
        local = (vertices - centre).astype(np.float32)
    if not np.isfinite(local).all():
        raise InputError(f"{path}: a vertex is not a finite float32 number; repair the mesh")
    mesh = TriangleMesh(local, triangles, None, _attributes(path, part, used))
    if part.normals is None:
        return smooth_shaded(mesh, _FLAT_DEGREES if part.flat else CREASE_DEGREES), centre, 0
    # Normals go with the inverse transpose.
    with np.errstate(all="ignore"):
        normals = unit(part.normals[used] @ np.linalg.pinv(linear))
        good = np.asarray(np.abs(np.linalg.norm(normals, axis=1) - 1) < 1e-3)
    if good.all():
        return replace(mesh, normals=normals.astype(np.float32)), centre, 0
    usable = np.asarray(good[triangles].all(axis=1))
    given = np.any(~np.isnan(part.normals[used].sum(axis=1))[triangles], axis=1)
    return _shaded(mesh, normals.astype(np.float32), usable), centre, int(np.sum(given & ~usable))


def _have_area(vertices: Floats, faces: Indices) -> npt.NDArray[np.bool_]:
    """Which faces (F,) have an area. In blocks, which stay in the cache."""
    kept = np.empty(len(faces), dtype=np.bool_)
    for start in range(0, len(faces), _BLOCK):
        block = slice(start, start + _BLOCK)
        kept[block] = np.any(cross(vertices[faces[block]]) != 0, axis=1)
    return kept


def _in_use(faces: Indices, count: int) -> tuple[Any, npt.NDArray[np.uint32]]:
    """Which of `count` vertices have a face, as an index, and the faces (F, 3) by their places among these."""
    there = np.zeros(count, dtype=np.bool_)
    there[faces] = True
    if there.all():
        return slice(None), faces.astype(np.uint32)
    places: npt.NDArray[np.uint32] = np.cumsum(there, dtype=np.uint32) - np.uint32(1)
    return np.flatnonzero(there), places[faces]


def _is_one(linear: Floats) -> bool:
    return bool(np.array_equal(linear, np.eye(3)))


def _attributes(path: Path, part: Part, used: Any) -> dict[str, npt.NDArray[np.float32]]:
    """What there is of the vertices that are `used` besides their places; numbers that are none are 0, with a word."""
    found = {f"uv{number or ''}": uv for number, uv in part.uvs.items()}
    if part.colours is not None:
        found["colour"] = part.colours
    with np.errstate(over="ignore"):
        attributes = {name: values[used].astype(np.float32) for name, values in found.items()}
    for name, values in attributes.items():
        if bad := int(np.sum(~np.isfinite(values).all(axis=1))):
            what = "colours" if name == "colour" else "texture coordinates"
            warnings.warn(f"{path}: {bad} {what} are no finite numbers; 0 is taken", SceneWarning, stacklevel=4)
            values[~np.isfinite(values)] = 0
    return attributes


def _shaded(mesh: TriangleMesh, normals: npt.NDArray[np.float32], usable: npt.NDArray[np.bool_]) -> TriangleMesh:
    """A mesh with its normals where those at a face are usable, and with smooth ones elsewhere."""
    with_normals = replace(mesh, normals=normals)
    if usable.all():
        return with_normals
    new = smooth_shaded(mesh.only(~usable))
    if not usable.any():
        return new
    old = with_normals.only(usable)
    both = joined([old, new])
    return replace(
        both, attributes={name: np.concatenate([old.attributes[name], new.attributes[name]]) for name in old.attributes}
    )


def _keeps_angles(linear: Floats) -> bool:
    """Whether a linear map (3, 3) is a rotation or a reflection, times a scale."""
    gram = linear.T @ linear
    scale = np.trace(gram) / 3
    return bool(scale > 0 and np.abs(gram - scale * np.eye(3)).max() < 1e-5 * scale)
