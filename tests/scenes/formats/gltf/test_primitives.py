"""What the corners of glTF's triangles have: texture coordinates, colours and tangents."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stratalux.errors import InputError
from stratalux.scenes.formats import read_model
from stratalux.scenes.model import Part
from stratalux.scenes.shapes import load_object
from tests.scenes.formats.gltf_files import Gltf

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
UVS = np.array([[0, 0.25], [1, 0.5], [-0.5, 2]])
COLOURS = np.array([[1, 0.5, 0, 0.25], [0, 1, 0, 1], [0.25, 0, 1, 0.5]])
TANGENTS = np.array([[1, 0, 0, 1], [0, 1, 0, -1], [0.6, 0, 0.8, 1]])


def read(path: Path, gltf: Gltf) -> Part:
    return read_model(gltf.write(path)).parts[0]


def with_attributes(path: Path, **attributes: Any) -> Part:
    """A triangle with attributes, each of values, a type and what else its accessor says."""
    gltf = Gltf()
    made = {name: gltf.accessor(values, dtype, **more) for name, (values, dtype, more) in attributes.items()}
    gltf.show(gltf.primitive(TRIANGLE, attributes=made))
    return read(path, gltf)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "scene.glb"


def test_what_a_primitive_does_not_have(file: Path) -> None:
    found = with_attributes(file)
    assert (dict(found.uvs), found.colours, found.tangents) == ({}, None, None)


def test_sets_of_texture_coordinates(file: Path) -> None:
    one = (UVS, "f4", {})
    found = with_attributes(file, TEXCOORD_0=one, TEXCOORD_1=(2 * UVS, "f4", {}), TEXCOORD_10=one, TEXCOORD_X=one)
    assert sorted(found.uvs) == [0, 1, 10]
    np.testing.assert_array_equal(found.uvs[0], UVS)
    np.testing.assert_array_equal(found.uvs[1], 2 * UVS)


@pytest.mark.parametrize(
    ("dtype", "largest", "normalized"),
    [
        ("u1", 255, True),
        ("u2", 65535, True),
        ("i1", 127, True),
        ("i2", 32767, True),
        ("u2", 1, False),
        ("i1", 1, False),
    ],
)
def test_quantised_texture_coordinates(file: Path, dtype: str, largest: int, normalized: bool) -> None:
    values = np.array([[0, 1], [1, 0], [1, 1]])
    more = {"normalized": True} if normalized else {}
    found = with_attributes(file, TEXCOORD_0=(values * largest, dtype, more))
    np.testing.assert_array_equal(found.uvs[0], values)


@pytest.mark.parametrize("components", [3, 4])
@pytest.mark.parametrize(("dtype", "largest"), [("f4", 1), ("u1", 255), ("u2", 65535)])
@pytest.mark.parametrize("marked", [True, False])
def test_colours(file: Path, components: int, dtype: str, largest: int, marked: bool) -> None:
    """Whole numbers are fractions of the largest, even where the file forgets to say so."""
    values = np.round(COLOURS[:, :components] * largest) if largest > 1 else COLOURS[:, :components]
    found = with_attributes(file, COLOR_0=(values, dtype, {"normalized": True} if marked and largest > 1 else {}))
    assert found.colours is not None
    expected = values / largest if components == 4 else np.column_stack([values / largest, np.ones(3)])
    np.testing.assert_allclose(found.colours, expected, rtol=1e-15)


@pytest.mark.parametrize("dtype", ["f4", "i1", "i2"])
def test_tangents(file: Path, dtype: str) -> None:
    largest = 1 if dtype == "f4" else np.iinfo(dtype).max
    values = TANGENTS if dtype == "f4" else np.round(TANGENTS * largest)
    found = with_attributes(file, TANGENT=(values, dtype, {} if dtype == "f4" else {"normalized": True}))
    assert found.tangents is not None
    np.testing.assert_allclose(found.tangents, TANGENTS, atol=0.6 / largest if largest > 1 else 1e-7)


def test_morph_targets_move_all_that_they_name(file: Path) -> None:
    gltf = Gltf()
    attributes = {
        "TANGENT": gltf.accessor(TANGENTS), "TEXCOORD_1": gltf.accessor(UVS), "COLOR_0": gltf.accessor(COLOURS),
    }  # fmt: skip
    target = {
        "TANGENT": gltf.accessor(np.tile([0, 0, 1.0], (3, 1))),
        "TEXCOORD_1": gltf.accessor(np.tile([1.0, 2.0], (3, 1))),
        "COLOR_0": gltf.accessor(np.tile([-1, 0, 0, 0], (3, 1))),
    }
    gltf.show(gltf.primitive(TRIANGLE, attributes=attributes, targets=[target]), weights=[0.5])
    found = read(file, gltf)
    assert found.tangents is not None and found.colours is not None
    np.testing.assert_allclose(found.tangents, TANGENTS + np.array([0, 0, 0.5, 0]), atol=1e-7)
    np.testing.assert_array_equal(found.uvs[1], UVS + np.array([0.5, 1]))
    np.testing.assert_array_equal(found.colours, np.maximum(COLOURS - np.array([0.5, 0, 0, 0]), 0))


@pytest.mark.parametrize("mirror", [1, -1])
def test_tangents_follow_the_joints_of_a_skin(file: Path, mirror: int) -> None:
    """Where a joint mirrors, normal and tangent do not say any longer on which side the bitangent is."""
    gltf = Gltf()
    attributes = {
        "TANGENT": gltf.accessor(np.tile([1, 0, 0, 1.0], (3, 1))),
        "NORMAL": gltf.accessor(np.tile([0, 0, 1.0], (3, 1))),
        "JOINTS_0": gltf.accessor(np.zeros((3, 4)), "u1"),
        "WEIGHTS_0": gltf.accessor(np.tile([1.0, 0, 0, 0], (3, 1))),
    }
    gltf.show(gltf.primitive(TRIANGLE, attributes=attributes), skin=gltf.add("skins", joints=[1]))
    half = np.sqrt(0.5)
    gltf.add("nodes", rotation=[0, 0, half, half], scale=[2, 2 * mirror, 2])
    found = read(file, gltf)
    assert found.tangents is not None and found.normals is not None
    np.testing.assert_allclose(found.tangents, np.tile([0, 2, 0, mirror], (3, 1)), atol=1e-6)
    bitangents = np.cross(found.normals, found.tangents[:, :3]) * found.tangents[:, 3:]
    np.testing.assert_allclose(bitangents[0] / np.linalg.norm(bitangents[0]), [-mirror, 0, 0], atol=1e-6)


def test_draco_holds_attributes_of_every_type(file: Path) -> None:
    """Shorter whole numbers come widened out of the decoder."""
    draco = pytest.importorskip("DracoPy")
    gltf = Gltf()
    generic = {
        2: np.round(COLOURS * 65535).astype(np.uint16),
        3: TANGENTS.astype(np.float32),
        4: np.round(np.abs(UVS[:2] / 2).repeat([2, 1], axis=0) * 255).astype(np.uint8),
    }
    data = draco.encode(
        TRIANGLE.astype(np.float32), np.array([[0, 1, 2]], np.uint32), preserve_order=True, tex_coord=UVS,
        generic_attributes=generic,
    )  # fmt: skip
    ids = {each["attribute_type"]: each["unique_id"] for each in draco.decode(data).attributes}
    said = {
        "POSITION": (5126, "VEC3", ids[0]), "TEXCOORD_0": (5126, "VEC2", ids[3]), "COLOR_0": (5123, "VEC4", 2),
        "TANGENT": (5126, "VEC4", 3), "TEXCOORD_1": (5121, "VEC2", 4),
    }  # fmt: skip
    attributes = {
        name: gltf.add("accessors", componentType=kind, type=size, count=3, normalized=kind != 5126)
        for name, (kind, size, _) in said.items()
    }
    packed = {"bufferView": gltf.view(data), "attributes": {name: number for name, (_, _, number) in said.items()}}
    gltf.show({"attributes": attributes, "extensions": {"KHR_draco_mesh_compression": packed}})
    found = read(file, gltf)
    assert found.colours is not None and found.tangents is not None
    np.testing.assert_allclose(found.colours, COLOURS, atol=1e-5)
    np.testing.assert_allclose(found.tangents, TANGENTS, atol=1e-7)
    np.testing.assert_allclose(found.uvs[0], UVS, atol=1e-3)
    np.testing.assert_allclose(found.uvs[1], generic[4] / 255, rtol=1e-12)


@pytest.mark.parametrize("where", ["attribute", "target"])
def test_attributes_of_another_length_are_refused(file: Path, where: str) -> None:
    gltf = Gltf()
    short = gltf.accessor(UVS[:1])
    attributes = {"TEXCOORD_0": short if where == "attribute" else gltf.accessor(UVS)}
    targets = [{"TEXCOORD_0": short}]
    gltf.show(gltf.primitive(TRIANGLE, attributes=attributes, targets=targets), weights=[1])
    with pytest.raises(InputError, match="has 1 elements"):
        read(file, gltf)


def test_names(file: Path) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TRIANGLE), name="a node", mesh={"name": "its mesh"})
    gltf.show(gltf.primitive(TRIANGLE), mesh={"name": "a mesh"})
    gltf.show(gltf.primitive(TRIANGLE))
    assert [part.name for part in read_model(gltf.write(file)).parts] == ["a node", "a mesh", "mesh 2"]


def test_faces_without_normals_are_flat(file: Path) -> None:
    """Two that share an edge and bend by 20 degrees, which is smooth in other formats."""
    bend = np.radians(20.0)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-np.cos(bend), 0, -np.sin(bend)]])
    gltf = Gltf()
    gltf.show(gltf.primitive(corners, [0, 1, 2, 0, 2, 3]))
    (shape,) = load_object(gltf.write(file)).shapes
    assert shape.mesh.normals is not None
    found = shape.mesh.normals[shape.mesh.faces]
    np.testing.assert_allclose(found[0], [[0, 0, 1]] * 3, atol=1e-6)
    np.testing.assert_allclose(found[1], [[-np.sin(bend), 0, np.cos(bend)]] * 3, atol=1e-6)
