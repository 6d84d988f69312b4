"""OBJ: what its indices count from, its encodings and line ends, its polygons and normals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stratalux.errors import InputError, SceneWarning
from stratalux.scenes.formats import read_model
from stratalux.scenes.model import Part
from tests.helpers import asset

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


UVS = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"


def parts(folder: Path, text: str, mtl: str = "newmtl red\nKd 1 0 0\nnewmtl my blue\nKd 0 0 1\n") -> list[Part]:
    (folder / "my things.mtl").write_text(mtl)
    path = folder / "mesh.obj"
    path.write_text(text)
    return list(read_model(path).parts)


def corners(found: Part, values: np.ndarray) -> list[object]:
    return list(values[found.faces].tolist())


@pytest.mark.parametrize("faces", ["f 1/1 2/2 3/3\n", "f 1/1/1 2/2/1 3/3/1\n", "f -4/-4 -3/-3 -2/-2\n"])
def test_coordinates_of_textures_go_down(tmp_path: Path, faces: str) -> None:
    found = part(tmp_path, SQUARE + UVS + "vn 0 0 1\n" + faces)
    assert corners(found, found.uvs[0]) == [[[0, 1], [1, 1], [1, 0]]]


def test_a_vertex_with_several_coordinates_is_split(tmp_path: Path) -> None:
    found = part(tmp_path, SQUARE + "vt 0.25\nvt 0.5 0.5 9\nf 1/1 2/1 3/1\nf 1/2 3/2 4\n")
    assert corners(found, found.uvs[0]) == [[[0.25, 1]] * 3, [[0.5, 0.5], [0.5, 0.5], [0, 0]]]
    assert triangles(found).tolist() == [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]
    assert len(found.vertices) == 6
    assert found.normals is None
    assert part(tmp_path, SQUARE + UVS + "f 1 2 3\n").uvs == {}


def test_coordinates_that_are_not_there_are_told(tmp_path: Path) -> None:
    with pytest.warns(SceneWarning, match="2 corners refer to coordinates of textures that are not there"):
        part(tmp_path, SQUARE + UVS + "f 1/1 2/5 3/-5\n")
    with pytest.warns(SceneWarning, match="3 corners refer to normals that are not there"):
        part(tmp_path, SQUARE + "f 1//1 2//2 3//3\n")


def test_colours_behind_positions_are_made_linear(tmp_path: Path) -> None:
    found = part(tmp_path, "v 0 0 0 0.5 1 0\nv 1 0 0\nv 0 1 0 0 0 0.02 \nf 1 2 3\n")
    assert found.colours is not None
    expected = [[0.214041, 1, 0, 1], [1, 1, 1, 1], [0, 0, 0.02 / 12.92, 1]]
    np.testing.assert_allclose(found.colours, expected, atol=1e-6)
    with pytest.warns(SceneWarning, match="colours of vertices are above 1"):
        found = part(tmp_path, "v 0 0 0 255 0 0\nv 1 0 0 0 0 0\nv 0 1 0\nf 1 2 3\n")
    assert found.colours is not None
    np.testing.assert_allclose(found.colours, [[1, 0, 0, 1], [0, 0, 0, 1], [1, 1, 1, 1]], atol=1e-6)
    assert part(tmp_path, "v 0 0 0 1\nv 1 0 0 1\nv  0  1  0   1 \nf 1 2 3\n").colours is None


def test_one_part_for_each_material(tmp_path: Path) -> None:
    faces = "f 1 2 3\nusemtl red\nf 1/1 2/2 3/3\ng x\nusemtl my blue\nf 1 3 4\nusemtl red\nf 3 4 1 2\n"
    none, red, blue = parts(tmp_path, "mtllib my things.mtl\n" + SQUARE + UVS + faces)
    assert none.material is None and red.material and blue.material
    assert [each.name for each in (none, red, blue)] == ["", "red", "my blue"]
    assert red.material.base_colour.factor == (1, 0, 0) and blue.material.base_colour.factor == (0, 0, 1)
    assert [area(each) for each in (none, red, blue)] == [0.5, 1.5, 0.5]
    assert corners(blue, blue.vertices) == [[[0, 0, 0], [1, 1, 0], [0, 1, 0]]]
    assert len(blue.vertices) == 3
    assert red.uvs[0][red.faces[0]].tolist() == [[0, 1], [1, 1], [1, 0]]


def test_several_libraries(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "other.mtl").write_text("newmtl green\nKd 0 1 0\nnewmtl red\nKd 0 0 0\n")
    text = SQUARE + "usemtl red\nf 1 2 3\nusemtl green\nf 1 3 4\n"
    for libraries in (
        "mtllib my things.mtl sub/other.mtl\n",
        "mtllib my things.mtl\nmtllib .\\sub\\other.mtl\n",
        "mtllib C:\\of others\\My Things.mtl\nmtllib ./sub/other.mtl\n",
    ):
        red, green = parts(tmp_path, libraries + text)
        assert red.material and red.material.base_colour.factor == (1, 0, 0)
        assert green.material and green.material.base_colour.factor == (0, 1, 0)


def test_materials_that_are_missing_are_told(tmp_path: Path) -> None:
    with pytest.warns(SceneWarning, match="its materials 'not here.mtl' are not there"):
        (found,) = parts(tmp_path, "mtllib not here.mtl\n" + SQUARE + "usemtl red\nf 1 2 3\n")
    assert found.material is None
    with pytest.warns(SceneWarning, match=r"1 of its materials are in none of its libraries, and left out \('gold'\)"):
        none, red = parts(tmp_path, "mtllib my things.mtl\n" + SQUARE + "usemtl red\nf 1 2 3\nusemtl gold\nf 1 3 4\n")
    assert none.material is None and red.material
    with pytest.warns(SceneWarning, match="1 of its materials are in none of its libraries"):
        parts(tmp_path, SQUARE + "usemtl red\nf 1 2 3\n")


def test_a_real_file() -> None:
    with pytest.warns(SceneWarning, match="'Tr 1' without 'd' is taken for opaque"):
        (found,) = read_model(asset("models/fuze.obj")).parts
    assert found.material and found.material.base_colour.texture and found.material.alpha_mode == "opaque"
    assert found.material.base_colour.texture.picture.path == asset("models/fuze uv.jpg")
    assert found.faces.shape == (1000, 3) and len(found.uvs[0]) == len(found.vertices)
    # The same mesh as PLY has its texture at the same places.
    other = read_model(asset("models/fuze.ply")).parts[0]
    assert other.material and other.material.base_colour.texture
    np.testing.assert_allclose(other.vertices[other.faces], found.vertices[found.faces], atol=1e-5)
    np.testing.assert_allclose(other.uvs[0][other.faces], found.uvs[0][found.faces], atol=1e-5)
