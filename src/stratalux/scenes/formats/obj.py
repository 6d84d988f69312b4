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

_VERTEX, _NORMAL, _FACE = (re.compile(rb"^[ \t]*%s[ \t]+([^\n]*)" % key, re.MULTILINE) for key in (b"v", b"vn", b"f"))
_THREE = re.compile(rb"\s*(\S+[ \t]+\S+[ \t]+\S+)")
_OTHERS = re.compile(rb"^[ \t]*(l|p|curv|curv2|surf)[ \t]", re.MULTILINE)


def read(path: Path) -> Model:
    """All faces of all groups and objects; their materials and texture coordinates are not looked at."""
    text = plain_text(path.read_bytes())
    if b"\\" in text:
        text = re.sub(rb"\\[ \t]*\n", b" ", text)  # lines that go on
    others = _OTHERS.findall(text)
    if others:
        kinds = b" ".join(sorted(set(others))).decode()
        warnings.warn(
            f"{path}: {len(others)} lines, points or free-form surfaces ({kinds}) are left out; only faces are shown",
            SceneWarning,
            stacklevel=2,
        )
    vertices = _vectors(path, _VERTEX.findall(text), "v")
    normals = _vectors(path, _NORMAL.findall(text), "vn")
    faces = without_comments(b"\n".join([*_FACE.findall(text), b""]))
    sizes = np.array([len(face.split()) for face in faces.split(b"\n")[:-1]], dtype=np.int64)
    triples = _corner_indices(faces)
    for column, pattern in ((0, _VERTEX), (2, _NORMAL)):
        _count_from_start(triples[:, column], sizes, pattern, text)
    if np.any(triples[:, 0] < 1):
        raise InputError(f"{path}: a face refers to a vertex before the first, which is number 1; repair the mesh")
    return Model.of(part_of_polygons(path, vertices, triples[:, 0] - 1, sizes, normals, triples[:, 2] - 1, first=1))


def _vectors(path: Path, lines: list[bytes], key: str) -> Floats:
    """The first three numbers of each line, (N, 3)."""
    matches = [_THREE.match(line) for line in lines]
    short = next((line for line, match in zip(lines, matches, strict=True) if match is None), None)
    if short is not None:
        line = short[:40].decode("latin-1").strip()
        raise InputError(f"{path}: the line '{key} {line}' has less than three numbers; copy or export it again")
    found: Floats = numbers(b" ".join([match[1] for match in matches if match])).reshape(-1, 3)
    return found


def _corner_indices(text: bytes) -> Indices:
    """Indices (C, 3) of vertex, texture coordinates and normal of corners like 1, 1/2, 1//3 or 1/2/3; 0: none."""
    if b"/" not in text:
        return np.pad(numbers(text, np.int64)[:, None], ((0, 0), (0, 2)))
    words = text.split()
    slashes = {word.count(b"/") for word in words}
    if len(slashes) > 1 or b"//" in text or re.search(rb"/\s|/$", text):
        # Mixed, or with gaps: all in the long form.
        text = b" ".join([b"/".join([index or b"0" for index in (*word.split(b"/"), b"", b"")[:3]]) for word in words])
        slashes = {2}
    indices = np.zeros((len(words), 3), dtype=np.int64)
    given = min(slashes) + 1
    if given > 3:
        raise ValueError(f"a corner has {given} indices")
    indices[:, :given] = numbers(text.replace(b"/", b" "), np.int64).reshape(-1, given)
    return indices


def _count_from_start(indices: Indices, sizes: Indices, pattern: re.Pattern[bytes], text: bytes) -> None:
    """Replace indices that count backwards from their face, -1 being the last element before it."""
    backwards = indices < 0
    if backwards.any():
        elements = np.array([match.start() for match in pattern.finditer(text)], dtype=np.int64)
        places = np.array([match.start() for match in _FACE.finditer(text)], dtype=np.int64)
        before = np.repeat(np.searchsorted(elements, places), sizes)
        indices[backwards] += before[backwards] + 1
