"""Triangle meshes: reading them from files, turning them y-up, and giving them shading normals."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from ..errors import InputError

Floats = npt.NDArray[np.floating[Any]]
Indices = npt.NDArray[np.signedinteger[Any]]

FORMATS = (".glb", ".gltf", ".obj", ".off", ".ply", ".stl")

CREASE_DEGREES = 40.0
"""Edges that bend more than this stay sharp when a file brings no normals of its own."""

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
            normals = _unit(normals @ np.linalg.pinv(linear)).astype(np.float32)
        faces = self.faces[:, ::-1] if np.linalg.det(linear) < 0 else self.faces
        return TriangleMesh((self.vertices @ linear.T + matrix[:3, 3]).astype(np.float32), faces, normals)


def load_mesh(path: str | Path, up: str | None = None) -> TriangleMesh:
    """Read a mesh from a .ply, .obj, .stl, .glb, .gltf or .off file, turned so that y is up.

    All geometries of a file are joined with their transforms; materials and textures are ignored. `up`
    names the axis of the file that points up ('x', 'y', 'z', '-x', '-y', '-z'); by default y, but z for
    .stl as is usual in CAD. Shading normals are those of the file, or else smooth across edges that bend
    less than `CREASE_DEGREES`. Faces without area and vertices without a face are dropped. Raises
    InputError for a file that is missing, unreadable, truncated, of another format, or without a surface.
    """
    path = Path(path)
    extension = path.suffix.lower()
    if extension not in FORMATS:
        raise InputError(f"{path}: unknown mesh format '{path.suffix}'; use one of {' '.join(FORMATS)}")
    up = ("z" if extension == ".stl" else "y") if up is None else up
    if up not in _TO_Y_UP:
        raise InputError(f"{path}: up axis '{up}' is unknown; use one of {' '.join(_TO_Y_UP)}")
    if not path.is_file():
        raise InputError(f"{path}: there is no such mesh file; check the path")

    parts = [_part(path, *entry) for entry in _read(path)]
    found = sum(len(part.faces) for part in parts)
    if found == 0:
        raise InputError(f"{path}: the mesh has no faces; export it as a triangle surface")
    declared = _declared_faces(path)
    if found < declared:
        raise InputError(f"{path}: cut short at {found} of the {declared} faces it declares; copy it again")
    parts = [part for part in map(_cleaned, parts) if len(part.faces)]
    if not parts:
        raise InputError(f"{path}: the mesh has zero extent (no face has an area); export it again")
    offsets = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    turn = np.eye(4)
    turn[:3, :3] = _TO_Y_UP[up]
    return TriangleMesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + np.uint32(offset) for part, offset in zip(parts, offsets, strict=True)]),
        np.concatenate([part.normals for part in parts if part.normals is not None]),
    ).transformed(turn)


def smooth_shaded(mesh: TriangleMesh, crease_degrees: float = CREASE_DEGREES) -> TriangleMesh:
    """The mesh with new shading normals: smooth, but split where an edge bends more than `crease_degrees`.

    Vertices at the same place count as one, so that a triangle soup comes out smooth too. Corners around
    a vertex share a normal (the mean of their faces', weighted by the corner angles) when they are
    connected through smooth edges; each such group becomes one vertex of the result.
    """
    faces = mesh.faces.astype(np.int64)
    points = mesh.vertices.astype(np.float64)[faces]
    face_normals = _unit(_cross(points))
    group = _smooth_groups(_welded(mesh.vertices)[faces], face_normals, np.cos(np.radians(crease_degrees)))

    _, first, index = np.unique(group, return_index=True, return_inverse=True)
    weighted = (face_normals[:, None, :] * _corner_angles(points)[:, :, None]).reshape(-1, 3)
    normals: Floats = np.column_stack([np.bincount(index, weights, len(first)) for weights in weighted.T])
    # The faces of a needle can cancel out; any of their own normals is then as good as another.
    cancelled = np.linalg.norm(normals, axis=1) < 1e-9
    normals[cancelled] = face_normals[first[cancelled] // 3]
    return TriangleMesh(
        mesh.vertices[faces.ravel()[first]],
        index.reshape(-1, 3).astype(np.uint32),
        _unit(normals).astype(np.float32),
    )


def _read(path: Path) -> list[tuple[trimesh.Trimesh, Floats]]:
    """The geometries with faces of a file, each with its (4, 4) transform into the scene."""
    try:
        scene = trimesh.load_scene(path, process=False, skip_materials=True)
        placed = [scene.graph[node] for node in scene.graph.nodes_geometry]
    # What a reader raises on a damaged file is anybody's guess, from IndexError to a missing module.
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        raise InputError(f"{path}: unreadable as {path.suffix} ({reason}); export it again") from error
    entries = [(scene.geometry[name], transform) for transform, name in placed]
    return [entry for entry in entries if isinstance(entry[0], trimesh.Trimesh)]


def _part(path: Path, geometry: trimesh.Trimesh, transform: Floats) -> TriangleMesh:
    """One geometry in scene coordinates, with the normals that its file stored (None without)."""
    # Asking for geometry.vertex_normals computes them; stored ones sit in the cache from the start.
    stored = geometry._cache["vertex_normals"]
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            part = TriangleMesh(geometry.vertices, geometry.faces, stored).transformed(transform)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    if not np.isfinite(part.vertices[part.faces]).all():
        raise InputError(f"{path}: a vertex is not a finite float32 number; repair the mesh")
    return part


def _declared_faces(path: Path) -> int:
    """How many polygons the header of a PLY or OFF file promises; 0 where there is no such promise."""
    with path.open("rb") as file:
        head = file.read(4096).decode("latin-1")
    pattern = {".ply": r"^element\s+face\s+(\d+)", ".off": r"\A\s*OFF\s+(?:#[^\n]*\n\s*)*\d+\s+(\d+)"}
    match = re.search(pattern.get(path.suffix.lower(), r"(?!)"), head, re.MULTILINE)
    return int(match.group(1)) if match else 0


def _cleaned(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh without zero-area faces and unused vertices; normals its own if all are usable, else new."""
    area = np.linalg.norm(_cross(mesh.vertices.astype(np.float64)[mesh.faces]), axis=1)
    used, index = np.unique(mesh.faces[area > 0], return_inverse=True)
    normals = None if mesh.normals is None else mesh.normals[used]
    cleaned = TriangleMesh(mesh.vertices[used], index.reshape(-1, 3).astype(np.uint32), normals)
    usable = normals is not None and np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-3)
    return cleaned if usable or not len(used) else smooth_shaded(cleaned)


