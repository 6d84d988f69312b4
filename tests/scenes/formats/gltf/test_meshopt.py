"""Buffer views that are compressed with meshoptimizer."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stratalux.errors import InputError
from stratalux.scenes.formats import read_model
from stratalux.scenes.formats.gltf.meshopt import decoded
from stratalux.scenes.model import Part
from tests.scenes.formats.gltf_files import COMPONENTS, TYPES, Gltf

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
NAMES = ["EXT_meshopt_compression", "KHR_meshopt_compression"]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "scene.glb"


def pack(gltf: Gltf, data: bytes, count: int, size: int, name: str = NAMES[0], **how: Any) -> int:
    """A view of `count` elements of `size` bytes whose plain data are nowhere."""
    gltf.view(data)
    said = {"byteStride": size, "count": count, **gltf.json["bufferViews"].pop(), **how}
    stride = {"byteStride": size} if how["mode"] == "ATTRIBUTES" else {}
    return gltf.add("bufferViews", buffer=1, byteLength=count * size, extensions={name: said}, **stride)


def accessor(gltf: Gltf, view: int, dtype: str, shape: tuple[int, ...], **more: Any) -> int:
    kind, size = COMPONENTS[dtype], TYPES[shape[1:]]
    return gltf.add("accessors", bufferView=view, componentType=kind, type=size, count=shape[0], **more)


def tetrahedron(gltf: Gltf, name: str = NAMES[0], version: int = 0, **attributes: int) -> Gltf:
    meshopt = pytest.importorskip("meshopt")
    gltf.require(name)
    data = meshopt.encode_gltf_buffer(CORNERS, "ATTRIBUTES", version)
    position = accessor(gltf, pack(gltf, data, 4, 12, name, mode="ATTRIBUTES"), "f4", CORNERS.shape)
    data = meshopt.encode_gltf_buffer(FACES.ravel().astype(np.uint32), "TRIANGLES")
    indices = accessor(gltf, pack(gltf, data, 12, 2, name, mode="TRIANGLES"), "u2", (12,))
    gltf.show({"attributes": {"POSITION": position, **attributes}, "indices": indices})
    return gltf


def read(path: Path, gltf: Gltf) -> Part:
    gltf.json["buffers"] = [{"byteLength": len(gltf.binary)}, {"byteLength": 1 << 20}]
    return read_model(gltf.write(path)).parts[0]


def turned(faces: Any) -> list[list[int]]:
    """Faces from their lowest corner on: the coding may turn them."""
    return sorted(np.roll(face, -int(np.argmin(face))).tolist() for face in np.asarray(faces))


@pytest.mark.parametrize(("name", "version"), [(NAMES[0], 0), (NAMES[1], 0), (NAMES[1], 1)])
def test_vertices_and_triangles(file: Path, name: str, version: int) -> None:
    found = read(file, tetrahedron(Gltf(), name, version))
    np.testing.assert_array_equal(found.vertices, CORNERS)
    assert turned(found.faces) == turned(FACES)


def test_indices_of_a_strip(file: Path) -> None:
    meshopt = pytest.importorskip("meshopt")
    gltf = Gltf()
    data = meshopt.encode_gltf_buffer(np.array([0, 1, 2, 3], np.uint32), "INDICES")
    indices = accessor(gltf, pack(gltf, data, 4, 4, mode="INDICES"), "u4", (4,))
    gltf.show({**gltf.primitive(CORNERS, mode=5), "indices": indices})
    assert turned(read(file, gltf).faces) == [[0, 1, 2], [1, 3, 2]]


@pytest.mark.parametrize(("size", "dtype", "error"), [(4, "i1", 0.02), (8, "i2", 1e-3)])
def test_octahedral_normals(file: Path, size: int, dtype: str, error: float) -> None:
    meshopt = pytest.importorskip("meshopt")
    normals = np.array([[0, 0, 1], [0.6, 0, -0.8], [-0.48, 0.64, 0.6], [0, -1, 0]])
    rows = meshopt.encode_filter_oct(np.column_stack([normals, np.zeros(4)]), size, 8 if size == 4 else 12)
    gltf = Gltf()
    data = meshopt.encode_gltf_buffer(rows, "ATTRIBUTES")
    view = pack(gltf, data, 4, size, mode="ATTRIBUTES", filter="OCTAHEDRAL")
    found = read(file, tetrahedron(gltf, NORMAL=accessor(gltf, view, dtype, (4, 3), normalized=True)))
    assert found.normals is not None
    np.testing.assert_allclose(found.normals, normals, atol=error)


def test_exponential_texture_coordinates(file: Path) -> None:
    meshopt = pytest.importorskip("meshopt")
    uvs = np.array([[0.5, 100], [-0.25, 1e-3], [0, 0], [3, 1]])
    gltf = Gltf()
    data = meshopt.encode_gltf_buffer(meshopt.encode_filter_exp(uvs, 15, "Separate"), "ATTRIBUTES")
    view = pack(gltf, data, 4, 8, mode="ATTRIBUTES", filter="EXPONENTIAL")
    found = read(file, tetrahedron(gltf, TEXCOORD_0=accessor(gltf, view, "f4", (4, 2))))
    np.testing.assert_allclose(found.uvs[0], uvs, rtol=1e-3)


def test_quaternions_of_instances(file: Path) -> None:
    meshopt = pytest.importorskip("meshopt")
    turns = np.array([[0, 0, 0, 1], [0, 0, np.sqrt(0.5), np.sqrt(0.5)], [0.5, -0.5, 0.5, 0.5]])
    gltf = Gltf()
    data = meshopt.encode_gltf_buffer(meshopt.encode_filter_quat(turns, 8, 16), "ATTRIBUTES")
    view = pack(gltf, data, 3, 8, mode="ATTRIBUTES", filter="QUATERNION")
    tetrahedron(gltf)
    table = {"ROTATION": accessor(gltf, view, "i2", (3, 4), normalized=True)}
    gltf.json["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": table}}
    read(file, gltf)
    matrices = [instance.matrix for instance in read_model(file).instances]
    # A quarter of a turn about z takes x to y, and the last turn x to -y.
    x = [matrix[:3, 0] for matrix in matrices]
    np.testing.assert_allclose(x, [[1, 0, 0], [0, 1, 0], [0, 0, 1]], atol=1e-4)


def test_colours_of_the_newer_extension(file: Path) -> None:
    meshopt = pytest.importorskip("meshopt")
    colours = np.array([[1, 0, 0, 1], [0, 1, 0, 0.5], [0.2, 0.4, 0.6, 1], [1, 1, 1, 0]])
    gltf = Gltf()
    data = meshopt.encode_gltf_buffer(meshopt.encode_filter_color(colours, 4, 8), "ATTRIBUTES")
    view = pack(gltf, data, 4, 4, NAMES[1], mode="ATTRIBUTES", filter="COLOR")
    found = read(file, tetrahedron(gltf, NAMES[1], COLOR_0=accessor(gltf, view, "u1", (4, 4), normalized=True)))
    assert found.colours is not None
    np.testing.assert_allclose(found.colours, colours, atol=0.02)


def test_without_its_package(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gltf = tetrahedron(Gltf())
    monkeypatch.setitem(sys.modules, "meshopt", None)
    with pytest.raises(InputError, match=r"compressed with meshoptimizer.* pip install 'stratalux\[gltf\]'"):
        read(file, gltf)


@pytest.mark.parametrize(("version", "more"), [((3, 10, 9), " and Python 3.11 or later"), ((3, 11, 0), "")])
def test_its_package_is_not_there_for_every_python(
    file: Path, monkeypatch: pytest.MonkeyPatch, version: tuple[int, ...], more: str
) -> None:
    monkeypatch.setitem(sys.modules, "meshopt", None)
    monkeypatch.setattr(sys, "version_info", version)
    with pytest.raises(InputError, match=f"needs another package{more}: pip install"):
        decoded(file, memoryview(b""), {"count": 1, "byteStride": 4})


@pytest.mark.parametrize(("count", "size"), [(1, 4), (1_000_000, 16)])
def test_what_is_all_the_same_is_compressed_most(count: int, size: int) -> None:
    """A thousand times, which is not taken for a lie."""
    meshopt = pytest.importorskip("meshopt")
    data = meshopt.encode_gltf_buffer(np.zeros((count, size), np.uint8), "ATTRIBUTES", 1)
    assert count == 1 or count * size > 1000 * len(data)
    view = {"count": count, "byteStride": size, "mode": "ATTRIBUTES"}
    assert bytes(decoded(Path("scene.glb"), memoryview(data), view)) == bytes(count * size)


@pytest.mark.parametrize("how", ["file", "binary"])
def test_plain_data_to_fall_back_to_need_no_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str) -> None:
    monkeypatch.setitem(sys.modules, "meshopt", None)
    gltf = Gltf()
    gltf.show(gltf.primitive(CORNERS, FACES.ravel()))
    damaged = {"buffer": 0, "byteLength": 4, "byteStride": 4, "count": 99, "mode": "ATTRIBUTES"}
    for view in gltf.json["bufferViews"]:
        view["extensions"] = {NAMES[0]: damaged}
    path = gltf.write(tmp_path / ("scene.glb" if how == "binary" else "scene.gltf"))
    np.testing.assert_array_equal(read_model(path).parts[0].vertices, CORNERS)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 1 << 40}, "compressed bytes cannot be 1099511627776 times 12"),
        ({"count": 100}, "meshopt data cannot be decoded"),
        ({"byteLength": 3}, "meshopt data cannot be decoded"),
        ({"byteLength": 1 << 30}, "compressed buffer view 0 reaches beyond its buffer"),
        ({"byteOffset": -8}, "compressed buffer view 0 reaches beyond its buffer"),
        ({"mode": "SPELLS"}, "meshopt data cannot be decoded"),
        ({"filter": "SEPIA"}, "meshopt data cannot be decoded"),
        ({"byteStride": 0}, "meshopt data cannot be decoded"),
        ({"byteStride": -12}, "meshopt data cannot be decoded"),
        ({"count": 0}, "reach beyond buffer view 0"),
        ({"count": -4}, "reach beyond buffer view 0"),
        ({"buffer": 7}, "there is no object 7"),
        ({"buffer": 1}, "buffer 1 has no data"),
    ],
)
def test_damaged_data_are_one_line(file: Path, change: dict[str, Any], message: str) -> None:
    gltf = tetrahedron(Gltf())
    gltf.json["bufferViews"][0]["extensions"][NAMES[0]] |= change
    with pytest.raises(InputError, match=message) as caught:
        read(file, gltf)
    assert "\n" not in str(caught.value)


def test_no_damaged_byte_is_a_crash(file: Path) -> None:
    """Each byte of the data in turn is another: what comes out are other shapes, or one line."""
    gltf = tetrahedron(Gltf())
    whole = gltf.binary
    refused = 0
    for place in range(len(whole)):
        gltf.binary = whole[:place] + bytes([whole[place] ^ 0x5A]) + whole[place + 1 :]
        try:
            read(file, gltf)
        except InputError:
            refused += 1
    assert refused > 0
