"""glTF: everything that says where its triangles are."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux.errors import InputError, SceneWarning
from stratalux.scenes.formats import read_model
from tests.scenes.formats.gltf_files import Gltf

Array = NDArray[np.float64]

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
OUTWARDS = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


def corners(path: Path) -> Array:
    """The triangles (T, 3, 3) of all instances in the scene; the winding is turned around by what mirrors."""
    model = read_model(path)
    found = []
    for instance in model.instances:
        part, matrix = model.parts[instance.part], instance.matrix
        points = part.vertices[part.faces] @ matrix[:3, :3].T + matrix[:3, 3]
        found.append(points[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else points)
    return np.concatenate(found)


def moved(points: Array, x: float = 0, z: float = 0) -> Array:
    return points + np.array([x, 0, z])


def volume(triangles: Array) -> float:
    return float(np.linalg.det(triangles).sum() / 6)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "scene.glb"


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4", None])
def test_triangles_with_every_type_of_index(file: Path, dtype: str | None) -> None:
    gltf = Gltf()
    order = np.array(OUTWARDS).ravel()
    primitive = gltf.primitive(TETRAHEDRON if dtype else TETRAHEDRON[order])
    if dtype:
        primitive["indices"] = gltf.accessor(order, dtype)
    gltf.show(primitive)
    np.testing.assert_array_equal(corners(gltf.write(file)), TETRAHEDRON[OUTWARDS])


@pytest.mark.parametrize("indexed", [False, True])
def test_strips_and_fans_turn_one_way(file: Path, indexed: bool) -> None:
    """A plate of four squares as a strip, and a disk of six triangles as a fan: all look along +z."""
    plate = np.array([[x, y, 0] for x in range(5) for y in (1, 0)], dtype=float)
    angles = np.arange(7) * np.pi / 3
    disk = np.concatenate([[[0, 0, 0]], np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)])
    for mode, points, area in ((5, plate, 4.0), (6, disk, 1.5 * np.sqrt(3))):
        gltf = Gltf()
        if indexed:
            gltf.show(gltf.primitive(points[::-1], np.arange(len(points))[::-1], mode=mode))
        else:
            gltf.show(gltf.primitive(points, mode=mode))
        a, b, c = np.moveaxis(corners(gltf.write(file)), 1, 0)
        vectors = np.cross(b - a, c - a) / 2
        assert np.all(vectors[:, 2] > 0)
        assert vectors[:, 2].sum() == pytest.approx(area, rel=1e-6)


def test_points_and_lines_are_left_out_with_a_warning(file: Path) -> None:
    gltf = Gltf()
    gltf.show(*(gltf.primitive(TRIANGLE, mode=mode) for mode in range(5)))
    with pytest.warns(SceneWarning, match="4 primitives are left out") as caught:
        assert len(corners(gltf.write(file))) == 1
    assert len(caught) == 1


def test_interleaved_attributes(file: Path) -> None:
    gltf = Gltf()
    rows = np.concatenate([np.tile([0, 0, 1.0], (4, 1)), TETRAHEDRON], axis=1).astype("<f4")
    view = gltf.view(b"\0" * 8 + rows.tobytes(), byteStride=24)
    common = {"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC3"}
    normal, position = (gltf.add("accessors", byteOffset=offset, **common) for offset in (8, 20))
    indices = gltf.accessor(np.ravel(OUTWARDS), "u1")
    gltf.show({"attributes": {"POSITION": position, "NORMAL": normal}, "indices": indices})
    np.testing.assert_array_equal(corners(gltf.write(file)), TETRAHEDRON[OUTWARDS])
    np.testing.assert_array_equal(read_model(file).parts[0].normals, np.tile([0, 0, 1], (4, 1)))


@pytest.mark.parametrize(("dtype", "largest"), [("i1", 127), ("u1", 255), ("i2", 32767), ("u2", 65535)])
@pytest.mark.parametrize("normalized", [True, False])
def test_quantised_positions(file: Path, dtype: str, largest: int, normalized: bool) -> None:
    """Integers are fractions of the largest one if they are said to be, and themselves otherwise."""
    gltf = Gltf()
    gltf.require("KHR_mesh_quantization")
    more = {"normalized": True} if normalized else {}
    position = gltf.accessor(TETRAHEDRON * largest, dtype, **more)
    normal = gltf.accessor(np.tile([0, 0, 127], (4, 1)), "i1", normalized=True)
    scale = 3.0 if normalized else 3.0 / largest
    gltf.show(
        {"attributes": {"POSITION": position, "NORMAL": normal}, "indices": gltf.accessor(np.ravel(OUTWARDS), "u1")},
        scale=[scale] * 3,
        translation=[5, 0, 0],
    )
    np.testing.assert_allclose(corners(gltf.write(file)), moved(3 * TETRAHEDRON[OUTWARDS], x=5), rtol=1e-12)
    np.testing.assert_array_equal(read_model(file).parts[0].normals, np.tile([0, 0, 1], (4, 1)))


def test_the_lowest_signed_integer_is_minus_one(file: Path) -> None:
    gltf = Gltf()
    position = gltf.accessor([[-128, -127, 0], [127, 0, 0], [0, 64, 0]], "i1", normalized=True)
    gltf.show({"attributes": {"POSITION": position}})
    np.testing.assert_allclose(corners(gltf.write(file))[0], [[-1, -1, 0], [1, 0, 0], [0, 64 / 127, 0]])


@pytest.mark.parametrize("with_base", [True, False])
def test_sparse_accessors(file: Path, with_base: bool) -> None:
    gltf = Gltf()
    position = gltf.accessor([[9, 9, 9], [1, 0, 0], [0, 1, 0]] if with_base else np.zeros((3, 3)))
    accessor = gltf.json["accessors"][position]
    if not with_base:
        del accessor["bufferView"]
    values = TRIANGLE[:1] if with_base else TRIANGLE[1:]
    places = np.array([0] if with_base else [1, 2], "<u2")
    accessor["sparse"] = {
        "count": len(values),
        "indices": {"bufferView": gltf.view(places.tobytes()), "componentType": 5123},
        "values": {"bufferView": gltf.view(values.astype("<f4").tobytes())},
    }  # fmt: skip
    gltf.show({"attributes": {"POSITION": position}})
    np.testing.assert_array_equal(corners(gltf.write(file))[0], TRIANGLE)


def test_nodes_share_a_mesh_and_stack_their_transforms(file: Path) -> None:
    gltf = Gltf()
    shown = gltf.show(gltf.primitive(TRIANGLE), rotation=[0, 0, np.sqrt(0.5), np.sqrt(0.5)], scale=[2, 3, 4])
    matrix = np.eye(4)
    matrix[:3, 3] = [0, 0, 7]
    gltf.add("nodes", mesh=0, matrix=matrix.T.ravel().tolist())
    gltf.add("nodes", translation=[10, 0, 0], children=[shown, 1])
    model = read_model(gltf.write(file))
    assert len(model.parts) == 1
    # A quarter of a turn about z takes x to y, and y to -x.
    expected = moved(np.array([[[0, 0, 0], [0, 2, 0], [-3, 0, 0]], moved(TRIANGLE, z=7)]), x=10)
    np.testing.assert_allclose(sorted(corners(file).tolist()), sorted(expected.tolist()), atol=1e-7)


@pytest.mark.parametrize("scale", [[-1, 1, 1], [-1, -2, -3], [-2, -2, 2]])
def test_what_mirrors_keeps_its_outside(file: Path, scale: list[float]) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TETRAHEDRON, np.ravel(OUTWARDS)), scale=scale)
    assert volume(corners(gltf.write(file))) == pytest.approx(abs(np.prod(scale)) / 6)


def test_instances(file: Path) -> None:
    gltf = Gltf()
    gltf.require("EXT_mesh_gpu_instancing")
    half = round(np.sqrt(0.5) * 32767)
    attributes = {
        "TRANSLATION": gltf.accessor([[0, 0, 0], [5, 0, 0], [0, 5, 0]]),
        "ROTATION": gltf.accessor([[0, 0, 0, 32767], [0, 0, half, half], [0, 0, 32767, 0]], "i2", normalized=True),
        "SCALE": gltf.accessor([[1, 1, 1], [2, 2, 2], [1, 2, 1]]),
        "_COLOUR": gltf.accessor([[1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    }
    gltf.show(
        gltf.primitive(TRIANGLE),
        translation=[100, 0, 0],
        extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}},
    )
    expected = np.array([TRIANGLE, [[5, 0, 0], [5, 2, 0], [3, 0, 0]], [[0, 5, 0], [-1, 5, 0], [0, 3, 0]]])
    np.testing.assert_allclose(corners(gltf.write(file)), moved(expected, x=100), atol=1e-4)
    model = read_model(file)
    assert (len(model.parts), len(model.instances)) == (1, 3)


@pytest.mark.parametrize("column", ["TRANSLATION", "SCALE"])
def test_instances_without_some_of_the_columns(file: Path, column: str) -> None:
    gltf = Gltf()
    table = {column: gltf.accessor([[1, 1, 1], [2, 2, 2]])}
    gltf.show(gltf.primitive(TRIANGLE), extensions={"EXT_mesh_gpu_instancing": {"attributes": table}})
    expected = [TRIANGLE + 1, TRIANGLE + 2] if column == "TRANSLATION" else [TRIANGLE, 2 * TRIANGLE]
    np.testing.assert_array_equal(corners(gltf.write(file)), expected)


@pytest.mark.parametrize(
    ("mesh", "node", "expected"),
    [
        ({}, {}, [0, 0]),
        ({"weights": [1, 0]}, {}, [1, 0]),
        ({"weights": [1, 1]}, {}, [1, 1]),
        ({"weights": [1, 1]}, {"weights": [0, -0.5]}, [0, -0.5]),
    ],
)
def test_morph_targets(file: Path, mesh: dict[str, Any], node: dict[str, Any], expected: list[float]) -> None:
    gltf = Gltf()
    first, second = np.array([[0, 0, 2], [0, 0, 0], [1, 1, 1]]), np.array([[0, 3, 0], [0, 0, 0], [0, 0, 0]])
    sparse = gltf.add("accessors", componentType=5126, type="VEC3", count=3, sparse={
        "count": 1,
        "indices": {"bufferView": gltf.view(b"\0"), "componentType": 5121},
        "values": {"bufferView": gltf.view(np.array([0, 3, 0], "<f4").tobytes())},
    })  # fmt: skip
    targets = [{"POSITION": gltf.accessor(first)}, {"POSITION": sparse}]
    gltf.show(gltf.primitive(TRIANGLE, targets=targets), mesh=mesh, **node)
    np.testing.assert_allclose(
        corners(gltf.write(file))[0], TRIANGLE + expected[0] * first + expected[1] * second, atol=1e-6
    )


def test_nodes_with_weights_of_their_own_have_shapes_of_their_own(file: Path) -> None:
    gltf = Gltf()
    targets = [{"POSITION": gltf.accessor([[0, 0, 1]] * 3), "NORMAL": gltf.accessor([[0, 1, -1]] * 3)}]
    normals = {"NORMAL": gltf.accessor([[0, 0, 1]] * 3)}
    gltf.show(gltf.primitive(TRIANGLE, targets=targets, attributes=normals), weights=[1])
    gltf.add("nodes", mesh=0, weights=[2])
    gltf.add("nodes", mesh=0, weights=[1], translation=[0, 0, 10])
    model = read_model(gltf.write(file))
    assert [part.vertices[0, 2] for part in model.parts] == [1, 2]
    assert model.parts[0].normals is not None
    np.testing.assert_array_equal(model.parts[0].normals[0], [0, 1, 0])
    np.testing.assert_array_equal(corners(file)[:, 0, 2], [1, 2, 11])


def bent(gltf: Gltf, sets: int = 1) -> dict[str, Any]:
    """A triangle whose corners hang on joint 0, on joint 1, and half on each, in one or two sets of influences."""
    joints, weights = np.zeros((3, 4 * sets)), np.zeros((3, 4 * sets))
    last = 4 * sets - 1
    joints[:, last] = 1
    weights[:, 0], weights[:, last] = [1, 0, 0.5], [0, 1, 0.5]
    found = gltf.primitive(TRIANGLE, attributes={"NORMAL": gltf.accessor([[0, 0, 1]] * 3)})
    for n in range(sets):
        found["attributes"][f"JOINTS_{n}"] = gltf.accessor(joints[:, 4 * n : 4 * n + 4], "u1")
        found["attributes"][f"WEIGHTS_{n}"] = gltf.accessor(weights[:, 4 * n : 4 * n + 4] * 255, "u1", normalized=True)
    return found


@pytest.mark.parametrize("sets", [1, 2])
def test_skins_follow_their_joints_and_nothing_else(file: Path, sets: int) -> None:
    gltf = Gltf()
    inverse = np.tile(np.eye(4), (2, 1, 1))
    inverse[1, :3, 3] = [-1, 0, 0]  # joint 1 was at (1, 0, 0) when the skin was made
    skin = gltf.add("skins", joints=[1, 2], inverseBindMatrices=gltf.accessor(inverse.transpose(0, 2, 1)))
    gltf.show(bent(gltf, sets), skin=skin, translation=[1000, 0, 0], scale=[9, 9, 9])
    gltf.add("nodes", translation=[0, 0, 5], children=[2])
    gltf.add("nodes", translation=[1, 0, 0], rotation=[0, 0, 1, 0])  # half a turn about z
    expected = np.array([[0, 0, 5], [1, 0, 5], 0.5 * np.array([0, 1, 5]) + 0.5 * np.array([2, -1, 5])])
    np.testing.assert_allclose(corners(gltf.write(file))[0], expected, atol=1e-6)
    normals = read_model(file).parts[0].normals
    assert normals is not None
    np.testing.assert_allclose(normals[:2], [[0, 0, 1]] * 2, atol=1e-6)


def test_a_skin_without_matrices_and_one_that_mirrors(file: Path) -> None:
    gltf = Gltf()
    skin = gltf.add("skins", joints=[1])
    primitive = gltf.primitive(TETRAHEDRON, np.ravel(OUTWARDS))
    primitive["attributes"]["JOINTS_0"] = gltf.accessor(np.zeros((4, 4)), "u2")
    primitive["attributes"]["WEIGHTS_0"] = gltf.accessor(np.tile([2.0, 0, 0, 0], (4, 1)))  # weights add up to one
    primitive["attributes"]["NORMAL"] = gltf.accessor(np.tile([0.6, 0.8, 0], (4, 1)))
    gltf.show(primitive, skin=skin)
    gltf.add("nodes", scale=[-3, 1, 1])
    found = corners(gltf.write(file))
    assert found[..., 0].min() == -3
    assert volume(found) == pytest.approx(0.5)
    normals = read_model(file).parts[0].normals
    assert normals is not None
    expected = np.array([-0.2, 0.8, 0]) / np.hypot(0.2, 0.8)
    np.testing.assert_allclose(
        normals / np.linalg.norm(normals, axis=1, keepdims=True), np.tile(expected, (4, 1)), atol=1e-6
    )


def draco(gltf: Gltf, **primitive: Any) -> dict[str, Any]:
    DracoPy = pytest.importorskip("DracoPy")
    packed = DracoPy.encode(TETRAHEDRON.astype(np.float32), np.array(OUTWARDS, np.uint32), preserve_order=True)
    position = gltf.add("accessors", componentType=5126, count=4, type="VEC3")
    indices = gltf.add("accessors", componentType=5123, count=12, type="SCALAR")
    extension = {"bufferView": gltf.view(packed), "attributes": {"POSITION": 0}}
    return {
        "attributes": {"POSITION": position}, "indices": indices,
        "extensions": {"KHR_draco_mesh_compression": extension}, **primitive,
    }  # fmt: skip


def test_draco(file: Path) -> None:
    gltf = Gltf()
    gltf.require("KHR_draco_mesh_compression")
    gltf.show(draco(gltf), scale=[2, 2, 2])
    found = corners(gltf.write(file))
    assert volume(found) == pytest.approx(8 / 6, rel=1e-3)
    np.testing.assert_allclose([found.min(), found.max()], [0, 2], atol=1e-3)


def test_draco_without_its_package(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gltf = Gltf()
    gltf.show(draco(gltf))
    gltf.write(file)
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    with pytest.raises(InputError, match=r"compressed with Draco.* pip install 'stratalux\[gltf\]'"):
        read_model(file)


def test_plain_data_beside_compressed_ones_are_enough(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gltf = Gltf()
    primitive = draco(gltf)
    primitive |= gltf.primitive(TETRAHEDRON, np.ravel(OUTWARDS))
    gltf.show(primitive)
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    np.testing.assert_array_equal(corners(gltf.write(file)), TETRAHEDRON[OUTWARDS])


def test_damaged_draco_data(file: Path) -> None:
    gltf = Gltf()
    gltf.show(draco(gltf))
    whole = gltf.binary
    gltf.binary = bytes(len(whole))
    with pytest.raises(InputError, match="Draco data cannot be decoded"):
        read_model(gltf.write(file))
    gltf.binary = whole
    gltf.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"]["POSITION"] = 5
    with pytest.raises(InputError, match="Draco data hold no POSITION"):
        read_model(gltf.write(file))


def test_draco_data_that_promise_too_much(file: Path) -> None:
    """The numbers of faces and of points, 4 and 4 in bytes 11 and 12, become 2³¹."""
    gltf = Gltf()
    primitive = draco(gltf)
    view = gltf.json["bufferViews"][-1]
    data = gltf.binary[view["byteOffset"] :][: view["byteLength"]]
    assert data[11:13] == b"\4\4"
    many = b"\x80\x80\x80\x80\x08"
    primitive["extensions"]["KHR_draco_mesh_compression"]["bufferView"] = gltf.view(data[:11] + 2 * many + data[13:])
    gltf.show(primitive)
    with pytest.raises(InputError, match="Draco data cannot be decoded"):
        read_model(gltf.write(file))


@pytest.mark.parametrize("name", ["ACME_shapes", "KHR_materials_glitter", "KHR_texture_procedurals"])
def test_extensions_that_are_required_and_not_supported(file: Path, name: str) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TRIANGLE))
    gltf.require("KHR_mesh_quantization", name)
    with pytest.raises(InputError, match=f"requires {name}, which is not supported; export it without"):
        read_model(gltf.write(file))


def test_extensions_that_change_no_shape_are_accepted(file: Path) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TRIANGLE))
    gltf.require("KHR_materials_unlit", "KHR_texture_transform", "KHR_lights_punctual", "EXT_texture_webp")
    assert len(corners(gltf.write(file))) == 1
    gltf.json |= {"extensionsUsed": ["ACME_shapes"], "extensionsRequired": []}
    assert len(corners(gltf.write(file))) == 1


@pytest.mark.parametrize("chosen", [None, 0, 1])
def test_one_scene_is_shown_and_the_others_are_named(file: Path, chosen: int | None) -> None:
    gltf = Gltf()
    for place in range(3):
        gltf.show(gltf.primitive(moved(TRIANGLE, x=place)))
    gltf.json["scenes"] = [{"nodes": [0], "name": "first"}, {"nodes": [1, 2], "name": "second"}]
    if chosen is not None:
        gltf.json["scene"] = chosen
    names = ("second", "first") if chosen else ("first", "second")
    with pytest.warns(SceneWarning, match=f"shown is the scene '{names[0]}'; left out: '{names[1]}'"):
        found = corners(gltf.write(file))
    np.testing.assert_array_equal(found[:, 0, 0], [1, 2] if chosen else [0])


def test_without_scenes_all_nodes_are_shown(file: Path) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TRIANGLE))
    gltf.add("nodes", mesh=0, translation=[1, 0, 0])
    assert len(corners(gltf.write(file))) == 2


def test_hidden_nodes_hide_what_is_below_them(file: Path) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TRIANGLE))
    gltf.add("nodes", mesh=0, translation=[1, 0, 0])
    gltf.add("nodes", children=[1], extensions={"KHR_node_visibility": {"visible": False}})
    np.testing.assert_array_equal(corners(gltf.write(file)), [TRIANGLE])


@pytest.mark.parametrize("how", ["data", "percent", "plain.bin", "a ü %20 name.bin"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_gltf_files_and_where_their_buffers_are(tmp_path: Path, how: str, encoding: str) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TRIANGLE))
    path = gltf.write(tmp_path / "scene.gltf", how=how, encoding=encoding)
    np.testing.assert_array_equal(corners(path), [TRIANGLE])


@pytest.mark.parametrize("name", ["", "a", "ab", "abc"])
def test_json_that_is_padded_with_zeros_against_the_rules(file: Path, name: str) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TRIANGLE), name=name)
    np.testing.assert_array_equal(corners(gltf.write(file, padding="\0")), [TRIANGLE])


def test_a_node_far_away_keeps_its_detail(file: Path) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TRIANGLE * 0.001), translation=[5411930.123, 0, 448250.5])
    found = corners(gltf.write(file))[0]
    np.testing.assert_allclose(found - found[0], TRIANGLE * 0.001, atol=2e-9)
    np.testing.assert_allclose(found[0], [5411930.123, 0, 448250.5], rtol=1e-15)


def test_a_binary_file_that_is_cut_short(file: Path) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TRIANGLE))
    data = gltf.write(file).read_bytes()
    for kept in (40, len(data) - 44, len(data) - 36, len(data) - 1):
        file.write_bytes(data[:kept])
        with pytest.raises(InputError, match=f"cut short at {kept} of its {len(data)} bytes"):
            read_model(file)
    file.write_bytes(data + b"more")
    assert len(corners(file)) == 1


def change(document: dict[str, Any], path: str, value: Any) -> None:
    *keys, last = path.split("/")
    place: Any = document
    for key in keys:
        place = place[int(key) if key.isdigit() else key]
    place[last] = value


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("asset/version", "1.0", "glTF '1.0' is not supported"),
        ("nodes/0/mesh", 7, "there is no object 7"),
        ("nodes/0/mesh", -1, "there is no object -1"),
        ("nodes/0/children", [0], "its own ancestor"),
        ("nodes/0/children", [1, 1], "two parents"),
        ("accessors/0/count", 4, "reach beyond buffer view"),
        ("accessors/0/count", -4, "no faces"),
        ("accessors/0/byteOffset", 4, "reach beyond buffer view"),
        ("accessors/0/type", "VEC2", "not 3 numbers"),
        ("accessors/0/componentType", 5130, "unreadable"),
        ("bufferViews/0/byteLength", 1000, "beyond its buffer"),
        ("bufferViews/0/byteOffset", -4, "beyond its buffer"),
        ("buffers", [{"byteLength": 1000}], "buffer 0 has .* of its 1000 bytes"),
        ("buffers", [{"byteLength": 1, "uri": "gone.bin"}], "the file 'gone.bin' that it refers to is not there"),
        ("buffers", [{"byteLength": 1, "uri": "https://example.org/a.bin"}], "refers to 'https://example.org"),
        ("scene", 3, "there is no object 3"),
        ("nodes", "nonsense", "unreadable"),
    ],
)
def test_damaged_documents_are_one_line(file: Path, path: str, value: Any, message: str) -> None:
    gltf = Gltf(scenes=[{"nodes": [0]}])
    gltf.show(gltf.primitive(TRIANGLE))
    gltf.add("nodes")
    change(gltf.json, path, value)
    with pytest.raises(InputError, match=message) as caught:
        read_model(gltf.write(file))
    assert "\n" not in str(caught.value)


def test_indices_and_joints_beyond_the_end(file: Path) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TRIANGLE, [0, 1, 3]))
    with pytest.raises(InputError, match="a face refers to vertex 3 of 3"):
        read_model(gltf.write(file))
    gltf = Gltf()
    gltf.show(bent(gltf), skin=gltf.add("skins", joints=[0]))
    with pytest.raises(InputError, match="beyond the 1 of its skin"):
        read_model(gltf.write(file))


@pytest.mark.parametrize("node", [{"translation": [math.inf, 0, 0]}, {"scale": [1e308, 1, 1]}])
def test_places_that_are_no_numbers(file: Path, node: dict[str, Any]) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TRIANGLE), **node)
    gltf.add("nodes", scale=[1e308, 1, 1], children=[0])
    with pytest.raises(InputError, match="the place of a node is not a finite number"):
        read_model(gltf.write(file))
    gltf.json["scenes"] = [{"nodes": [2]}]
    gltf.add("nodes", mesh=0)
    assert len(corners(gltf.write(file))) == 1


def test_instances_and_joints_that_are_no_numbers(file: Path) -> None:
    gltf = Gltf()
    table = {"TRANSLATION": gltf.accessor([[0, 0, 0], [0, math.nan, 0]])}
    gltf.show(gltf.primitive(TRIANGLE), extensions={"EXT_mesh_gpu_instancing": {"attributes": table}})
    with pytest.raises(InputError, match="the place of a node is not a finite number"):
        read_model(gltf.write(file))
    gltf = Gltf()
    inverse = gltf.accessor(np.full((2, 4, 4), math.inf))
    gltf.show(bent(gltf), skin=gltf.add("skins", joints=[0, 0], inverseBindMatrices=inverse))
    with pytest.raises(InputError, match="the place of a node is not a finite number"):
        read_model(gltf.write(file))


def test_indices_that_are_no_whole_numbers(file: Path) -> None:
    gltf = Gltf()
    gltf.show({**gltf.primitive(TRIANGLE), "indices": gltf.accessor([0.0, 1, 2])})
    with pytest.raises(InputError, match="indices are no whole numbers"):
        read_model(gltf.write(file))


def test_an_accessor_without_data_cannot_ask_for_any_memory(file: Path) -> None:
    gltf = Gltf()
    gltf.show({"attributes": {"POSITION": gltf.add("accessors", componentType=5126, type="VEC3", count=1 << 40)}})
    with pytest.raises(InputError, match="has 1099511627776 elements, and no data"):
        read_model(gltf.write(file))
