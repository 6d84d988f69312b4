"""What the readers of text files share: their encodings and line ends, numbers, and the way to a part."""

from __future__ import annotations

import codecs
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, SceneWarning
from ..model import Floats, Indices, Part
from ..polygons import triangulated

# The longer marks first: that of UTF-32 begins with that of UTF-16.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def plain_text(data: bytes) -> bytes:
    """The text of a file without its byte order mark, in an extension of ASCII, with lines that end in a newline."""
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            data = data[len(mark) :] if encoding == "utf-8" else data.decode(encoding, "replace").encode()
            break
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def numbers(text: bytes, dtype: type[Any] = np.float64) -> Any:
    """All numbers of a text that consists of nothing else. Raises ValueError with the first word that is none."""
    text = text.strip()
    if not text:
        return np.empty(0, dtype=dtype)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # what NumPy before 2.3 does with such a word
            return np.fromstring(text, dtype=dtype, sep=" ")
    except (DeprecationWarning, ValueError):
        what = "a whole number" if dtype is np.int64 else "a number"
        for word in text.split():
            try:
                (int if dtype is np.int64 else float)(word)
            except ValueError:
                raise ValueError(f"{word[:20].decode('latin-1')!r} is not {what}") from None
        raise ValueError(f"something is not {what}") from None


def part_of_polygons(
    path: Path,
    vertices: Floats,
    corners: Indices,
    sizes: Indices,
    normals: Floats | None = None,
    normal_corners: Indices | None = None,
    first: int = 0,
) -> Part:
    """Polygons as triangles.

    `corners` (C,): for each corner of each polygon its vertex, polygon after polygon; `sizes` (P,): how many corners
    each has; `normals`: one for each vertex, or those that `normal_corners` (C,) names for each corner, negative where
    there is none; `first`: the number that the file has for its first vertex. Raises InputError where a corner points
    outside of the vertices.
    """
    if len(corners) and (corners.min() < 0 or corners.max() >= len(vertices)):
        wrong = corners[(corners < 0) | (corners >= len(vertices))][0]
        last = len(vertices) - 1 + first
        raise InputError(f"{path}: a face refers to vertex {wrong + first}, but the last is {last}; repair the mesh")
    if np.any(sizes < 3):
        count = int(np.sum(sizes < 3))
        warnings.warn(f"{path}: {count} faces of less than three corners are left out", SceneWarning, stacklevel=2)
    if normal_corners is not None:
        vertices, corners, normals = _split_by_normal(vertices, corners, normals, normal_corners)
    with np.errstate(all="ignore"):  # what is not finite is found out when the parts are joined
        triangles, doubtful = triangulated(vertices[corners], sizes)
    if doubtful:
        warnings.warn(
            f"{path}: {doubtful} of {len(sizes)} polygons cross themselves; how they are filled is a guess",
            SceneWarning,
            stacklevel=2,
        )
    return Part(vertices, corners[triangles], normals)


def without_comments(text: bytes) -> bytes:
    """The text without what stands behind a '#' in any line."""
    return re.sub(rb"#[^\n]*", b"", text) if b"#" in text else text


def _split_by_normal(
    vertices: Floats, corners: Indices, normals: Floats | None, normal_corners: Indices
) -> tuple[Floats, Indices, Floats | None]:
    """Vertices, corners and normals with one normal for each vertex."""
    if normals is None or not len(normals):
        return vertices, corners, None
    given = (normal_corners >= 0) & (normal_corners < len(normals))
    if not given.any():
        return vertices, corners, None
    normals = np.concatenate([normals, np.full((1, 3), np.nan)])
    chosen = np.where(given, normal_corners, len(normals) - 1)
    pairs, index = np.unique(corners * len(normals) + chosen, return_inverse=True)
    return vertices[pairs // len(normals)], index.reshape(-1), normals[pairs % len(normals)]
