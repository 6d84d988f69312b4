"""Wavefront OBJ: the polygons of a file with their normals, coordinates of textures and colours, and its materials.

Source: Wavefront, "Object Files (.obj)", appendix B1 of the Advanced Visualizer's manual. Colours behind the positions
are no part of it, but of what MeshLab, Blender and others write: they follow the curve of sRGB.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from ....errors import InputError, SceneWarning
from ...model import Floats, Indices, Material, Model
from ..beside import file_beside
from ..surface import Table, parts_of_polygons
from ..text import linear, numbers, plain_text, with_alpha, without_comments, word
from .materials import read_materials

_OTHERS = ("l", "p", "curv", "curv2", "surf")
"""Elements that are no faces: lines, points and free-form curves and surfaces."""


def read(path: Path) -> Model:
    """All faces of all groups and objects, in one part for each material."""
    lines = _lines(path.read_bytes())
    keys = [line[:2] for line in lines]
    vertices, colours = _vertices(path, _of(lines, keys, b"v "))
    coordinates = _coordinates(_of(lines, keys, b"vt"))
    of_normals = _of(lines, keys, b"vn")
    normals = _vectors(path, of_normals, {len(line.split()) for line in of_normals})
    _tell_others(path, lines, keys)
    faces = [line[2:] for line in _of(lines, keys, b"f ")]
    text = without_comments(b"\n".join(faces))
    faces = text.split(b"\n") if faces else []
    sizes = np.array([len(face.split()) for face in faces], dtype=np.int64)
    triples = _corner_indices(text, int(sizes.sum()))
    for column, key in enumerate((b"v ", b"vt", b"vn")):
        backwards = triples[:, column] < 0
        if backwards.any():
            # -1 is the last one before the face.
            before = np.cumsum([each == key for each in keys])[[each == b"f " for each in keys]]
            counted = triples[backwards, column] + np.repeat(before, sizes)[backwards] + 1
            triples[backwards, column] = np.where(counted > 0, counted, -1)
    if np.any(triples[:, 0] < 1):
        raise InputError(f"{path}: a face refers to a vertex before the first, which is number 1; repair the mesh")
    _tell_missing(path, triples[:, 1], len(coordinates), "coordinates of textures")
    _tell_missing(path, triples[:, 2], len(normals), "normals")
    materials, chosen = _materials(path, lines, keys)
    return Model.of(
        *parts_of_polygons(
            path,
            vertices,
            triples[:, 0] - 1,
            sizes,
            normals=Table(normals, triples[:, 2] - 1),
            uvs={0: Table(coordinates, triples[:, 1] - 1)},
            colours=colours,
            first=1,
            materials=materials,
            chosen=chosen,
        )
    )


def _lines(data: bytes) -> list[bytes]:
    """The lines of a file, each from its first word on, which a blank follows; those that go on are joined."""
    text = plain_text(data)
    if b"\\" in text:
        text = re.sub(rb"\\[ \t]*\n", b" ", text)
    if b"\t" in text:
        text = text.replace(b"\t", b" ")
    if b"\n " in text or text.startswith(b" "):
        text = re.sub(rb"^ +", b"", text, flags=re.MULTILINE)
    return text.split(b"\n")


def _of(lines: list[bytes], keys: list[bytes], wanted: bytes) -> list[bytes]:
    return [line for line, key in zip(lines, keys, strict=True) if key == wanted]


def _vertices(path: Path, lines: list[bytes]) -> tuple[Floats, Table | None]:
    """Positions (V, 3), and colours where any of them has some; those without are white."""
    lengths = {len(line.split()) for line in lines}
    positions = _vectors(path, lines, lengths)
    if max(lengths, default=0) < 7:
        return positions, None
    rows = [line.split()[1:] for line in lines]
    coloured = np.array([len(row) >= 6 for row in rows], dtype=bool)
    colours = np.ones((len(rows), 3))
    colours[coloured] = numbers(b" ".join([b" ".join(row[3:6]) for row in rows if len(row) >= 6])).reshape(-1, 3)
    if colours.max() > 1:
        warnings.warn(f"{path}: colours of vertices are above 1, and taken to go up to 255", SceneWarning, stacklevel=3)
        colours[coloured] /= 255
    return positions, Table(with_alpha(linear(colours)))


def _vectors(path: Path, lines: list[bytes], lengths: set[int]) -> Floats:
    """The first three numbers of each line, (N, 3). `lengths`: how many words lines have."""
    if min(lengths, default=4) < 4:
        short = next(line for line in lines if len(line.split()) < 4)[:40].decode("latin-1").strip()
        raise InputError(f"{path}: the line {short!r} has less than three numbers; copy or export it again")
    if lengths == {4}:
        rows = [line[2:] for line in lines]
    else:
        rows = [b" ".join(line.split()[1:4]) for line in lines]
    found: Floats = numbers(b" ".join(rows)).reshape(-1, 3)
    return found


def _coordinates(lines: list[bytes]) -> Floats:
    """u and v of each line, (N, 2); v, which may be missing, goes down in a model."""
    lengths = {len(line.split()) for line in lines}
    if lengths == {3}:
        rows = [line[2:] for line in lines]
    else:
        rows = [b" ".join([*line.split()[1:3], b"0"][:2]) for line in lines]
    found: Floats = numbers(b" ".join(rows)).reshape(-1, 2)
    found[:, 1] = 1 - found[:, 1]
    return found


def _materials(path: Path, lines: list[bytes], keys: list[bytes]) -> tuple[list[Material | None], Indices | None]:
    """The materials that faces have, and the index of that of each face; the first one is None."""
    if b"us" not in keys:
        return [None], None
    kinds = np.array(keys)
    libraries = [line[6:] for line in _of(lines, keys, b"mt") if line.startswith(b"mtllib ")]
    known = _libraries(path, libraries)
    # Faces before the first statement have none.
    places, names = [-1], [""]
    for at in np.flatnonzero(kinds == b"us").tolist():
        if lines[at].startswith(b"usemtl"):
            places.append(at)
            names.append(word(lines[at][6:]).strip())
    missing = sorted({name for name in names[1:] if name and name not in known})
    if missing and (known or not libraries):
        warnings.warn(
            f"{path}: {len(missing)} of its materials are in none of its libraries, and left out ({missing[0]!r})",
            SceneWarning,
            stacklevel=3,
        )
    used = list(dict.fromkeys(name for name in names if name in known))
    index = {name: number for number, name in enumerate(used, 1)}
    which = np.searchsorted(places, np.flatnonzero(kinds == b"f "), side="right") - 1
    return [None, *(known[name] for name in used)], np.array([index.get(name, 0) for name in names])[which]


def _libraries(path: Path, statements: list[bytes]) -> dict[str, Material]:
    """The materials of all libraries; of the same name, the first counts."""
    known: dict[str, Material] = {}
    for said in dict.fromkeys(word(each).strip() for each in statements):
        # One name with blanks, or several names.
        several = re.findall(r"\S.*?\.mtl(?=\s|$)", said, re.IGNORECASE) or said.split()
        whole = file_beside(path.parent, said)
        for name in [said] if whole else several:
            library = whole or file_beside(path.parent, name)
            if library is None:
                warnings.warn(
                    f"{path}: its materials {name!r} are not there, and left out; copy that file too",
                    SceneWarning,
                    stacklevel=4,
                )
            else:
                known = read_materials(library, path.parent) | known
    return known


def _tell_missing(path: Path, numbers: Indices, count: int, what: str) -> None:
    """Warn of corners whose `numbers` are beyond what the file has."""
    beyond = int(np.sum((numbers > count) | (numbers < 0)))
    if beyond:
        warnings.warn(
            f"{path}: {beyond} corners refer to {what} that are not there; they have none", SceneWarning, stacklevel=3
        )


def _tell_others(path: Path, lines: list[bytes], keys: list[bytes]) -> None:
    """Warn of elements that are no faces."""
    candidates = {f"{other} "[:2].encode() for other in _OTHERS} & set(keys)
    words = [
        line.split(None, 1)[0].decode("latin-1") for line, key in zip(lines, keys, strict=True) if key in candidates
    ]
    others = [word for word in words if word in _OTHERS]
    if others:
        found = " ".join(sorted(set(others)))
        warnings.warn(
            f"{path}: {len(others)} lines, points or free-form surfaces ({found}) are left out; only faces are shown",
            SceneWarning,
            stacklevel=3,
        )


def _corner_indices(text: bytes, count: int) -> Indices:
    """Indices (C, 3) of vertex, texture coordinates and normal of corners like 1, 1/2, 1//3 or 1/2/3; 0: none."""
    slashes, doubles = text.count(b"/"), text.count(b"//")
    if slashes == 0:
        columns = [0]
    elif slashes == 2 * count and doubles == 0:
        columns = [0, 1, 2]
    elif slashes == 2 * count and doubles == count:
        columns = [0, 2]
    elif slashes == count and doubles == 0 and not re.search(rb"/[-0-9]*/", text):
        columns = [0, 1]
    else:
        columns = []
    if columns:
        found = numbers(text.replace(b"/", b" "), np.int64)
        if len(found) == len(columns) * count:
            indices = np.zeros((count, 3), dtype=np.int64)
            indices[:, columns] = found.reshape(count, len(columns))
            return indices
    # Mixed, or with gaps.
    rows = [[index or b"0" for index in (*word.split(b"/"), b"", b"")] for word in text.split()]
    longest = max(map(len, rows), default=3)
    if longest > 5:
        raise ValueError(f"a corner has {longest - 2} indices")
    triples: Indices = numbers(b" ".join([b" ".join(row[:3]) for row in rows]), np.int64).reshape(-1, 3)
    return triples
