"""From polygons, with what their corners say, to the parts of a model."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...errors import InputError, SceneWarning
from ..model import NONE, Floats, Indices, Material, Part
from ..polygons import triangulated

_MIXER = np.uint64(0x9E3779B97F4A7C15)
"""Spreads bits: 2^64 over the golden ratio."""
_OPAQUE = Material(metallic=NONE, specular=NONE)
_SEE_THROUGH = replace(_OPAQUE, alpha_mode="blend")


class Table(NamedTuple):
    """Values (N, K), and which of them each corner of the polygons has, (C,); None: each vertex has its own.

    Corners whose number is outside of the table have none.
    """

    values: Floats
    corners: Indices | None = None

    def of(self, vertices: Indices) -> Floats:
        """The value of each corner, (C, K), by its vertex."""
        found: Floats = self.values[vertices if self.corners is None else self.corners]
        return found


def of_faces(values: Floats, sizes: Indices) -> Table:
    """Values (P, K) of polygons, which all corners of a polygon share."""
    return Table(values, np.repeat(np.arange(len(sizes)), sizes))


def merged(values: Floats) -> Table:
    """Values (C, K) of corners, of which equal ones are kept once."""
    bits = np.ascontiguousarray(values, dtype=np.float64).view(np.uint64)
    keys = np.zeros(len(bits), dtype=np.uint64)
    for column in bits.T:
        keys = (keys ^ (keys >> np.uint64(29)) ^ column) * _MIXER
    _, first, index = np.unique(keys, return_index=True, return_inverse=True)
    index = index.reshape(-1)
    if not np.array_equal(bits[first][index], bits):
        # Different values have the same key.
        return Table(values, np.arange(len(values)))
    return Table(values[first], index)


def parts_of_polygons(
    path: Path,
    vertices: Floats,
    corners: Indices,
    sizes: Indices,
    *,
    normals: Table | None = None,
    uvs: Mapping[int, Table] | None = None,
    colours: Table | None = None,
    first: int = 0,
    materials: Sequence[Material | None] = (None,),
    chosen: Indices | None = None,
    name: str = "",
) -> list[Part]:
    """Polygons as triangles, in one part for each material.

    `corners` (C,): for each corner of each polygon its vertex, polygon after polygon; `sizes` (P,): how many corners
    each has; `normals` (N, 3), `uvs` (N, 2) and `colours` (N, 4): as in :class:`Part`; `first`: the number that the
    file has for its first vertex; `chosen` (P,): the index of the material of each polygon, by default the first.
    Where a corner has no normal it is NaN, without coordinates these are 0, and without a colour it is white, as where
    the file's own are not finite, which is a warning. What has colours and no material is matte. Raises InputError
    where a corner points outside of the vertices.
    """
    if len(corners) and (corners.min() < 0 or corners.max() >= len(vertices)):
        wrong = corners[(corners < 0) | (corners >= len(vertices))][0]
        last = len(vertices) - 1 + first
        raise InputError(f"{path}: a face refers to vertex {wrong + first}, but the last is {last}; repair the mesh")
    if np.any(sizes < 3):
        count = int(np.sum(sizes < 3))
        warnings.warn(f"{path}: {count} faces of less than three corners are left out", SceneWarning, stacklevel=2)
    with np.errstate(all="ignore"):  # what is not finite is found out when the parts are joined
        triangles, doubtful = triangulated(vertices[corners], sizes)
    if doubtful:
        warnings.warn(
            f"{path}: {doubtful} of {len(sizes)} polygons cross themselves; how they are filled is a guess",
            SceneWarning,
            stacklevel=2,
        )
    tables = {("normals", 0): normals, ("colours", 0): colours} | {("uvs", n): uv for n, uv in (uvs or {}).items()}
    blank = {"normals": np.nan, "colours": 1.0, "uvs": 0.0}
    for key, table in tables.items():
        if table is not None and key[0] != "normals" and not (usable := np.isfinite(table.values)).all():
            what = "colours" if key[0] == "colours" else "coordinates of textures"
            warnings.warn(f"{path}: {what} that are not finite are replaced", SceneWarning, stacklevel=2)
            tables[key] = Table(np.where(usable, table.values, blank[key[0]]), table.corners)
    known = [
        (key, *found, blank[key[0]])
        for key, table in tables.items()
        if table and (found := _complete(table, corners, len(vertices)))
    ]
    kept, index = _split(len(vertices), corners, [numbers for _, _, numbers, _ in known])
    columns: dict[tuple[str, int], Floats] = {}
    for key, values, numbers, missing in known:
        which = None if kept is None else (corners if numbers is None else numbers)[kept]
        if which is not None and which.max(initial=-1) == len(values):
            values = np.concatenate([values, np.full((1, values.shape[1]), missing)])
        columns[key] = values if which is None else values[which]
    points = vertices if kept is None else vertices[corners[kept]]
    faces = (corners if index is None else index)[triangles]
    if chosen is None or not len(faces):
        groups = [(materials[0], faces)]
    else:
        owners = np.repeat(np.arange(len(sizes)), sizes)
        groups = [(materials[which], faces[rows]) for which, rows in _groups(chosen[owners[triangles[:, 0]]])]
    parts = []
    for material, own_faces in groups:
        used, faces = (None, own_faces) if len(groups) == 1 else _compact(own_faces)
        chosen_columns = {key: values if used is None else values[used] for key, values in columns.items()}
        shades = chosen_columns.get(("colours", 0))
        if material is None and shades is not None:
            material = _coloured(shades)
        parts.append(
            Part(
                points if used is None else points[used],
                faces,
                chosen_columns.get(("normals", 0)),
                {n: values for (what, n), values in chosen_columns.items() if what == "uvs"},
                shades,
                material=material,
                name=name or (material.name if material else ""),
            )
        )
    return parts


def _coloured(colours: Floats) -> Material:
    """A matte surface of the colours of its vertices (V, 4). Some programs leave alpha 0 everywhere."""
    is_clear = colours[:, 3].min(initial=1) < 1 and colours[:, 3].max(initial=0) > 0
    return _SEE_THROUGH if is_clear else _OPAQUE


def _complete(table: Table, corners: Indices, vertices: int) -> tuple[Floats, Indices | None] | None:
    """The values, and the number (C,) of that of each corner, len(values) where it has none.

    None in place of the numbers if they are those of the vertices, and None for all if no corner has a value.
    """
    values, numbers = table
    if numbers is None:
        return values, None
    if len(values) >= vertices and np.array_equal(numbers, corners):
        return values[:vertices], None
    given = (numbers >= 0) & (numbers < len(values))
    if not given.any():
        return None
    return values, numbers if given.all() else np.where(given, numbers, len(values))


def _split(vertices: int, corners: Indices, numbers: Sequence[Indices | None]) -> tuple[Indices | None, Indices | None]:
    """Vertices such that all corners of one have the same numbers, as they are sorted by vertex and then by these.

    Returns a corner of each of them (V,), and the vertex of each corner (C,); or twice None, where no vertex is split.
    """
    keys, span = corners, vertices
    for each in numbers:
        if each is None:
            continue
        count = int(each.max(initial=0)) + 1
        if span * count >= 1 << 62:
            keys = np.unique(keys, return_inverse=True)[1].reshape(-1)
            span = int(keys.max(initial=0)) + 1
        keys = keys * count + each
        span *= count
    if keys is corners:
        return None, None
    unique, index = np.unique(keys, return_inverse=True)
    index = index.reshape(-1)
    kept = np.empty(len(unique), dtype=np.int64)
    kept[index] = np.arange(len(index))
    return kept, index


def _groups(labels: Indices) -> Iterator[tuple[int, Indices]]:
    """Each label that occurs, and where it does, in the order of the labels."""
    order = np.argsort(labels, kind="stable")
    found, starts = np.unique(labels[order], return_index=True)
    yield from zip(found.tolist(), np.split(order, starts[1:]), strict=True)


def _compact(faces: Indices) -> tuple[Indices, Indices]:
    """The vertices that faces have (V,), and the faces in terms of these."""
    low, high = int(faces.min()), int(faces.max())
    if high - low > 8 * faces.size:
        used, index = np.unique(faces, return_inverse=True)
        return used, index.reshape(-1, 3)
    marks = np.zeros(high - low + 1, dtype=bool)
    marks[faces - low] = True
    return np.flatnonzero(marks) + low, (np.cumsum(marks) - 1)[faces - low]