def _welded(vertices: Floats) -> Indices:
    """For each of the (V, 3) vertices a number that is the same for all vertices at its place."""
    order = np.lexsort(vertices.T)
    new = np.any(np.diff(vertices[order], axis=0) != 0, axis=1)
    place = np.empty(len(vertices), dtype=np.int64)
    place[order] = np.concatenate([[0], np.cumsum(new)])
    return place


def _smooth_groups(corners: Indices, face_normals: Floats, cosine: float) -> Indices:
    """For each of the 3F corners (welded vertices, (F, 3)) the lowest corner that it shares a normal with."""
    low = np.minimum(corners, np.roll(corners, -1, axis=1))
    high = np.maximum(corners, np.roll(corners, -1, axis=1))
    start = np.arange(corners.size).reshape(-1, 3)
    end = np.roll(start, -1, axis=1)
    at_low, at_high = np.where(corners == low, [start, end], [end, start]).reshape(2, -1)
    edge = (low * (corners.max() + 1) + high).ravel()
    order = np.argsort(edge, kind="stable")
    links = []
    # An edge has two sides; four where surfaces touch or every face comes twice, once per orientation.
    for step in (1, 2, 3):
        a, b = order[:-step], order[step:]
        bend = np.einsum("ij,ij->i", face_normals[a // 3], face_normals[b // 3])
        keep = (edge[a] == edge[b]) & (bend > cosine)
        a, b = a[keep], b[keep]
        links += [np.stack([at_low[a], at_low[b]]), np.stack([at_high[a], at_high[b]])]
    return _components(corners.size, np.concatenate(links, axis=1))


def _components(count: int, links: Indices) -> Indices:
    """The lowest member of the connected component of each of `count` nodes, given (2, L) links."""
    root = np.arange(count)
    while True:
        ends = root[links]
        lowest = ends.min(axis=0)
        if np.array_equal(lowest, ends.max(axis=0)):
            return root
        # Hang the higher root below the lower one, then flatten: a logarithmic number of rounds.
        np.minimum.at(root, ends.max(axis=0), lowest)
        while not np.array_equal(root, root[root]):
            root = root[root]


def _corner_angles(points: Floats) -> Floats:
    """The angles (F, 3) in radians at the corners of triangles given by their points (F, 3, 3)."""
    ahead = _unit(np.roll(points, -1, axis=1) - points)
    cosines = -np.einsum("fij,fij->fi", ahead, np.roll(ahead, 1, axis=1))
    return np.asarray(np.arccos(np.clip(cosines, -1, 1)))


def _cross(points: Floats) -> Floats:
    """Twice the area vectors (F, 3) of triangles given by their points (F, 3, 3)."""
    return np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])


def _unit(vectors: Floats) -> Floats:
    """The vectors (..., 3) scaled to length one; zero vectors stay zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1))
