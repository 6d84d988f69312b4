"""OFF: the polygons of a text file of Geomview's Object File Format.

Source: The Geomview manual, "OFF Files". A header like COFF or STNOFF says what stands behind each position, in this
order: normals, colours, coordinates of textures. Colours of whole numbers follow the curve of sRGB, others are linear.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ...errors import InputError
from ..model import Floats, Model
from .surface import Table, of_faces, parts_of_polygons
from .text import linear, numbers, plain_text, without_comments

_HEADER = re.compile(rb"\s*(?:(ST)?(C)?(N)?(4)?(n)?(?:OFF|off))?")


def read(path: Path) -> Model:
    """The faces of a file, with its normals, colours and coordinates of textures where it has some."""
    data = plain_text(path.read_bytes())
    header = _HEADER.match(data)
    assert header  # it matches the empty text
    is_mapped, is_coloured, has_normals, homogeneous, any_dimension = header.groups()
    body = data[header.end() :]
    if re.match(rb"[ \t]*BINARY", body):
        raise InputError(f"{path}: binary OFF files are not supported; export it as text, or as PLY")
    if any_dimension:
        raise InputError(f"{path}: OFF files of n dimensions are not supported; export it as OFF or PLY")
    lines = [words for line in without_comments(body).split(b"\n") if (words := line.split())]
    if not lines or len(lines[0]) < 2:
        raise InputError(f"{path}: it does not say how many vertices and faces it has; export it again")
    vertex_count, face_count = map(int, lines[0][:2])
    if vertex_count < 0 or face_count < 0:
        raise InputError(f"{path}: it declares a negative number of vertices or faces; export it again")
    rows = lines[1 : 1 + vertex_count]
    faces = lines[1 + vertex_count : 1 + vertex_count + face_count]
    if len(rows) < vertex_count:
        raise InputError(f"{path}: cut short at {len(rows)} of the {vertex_count} vertices it declares; copy it again")
    if len(faces) < face_count or any(len(face) <= int(face[0]) for face in faces[-1:]):
        whole = min(len(faces), face_count - 1)
        raise InputError(f"{path}: cut short at {whole} of the {face_count} faces it declares; copy it again")
    size = 4 if homogeneous else 3
    vertices = _columns(rows, 0, size)
    if homogeneous:
        with np.errstate(divide="ignore", invalid="ignore"):  # a vertex at infinity is found out later
            vertices = vertices[:, :3] / vertices[:, 3:]
    sizes = np.array([int(face[0]) for face in faces], dtype=np.int64)
    corners = [face[1 : size + 1] for face, size in zip(faces, sizes.tolist(), strict=True)]
    behind = [face[size + 1 :] for face, size in zip(faces, sizes.tolist(), strict=True)]
    if sizes.min(initial=0) < 0 or any(len(c) < size for c, size in zip(corners, sizes.tolist(), strict=True)):
        raise InputError(f"{path}: a face has less corners than it declares; export it again")
    indices = numbers(b" ".join([b" ".join(each) for each in corners]), np.int64)
    normals, uvs, colours = None, None, _colours(behind)
    if has_normals:
        normals, size = Table(_columns(rows, size, size + 3)), size + 3
    if is_mapped:
        pairs = _columns([row[-2:] for row in rows], 0, 2)
        uvs, rows = {0: Table(np.stack([pairs[:, 0], 1 - pairs[:, 1]], axis=1))}, [row[:-2] for row in rows]
    table = None if colours is None else of_faces(colours, sizes)
    of_vertices = _colours([row[size:] for row in rows]) if is_coloured else None
    table = table if of_vertices is None else Table(of_vertices)
    return Model.of(*parts_of_polygons(path, vertices, indices, sizes, normals=normals, uvs=uvs, colours=table))


def _colours(rows: list[list[bytes]]) -> Floats | None:
    """Linear colours (N, 4) of rows with three or four numbers; others are white. None where there is no colour."""
    lengths = np.array([len(row) for row in rows], dtype=np.int64)
    is_coloured = (lengths == 3) | (lengths == 4)
    if not is_coloured.any():
        return None
    given = [row for row in rows if len(row) in (3, 4)]
    whole = np.array([not re.search(rb"[.eE]", b"".join(row)) for row in given])
    padded = [
        row if len(row) == 4 else [*row, b"255" if is_whole else b"1"]
        for row, is_whole in zip(given, whole, strict=True)
    ]
    values = numbers(b" ".join([b" ".join(row) for row in padded])).reshape(-1, 4)
    found = np.ones((len(rows), 4))
    found[is_coloured] = np.where(whole[:, None], linear(np.where(whole[:, None], values, 0) / 255), values)
    return found


def _columns(rows: list[list[bytes]], start: int, stop: int) -> np.ndarray:
    """The numbers in some of the columns, (len(rows), stop - start)."""
    if any(len(row) < stop for row in rows):
        short = next(index for index, row in enumerate(rows) if len(row) < stop)
        raise ValueError(f"vertex {short} has less than {stop} numbers")
    return np.asarray(numbers(b" ".join([b" ".join(row[start:stop]) for row in rows]))).reshape(-1, stop - start)
