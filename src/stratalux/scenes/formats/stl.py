"""STL: the triangles of a file, binary or as text. Its normals are those of the triangles, and are not looked at.

Nor are the two bytes behind each triangle: some programs keep a colour in them, in one of two ways that cannot be told
apart.

Source: M. Burns, "Automated Fabrication" (1993), section 6.5.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from ...errors import InputError, SceneWarning
from ..model import Model
from .surface import parts_of_polygons
from .text import numbers, plain_text

_HEADER = 80
_TRIANGLE = np.dtype([("normal", "<f4", (3,)), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])

_NAME = re.compile(rb"solid(?:(?!facet)[^\n])*")


def read(path: Path) -> Model:
    """All triangles of all solids."""
    data = path.read_bytes()
    count = int.from_bytes(data[_HEADER : _HEADER + 4], "little")
    whole = max(len(data) - _HEADER - 4, 0) // _TRIANGLE.itemsize
    # The bytes of a text at this place stand for more triangles than any text has room for.
    if 0 < count <= whole:
        return _binary(path, data, count)
    text = plain_text(data)
    if re.match(rb"\s*solid\b", text, re.IGNORECASE) and (b"\0" not in text or b"facet" in text[:400].lower()):
        return _text(path, text)
    if count and len(data) > _HEADER + 4:
        raise InputError(f"{path}: cut short at {whole} of the {count} triangles it declares; copy it again")
    raise InputError(f"{path}: neither a binary STL file nor one of text, or without a triangle; export it again")


def _binary(path: Path, data: bytes, count: int) -> Model:
    triangles = np.frombuffer(data, _TRIANGLE, count, _HEADER + 4)
    rest = len(data[_HEADER + 4 + triangles.nbytes :].strip(b"\0 \t\r\n"))
    if rest:
        warnings.warn(f"{path}: {rest} bytes behind the last triangle are ignored", SceneWarning, stacklevel=3)
    vertices = triangles["vertices"].reshape(-1, 3).astype(np.float64)
    return Model.of(*parts_of_polygons(path, vertices, np.arange(3 * count), np.full(count, 3)), up="z")


def _text(path: Path, text: bytes) -> Model:
    # The name of a solid may hold any words.
    pieces = _NAME.sub(b"solid", text.lower()).split(b"vertex")
    ends = np.flatnonzero([b"endloop" in piece for piece in pieces[1:]])
    if len(ends) < 1 or ends[-1] + 2 < len(pieces) or re.search(rb"\bfacet\s+normal\b", pieces[-1]):
        raise InputError(f"{path}: cut short within triangle {len(ends)}; copy it again")
    if b"endsolid" not in pieces[-1]:
        warnings.warn(f"{path}: it does not end with 'endsolid', and may be cut short", SceneWarning, stacklevel=3)
    vertices = numbers(b" ".join([b" ".join(piece.split(None, 3)[:3]) for piece in pieces[1:]])).reshape(-1, 3)
    return Model.of(*parts_of_polygons(path, vertices, np.arange(len(vertices)), np.diff(ends, prepend=-1)), up="z")
