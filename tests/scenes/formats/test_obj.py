"""OBJ: what its indices count from, its encodings and line ends, its polygons and normals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stratalux.errors import InputError, SceneWarning
from stratalux.scenes.formats import read_model
from stratalux.scenes.model import Part

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def part(folder: Path, text: str | bytes) -> Part:
    path = folder / "mesh.obj"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    model = read_model(path)
    assert len(model.parts) == len(model.instances) == 1
    return model.parts[0]


def triangles(found: Part) -> np.ndarray:
    return found.vertices[found.faces]


def area(found: Part) -> float:
    a, b, c = np.moveaxis(triangles(found), 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32"])
def test_line_ends_and_byte_order_marks(tmp_path: Path, end: str, encoding: str) -> None:
    text = (SQUARE + "f 1 2 3 4\n").replace("\n", end)
    found = part(tmp_path, text.encode(encoding))
    assert len(found.vertices) == 4
    np.testing.assert_array_equal(found.faces, [[0, 1, 2], [0, 2, 3]])


def test_a_name_in_any_encoding_does_no_harm(tmp_path: Path) -> None:
    assert len(part(tmp_path, b"o K\xf6rper \xff\xfe\n" + SQUARE.encode() + b"f 1 2 3\n").faces) == 1


@pytest.mark.parametrize(
    "faces",
    [
        "f 1 2 3\nf 1 3 4\n",
        "f 1/1 2/1 3/1\nf 1/1 3/1 4/1\n",
        "f 1//1 2//1 3//1\nf 1//1 3//1 4//1\n",
        "f 1/1/1 2/1/1 3/1/1\nf 1/1/1 3/1/1 4/1/1\n",
        "f 1 2/1 3//1\nf 1/1/1 3/ 4//\n",
        "f -4 -3 -2\nf -4/-1/-1 -2/-1/-1 -1/-1/-1\n",
        "  f\t1  2 3   \nf 1 3 4 # a comment\n",
        "f 1 \\\n2 3\nf 1 3\\\n 4\n",
        "f 1 2 3 4\n",
    ],
)
def test_all_ways_to_write_a_corner(tmp_path: Path, faces: str) -> None:
    found = part(tmp_path, SQUARE + "vt 0.5 0.5\nvn 0 0 1\n" + faces)
    expected = [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]
    np.testing.assert_array_equal(triangles(found), expected)


def test_negative_indices_count_from_their_face(tmp_path: Path) -> None:
    second = SQUARE.replace(" 0\n", " 5\n")
    found = part(tmp_path, SQUARE + "f -4 -3 -2 -1\n" + second + "f -4 -3 -2 -1\n")
    np.testing.assert_array_equal(found.vertices[found.faces][:, :, 2], [[0] * 3, [0] * 3, [5] * 3, [5] * 3])


def test_vertices_may_have_weights_or_colours(tmp_path: Path) -> None:
    found = part(tmp_path, "v 0 0 0 1\nv 1 0 0 0.5 0.5 0.5\nv 0 1 0\nf 1 2 3\n")
    np.testing.assert_array_equal(found.vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])


def test_concave_polygons_of_different_sizes(tmp_path: Path) -> None:
    outline = "v 2 0 0\nv 2 0 1\nv 1 0 1\nv 1 0 2\nv 0 0 2\nv 0 0 0\n"
    found = part(tmp_path, outline + "f 1 2 3 4 5 6\nf 1 2 3\nf 6 4 3 1\n")
    assert area(found) == pytest.approx(3 + 0.5 + 1.5)


def test_each_corner_has_its_normal(tmp_path: Path) -> None:
    found = part(tmp_path, SQUARE + "vn 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//2 3//2 4//2\n")
    assert found.normals is not None
    np.testing.assert_array_equal(found.normals[found.faces], [[[0, 0, 1]] * 3, [[0, 1, 0]] * 3])


def test_corners_without_a_normal_say_so(tmp_path: Path) -> None:
    found = part(tmp_path, SQUARE + "vn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\n")
    assert found.normals is not None
    missing = np.isnan(found.normals[found.faces]).all(axis=2)
    np.testing.assert_array_equal(missing, [[False] * 3, [True] * 3])
    assert part(tmp_path, SQUARE + "vn 0 0 1\nf 1 2 3\n").normals is None


def test_coordinates_are_read_in_double_precision(tmp_path: Path) -> None:
    found = part(tmp_path, "v 5411930.001 0 0\nv 5411930.002 0 0\nv 5411930.001 0.001 0\nf 1 2 3\n")
    assert area(found) == pytest.approx(0.5e-6, rel=1e-5)


def test_what_is_no_face_is_told(tmp_path: Path) -> None:
    with pytest.warns(SceneWarning, match=r"3 lines, points or free-form surfaces \(l p\) are left out"):
        part(tmp_path, SQUARE + "f 1 2 3\nl 1 2\nl 2 3\np 1\n")
    with pytest.warns(SceneWarning, match="1 faces of less than three corners"):
        part(tmp_path, SQUARE + "f 1 2 3\nf 1 2\n")
    with pytest.warns(SceneWarning, match="1 of 1 polygons cross themselves"):
        part(tmp_path, SQUARE + "f 1 3 2 4\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SQUARE + "f 1 2 5\n", "a face refers to vertex 5, but the last is 4"),
        (SQUARE + "f 0 1 2\n", "a vertex before the first"),
        (SQUARE + "f -5 1 2\n", "a vertex before the first"),
        (SQUARE + "f 1 2 x\n", "'x' is not a whole number"),
        (SQUARE + "f 1 2 3.5\n", "'3.5' is not a whole number"),
        (SQUARE + "f 1/1/1/1 2/1/1/1 3/1/1/1\n", "4 indices"),
        (SQUARE + "v 1 2\nf 1 2 3\n", "the line 'v 1 2' has less than three numbers"),
        (SQUARE + "v 1,5 2,0 0,1\nf 1 2 3\n", "'1,5' is not a number"),
    ],
)
def test_bad_lines_are_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        part(tmp_path, text)
