"""PLY: the faces and the triangle strips of a file, with its normals, colours, coordinates of textures, and textures.

Source: G. Turk, "The PLY Polygon File Format" (1994). The names of what it leaves open are those of MeshLab, Blender
and of photogrammetry: `red green blue alpha` of vertices or faces, `s t` (or `u v`, `texture_u texture_v`) of
vertices, and lists `texcoord` of faces, with an image for each `texnumber` in comments `TextureFile NAME`. Colours of
whole numbers follow the curve of sRGB, those of floating-point numbers are linear. All three say the same, more or less
finely: where there is a texture, no colours are shown, and where vertices have some, not those of faces.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import InputError, SceneWarning
from ...model import NONE, ONE, Floats, Indices, Material, Model, Picture, Texture, Value
from ...polygons import strip
from ..beside import file_beside
from ..surface import Table, merged, of_faces, parts_of_polygons
from ..text import linear, with_alpha
from .tables import List, Tables, read_tables

_COLOURS = (
    ("red", "green", "blue", "alpha"),
    ("diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"),
    ("r", "g", "b", "a"),
)
_COORDINATES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_LARGEST = {"B": 255.0, "H": 65535.0, "b": 127.0, "h": 32767.0, "I": 4294967295.0, "i": 2147483647.0}
"""The number that stands for 1, by the types of whole numbers."""


def read(path: Path) -> Model:
    """The polygons of the element 'face' and the triangles of the element 'tristrips', in one part for each texture."""
    tables = read_tables(path)
    vertex = tables.values.get("vertex", {})
    vertices = _columns(vertex, "x", "y", "z")
    if vertices is None:
        raise InputError(f"{path}: it has no vertices with the properties x, y and z; export it as a triangle surface")
    corners, sizes = _faces(tables.values)
    normals = _columns(vertex, "nx", "ny", "nz")
    uvs = _coordinates(tables, sizes)
    materials = _textures(path, tables.comments, bool(uvs))
    colours = _colours(tables, "vertex")
    of_face = None if colours is not None else _colours(tables, "face")
    if of_face is not None and len(of_face) == len(sizes):
        colour_table: Table | None = of_faces(of_face, sizes)
    else:
        colour_table = None if colours is None else Table(colours)
    return Model.of(
        *parts_of_polygons(
            path,
            vertices,
            corners,
            sizes,
            normals=None if normals is None else Table(normals),
            uvs={0: uvs} if uvs else None,
            colours=colour_table,
            materials=[*materials, None],
            chosen=_chosen(tables, len(sizes), len(materials)),
        )
    )


def _colours(tables: Tables, element: str) -> Floats | None:
    """Linear colours of the rows of an element, (N, 4), or None where it has none."""
    values, types = tables.values.get(element, {}), tables.types.get(element, {})
    for names in _COLOURS:
        found = _columns(values, *names)
        if found is None:
            found = _columns(values, *names[:3])
        if found is not None:
            largest = np.array([_LARGEST.get(types[name], 1.0) for name in names[: found.shape[1]]])
            scaled = with_alpha(found / largest)
            return linear(scaled) if types[names[0]] in _LARGEST else scaled
    return None


def _coordinates(tables: Tables, sizes: Indices) -> Table | None:
    """The coordinates of textures: those of the corners of faces, or else those of vertices. v goes down in a model."""
    listed = tables.values.get("face", {}).get("texcoord")
    if isinstance(listed, List) and len(listed.counts) <= len(sizes) and len(listed.values):
        # A face may have none, or those of several textures, of which nobody knows the order.
        fits = listed.counts == 2 * sizes[: len(listed.counts)]
        values = listed.values[np.repeat(fits, listed.counts)].astype(np.float64).reshape(-1, 2)
        pairs, index = merged(values)
        has = np.repeat(np.concatenate([fits, np.zeros(len(sizes) - len(fits), dtype=bool)]), sizes)
        numbers = np.full(int(sizes.sum()), -1)
        numbers[has] = index
        return Table(np.stack([pairs[:, 0], 1 - pairs[:, 1]], axis=1), numbers)
    for names in _COORDINATES:
        found = _columns(tables.values.get("vertex", {}), *names)
        if found is not None:
            return Table(np.stack([found[:, 0], 1 - found[:, 1]], axis=1))
    return None


def _textures(path: Path, comments: list[str], is_mapped: bool) -> list[Material | None]:
    """A matte material for each image that comments name; None where it is not there."""
    names = [match[1].strip() for each in comments if (match := re.match(r"TextureFile\s+(.*)", each))]
    found: list[Material | None] = []
    if names and not is_mapped:
        warnings.warn(f"{path}: its texture is left out, as it has no coordinates for it", SceneWarning, stacklevel=3)
        return found
    for name in names:
        image = file_beside(path.parent, name)
        if image is None:
            warnings.warn(f"{path}: its texture {name!r} is not there, and left out", SceneWarning, stacklevel=3)
            found.append(None)
            continue
        texture = Texture(Picture(image.name, image), "srgb")
        found.append(
            Material(
                image.name,
                base_colour=Value((1.0, 1.0, 1.0), texture),
                metallic=NONE,
                roughness=ONE,
                specular=NONE,
                vertex_colours=False,
            )
        )
    return found


def _chosen(tables: Tables, faces: int, textures: int) -> Indices:
    """The index of the texture of each face; that of those without one is the last."""
    chosen = np.full(faces, 0 if textures else -1)
    numbers = tables.values.get("face", {}).get("texnumber")
    if textures and numbers is not None and not isinstance(numbers, List):
        chosen[: len(numbers)] = numbers
    return np.where((chosen >= 0) & (chosen < textures), chosen, textures)


def _columns(table: dict[str, Any], *names: str) -> Floats | None:
    """Properties side by side, (N, len(names)) float64, or None if one is missing."""
    columns = [table.get(name) for name in names]
    if any(column is None or isinstance(column, List) for column in columns):
        return None
    return np.stack([np.asarray(column, dtype=np.float64) for column in columns], axis=1)


def _faces(tables: dict[str, dict[str, Any]]) -> tuple[Indices, Indices]:
    """The vertices (C,) at the corners of all polygons and of the triangles of all strips, and their sizes (P,)."""
    corners, sizes = [], []
    for element in ("face", "tristrips"):
        table = tables.get(element, {})
        found = next((table[name] for name in ("vertex_indices", "vertex_index") if name in table), None)
        if not isinstance(found, List):
            continue
        values = found.values.astype(np.int64)
        if element == "face":
            corners.append(values)
            sizes.append(found.counts)
        else:
            # Each list holds many strips, with a -1 behind each.
            lists = np.split(values, np.cumsum(found.counts)[:-1])
            strips = [run for each in lists for run in np.split(each, np.flatnonzero(each < 0))]
            runs = [run[run >= 0] for run in strips]
            triangles = np.concatenate([np.empty((0, 3), np.int64), *(run[strip(len(run))] for run in runs)])
            corners.append(triangles.reshape(-1))
            sizes.append(np.full(len(triangles), 3))
    empty = np.empty(0, dtype=np.int64)
    return np.concatenate([empty, *corners]), np.concatenate([empty, *sizes])
