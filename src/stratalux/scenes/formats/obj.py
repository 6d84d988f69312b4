"""Wavefront OBJ: the polygons of a file, with their normals.

Source: Wavefront, "Object Files (.obj)", appendix B1 of the Advanced Visualizer's manual.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from ...errors import InputError, SceneWarning
from ..model import Floats, Indices, Model
from .text import numbers, part_of_polygons, plain_text, without_comments

_OTHERS = ("l", "p", "curv", "curv2", "surf")
"""Elements that are no faces: lines, points and free-form curves and surfaces."""


def read(path: Path) -> Model:
    """All faces of all groups and objects; their materials and texture coordinates are not looked at."""
    lines = _lines(path.read_bytes())
    keys = [line[:2] for line in lines]
    vertices = _vectors(path, [line for line, key in zip(lines, keys, strict=True) if key == b"v "])
    normals = _vectors(path, [line for line, key in zip(lines, keys, strict=True) if key == b"vn"])
    faces = [line[2:] for line, key in zip(lines, keys, strict=True) if key == b"f "]
    _tell_others(path, lines, keys)
    text = without_comments(b"\n".join(faces))
    faces = text.split(b"\n") if faces else []
    sizes = np.array([len(face.split()) for face in faces], dtype=np.int64)
    triples = _corner_indices(text, int(sizes.sum()))
    for column, key in ((0, b"v "), (2, b"vn")):
        backwards = triples[:, column] < 0
        if backwards.any():
            # -1 is the last one before the face.
            before = np.cumsum([each == key for each in keys])[[each == b"f " for each in keys]]
            triples[backwards, column] += np.repeat(before, sizes)[backwards] + 1
    if np.any(triples[:, 0] < 1):
        raise InputError(f"{path}: a face refers to a vertex before the first, which is number 1; repair the mesh")
    return Model.of(part_of_polygons(path, vertices, triples[:, 0] - 1, sizes, normals, triples[:, 2] - 1, first=1))


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


def _vectors(path: Path, lines: list[bytes]) -> Floats:
    """The first three numbers of each line, (N, 3)."""
    lengths = {len(line.split()) for line in lines}
    if min(lengths, default=4) < 4:
        short = next(line for line in lines if len(line.split()) < 4)[:40].decode("latin-1").strip()
        raise InputError(f"{path}: the line {short!r} has less than three numbers; copy or export it again")
    if lengths == {4}:
        rows = [line[2:] for line in lines]
    else:
        rows = [b" ".join(line.split()[1:4]) for line in lines]
    found: Floats = numbers(b" ".join(rows)).reshape(-1, 3)
    return found


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
