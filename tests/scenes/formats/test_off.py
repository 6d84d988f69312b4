"""OFF: its headers, comments, columns and polygons."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stratalux.errors import InputError
from stratalux.scenes.formats import read_model
from stratalux.scenes.model import Part

ROWS = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]
FACES = "3 0 1 2\n3 0 2 3\n"


def part(folder: Path, text: str, encoding: str = "utf-8") -> Part:
    path = folder / "mesh.off"
    path.write_text(text, encoding=encoding)
    return read_model(path).parts[0]


def rows(more: str = "") -> str:
    return "".join(f"{row}{more}\n" for row in ROWS)


@pytest.mark.parametrize(
    "text",
    [
        "OFF\n4 2 0\n" + rows() + FACES,
        "OFF 4 2 0\n" + rows() + FACES,
        "OFF4 2 0\n" + rows() + FACES,
        "4 2 5\n" + rows() + FACES,
        "off\n4 2\n" + rows() + FACES,
        "OFF # a comment\n\n# another\n4 2 0\n\n" + rows(" # here") + "# too\n" + FACES,
        "COFF\n4 2 0\n" + rows(" 255 0 0 255") + "3 0 1 2 255 0 0\n3 0 2 3 0.5 0.5 0.5 1\n",
        "NOFF\n4 2 0\n" + rows(" 0 0 1") + FACES,
        "CNOFF\n4 2 0\n" + rows(" 0 0 1 1 1 1 1") + FACES,
        "STOFF\n4 2 0\n" + rows(" 0.5 0.5") + FACES,
        "4OFF\n4 2 0\n" + rows(" 1") + FACES,
        "OFF\r\n4 2 0\r\n" + rows() + FACES + "trailing words",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_all_headers_and_layouts(tmp_path: Path, text: str, encoding: str) -> None:
    found = part(tmp_path, text, encoding)
    np.testing.assert_array_equal(found.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(found.faces, [[0, 1, 2], [0, 2, 3]])
    if "N" in text[:3]:
        np.testing.assert_array_equal(found.normals, np.tile([0, 0, 1], (4, 1)))


def test_homogeneous_coordinates_are_divided(tmp_path: Path) -> None:
    found = part(tmp_path, "4OFF\n3 1 0\n0 0 0 1\n2 0 0 2\n0 4 0 2\n3 0 1 2\n")
    np.testing.assert_array_equal(found.vertices, [[0, 0, 0], [1, 0, 0], [0, 2, 0]])


def test_concave_polygons_of_different_sizes(tmp_path: Path) -> None:
    outline = "0 0 0\n2 0 0\n2 1 0\n1 1 0\n1 2 0\n0 2 0\n"
    found = part(tmp_path, "OFF\n6 2 0\n" + outline + "6 3 4 5 0 1 2\n4 0 1 2 3 0.5 0.5 0.5\n")
    a, b, c = np.moveaxis(found.vertices[found.faces], 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(3 + 1.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "how many vertices"),
        ("OFF\n", "how many vertices"),
        ("OFF\n4 2 0\n0 0 0\n", "cut short at 1 of the 4 vertices"),
        ("OFF\n4 2 0\n" + rows() + "3 0 1 2\n", "cut short at 1 of the 2 faces"),
        ("OFF\n4 2 0\n" + rows() + "3 0 1 2\n3 0", "cut short at 1 of the 2 faces"),
        ("OFF\n4 2 0\n" + rows() + "3 0 1\n3 0 1 2\n", "a face has less corners"),
        ("OFF\n4 2 0\n" + rows() + "3 0 1 4\n3 0 1 2\n", "refers to vertex 4, but the last is 3"),
        ("OFF\n4 2 0\n" + rows() + "3 0 1 -1\n3 0 1 2\n", "refers to vertex -1"),
        ("OFF\n-4 2 0\n" + rows() + FACES, "negative"),
        ("NOFF\n4 2 0\n" + rows() + FACES, "vertex 0 has less than 6 numbers"),
        ("OFF BINARY\n4 2 0\n", "binary OFF"),
        ("nOFF\n3\n4 2 0\n" + rows() + FACES, "n dimensions"),
    ],
)
def test_bad_files_are_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        part(tmp_path, text)


def test_colours_and_coordinates_of_vertices(tmp_path: Path) -> None:
    found = part(tmp_path, "STCNOFF\n4 2 0\n" + rows(" 0 0 1 255 0 51 128 0.25 0.75") + FACES)
    assert found.colours is not None and found.normals is not None
    np.testing.assert_allclose(found.colours, [[1, 0, 0.0331048, 128 / 255]] * 4, atol=1e-6)
    np.testing.assert_array_equal(found.uvs[0], [[0.25, 0.25]] * 4)
    np.testing.assert_array_equal(found.normals, [[0, 0, 1]] * 4)
    found = part(tmp_path, "COFF\n4 2 0\n" + rows(" 0.5 1.0 0.0") + FACES)
    np.testing.assert_array_equal(found.colours, [[0.5, 1, 0, 1]] * 4)
    assert found.uvs == {}


def test_colours_of_faces(tmp_path: Path) -> None:
    found = part(tmp_path, "OFF\n4 2 0\n" + rows() + "3 0 1 2 255 0 0\n3 0 2 3 0.5 0.5 0.5 0.25\n")
    assert found.colours is not None
    np.testing.assert_allclose(found.colours[found.faces], [[[1, 0, 0, 1]] * 3, [[0.5, 0.5, 0.5, 0.25]] * 3])
    assert part(tmp_path, "OFF\n4 2 0\n" + rows() + FACES.replace("\n", " 7\n")).colours is None
