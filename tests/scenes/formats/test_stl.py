"""STL: binary and text, and how they are told apart."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from stratalux.errors import InputError, SceneWarning
from stratalux.scenes.formats import read_model
from stratalux.scenes.model import Part

TRIANGLES = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 5], [1, 0, 5], [0, 1, 5]]], dtype=np.float32)


def binary(header: bytes = b"made by a test", count: int = 2) -> bytes:
    rows = b"".join(struct.pack("<12fH", 0, 0, 1, *triangle.ravel(), 0) for triangle in TRIANGLES)
    return header.ljust(80, b"\0") + struct.pack("<I", count) + rows


def solid(name: str, triangles: np.ndarray, end: str = "endsolid\n") -> str:
    lines = [f"solid {name}\n"]
    for triangle in triangles:
        corners = "".join(f"      vertex {x:g} {y:g} {z:g}\n" for x, y, z in triangle)
        lines.append(f"  facet normal 0 0 1\n    outer loop\n{corners}    endloop\n  endfacet\n")
    return "".join(lines) + end


def part(folder: Path, data: bytes | str) -> Part:
    path = folder / "mesh.stl"
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return read_model(path).parts[0]


@pytest.mark.parametrize(
    "data",
    [
        binary(),
        binary(b"solid though binary"),
        binary(b"solid facet normal vertex"),
        binary() + b"\0\0\n",
        solid("", TRIANGLES),
        solid("a vertex 1 2 3", TRIANGLES).upper(),
        solid("two", TRIANGLES[:1]) + solid("solids", TRIANGLES[1:]),
        solid("", TRIANGLES).replace("\n", "\r\n"),
        solid("", TRIANGLES).encode("utf-8-sig"),
        solid("", TRIANGLES).encode("utf-16"),
        solid("", TRIANGLES) + "and something else\x1a",
        solid("", TRIANGLES).replace(" 1 ", " 1.0E+00 "),
    ],
)
def test_all_ways_to_write_two_triangles(tmp_path: Path, data: bytes | str) -> None:
    found = part(tmp_path, data)
    np.testing.assert_array_equal(found.vertices[found.faces], TRIANGLES)
    assert found.normals is None


def test_facets_of_four_corners(tmp_path: Path) -> None:
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]])
    assert len(part(tmp_path, solid("", square) + solid("", TRIANGLES)).faces) == 4


def test_bytes_behind_the_last_triangle_are_told(tmp_path: Path) -> None:
    with pytest.warns(SceneWarning, match="5 bytes behind the last triangle are ignored"):
        assert len(part(tmp_path, binary() + b"extra").faces) == 2


def test_text_in_double_precision(tmp_path: Path) -> None:
    found = part(tmp_path, solid("", TRIANGLES[:1]).replace("vertex 0", "vertex 5411930.001"))
    assert found.vertices[0, 0] == 5411930.001


def test_text_without_an_end_is_told(tmp_path: Path) -> None:
    with pytest.warns(SceneWarning, match="does not end with 'endsolid'"):
        assert len(part(tmp_path, solid("", TRIANGLES, end="")).faces) == 2


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (binary(count=3), "cut short at 2 of the 3 triangles"),
        (binary()[:-1], "cut short at 1 of the 2 triangles"),
        (b"", "neither a binary STL file nor one of text"),
        (b"solid", "cut short within triangle 0"),
        (solid("", TRIANGLES)[:-90], "cut short within triangle 1"),
        (solid("", TRIANGLES).replace("vertex 1 0 0", "vertex 1 0-0 0"), "'0-0' is not a number"),
    ],
)
def test_bad_files_are_named(tmp_path: Path, data: bytes | str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        part(tmp_path, data)
