"""PLY: text and both byte orders, types and lists of all widths, other elements, and strips."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from stratalux.errors import InputError, SceneWarning
from stratalux.scenes.formats import read_model
from stratalux.scenes.model import Part

LETTERS = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f", "float64": "d",
}  # fmt: skip

FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}

VERTICES = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]

Rows = list[list[object]]


def ply(form: str, *elements: tuple[str, list[str], Rows], end: str = "\n") -> bytes:
    """A file with elements (name, properties, rows); a row holds numbers, and lists where the property is one."""
    header = ["ply", f"format {form} 1.0", "comment made by a test"]
    body = b""
    for name, properties, rows in elements:
        header += [f"element {name} {len(rows)}", *(f"property {p}" for p in properties)]
        for row in rows:
            cells: list[tuple[str, object]] = []
            for declaration, value in zip(properties, row, strict=True):
                words = declaration.split()
                if words[0] == "list":
                    assert isinstance(value, (list, tuple))
                    cells += [(words[1], len(value)), *((words[2], each) for each in value)]
                else:
                    cells.append((words[0], value))
            if form == "ascii":
                body += " ".join(str(value) for _, value in cells).encode() + end.encode()
            else:
                body += b"".join(struct.pack(FORMATS[form] + LETTERS[kind], value) for kind, value in cells)
    return end.join([*header, "end_header", ""]).encode() + body


def part(folder: Path, data: bytes) -> Part:
    path = folder / "mesh.ply"
    path.write_bytes(data)
    return read_model(path).parts[0]


def vertex(kind: str = "float") -> tuple[str, list[str], Rows]:
    return "vertex", [f"{kind} {axis}" for axis in "xyz"], [list(v) for v in VERTICES]


def faces(*lists: list[int], count: str = "uchar", kind: str = "int", name: str = "vertex_indices"):  # type: ignore[no-untyped-def]
    return "face", [f"list {count} {kind} {name}"], [[each] for each in lists]


def area(found: Part) -> float:
    a, b, c = np.moveaxis(found.vertices[found.faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_every_byte_order_and_line_end(tmp_path: Path, form: str, end: str) -> None:
    found = part(tmp_path, ply(form, vertex(), faces([0, 1, 2], [0, 2, 3]), end=end))
    np.testing.assert_array_equal(found.vertices, VERTICES)
    np.testing.assert_array_equal(found.faces, [[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize("form", FORMATS)
def test_concave_polygons_of_different_sizes(tmp_path: Path, form: str) -> None:
    lists = ([3, 4, 5, 0, 1, 2], [0, 1, 2], [5, 0, 1, 2, 3, 4], [0, 1, 2, 3])
    assert area(part(tmp_path, ply(form, vertex(), faces(*lists)))) == pytest.approx(3 + 1 + 3 + 1.5)
    assert area(part(tmp_path, ply(form, vertex(), faces(*[lists[0]] * 3)))) == pytest.approx(9)


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("count", ["uchar", "char", "ushort", "int16", "int", "uint32"])
@pytest.mark.parametrize("kind", ["uchar", "short", "uint16", "int32", "uint"])
def test_lists_of_every_width(tmp_path: Path, form: str, count: str, kind: str) -> None:
    for name in ("vertex_indices", "vertex_index"):
        found = part(
            tmp_path, ply(form, vertex("double"), faces([0, 1, 2], [0, 2, 3, 4, 5], count=count, kind=kind, name=name))
        )
        assert area(found) == pytest.approx(1 + 2)


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("kind", ["double", "int", "short", "uint8"])
def test_coordinates_of_every_type(tmp_path: Path, form: str, kind: str) -> None:
    np.testing.assert_array_equal(part(tmp_path, ply(form, vertex(kind), faces([0, 1, 2]))).vertices, VERTICES)


@pytest.mark.parametrize("form", FORMATS)
def test_other_elements_and_properties_around_them(tmp_path: Path, form: str) -> None:
    names = ["float nx", "uchar red", "double z", "list uchar short tags", "float ny", "float x", "float nz", "float y"]
    rows: Rows = [[0, 255, z, [1] * (k % 3), 0, x, 1, y] for k, (x, y, z) in enumerate(VERTICES)]
    data = ply(
        form,
        ("camera", ["float view", "list int float lens"], [[1, [2, 3]]]),
        ("vertex", names, rows),
        ("face", ["uchar flag", "list uchar uint vertex_index", "list uchar float texcoord"],
         [[1, [0, 1, 2], [0.5] * 6], [2, [0, 2, 3], [0.5] * 6], [3, [0, 3, 4, 5], []]]),
        ("edge", ["int a", "int b"], [[0, 1]]),
    )  # fmt: skip
    found = part(tmp_path, data)
    corners = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
    np.testing.assert_array_equal(found.vertices[found.faces], np.array(VERTICES)[corners])
    np.testing.assert_array_equal(found.normals, np.tile([0, 0, 1], (len(found.vertices), 1)))
    assert area(found) == pytest.approx(3)


@pytest.mark.parametrize("form", FORMATS)
def test_triangle_strips(tmp_path: Path, form: str) -> None:
    square = ("vertex", ["float x", "float y", "float z"], [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]])
    strips = ("tristrips", ["list int int vertex_indices"], [[[0, 1, 2, 3, 4, -1, 0, 1, 3, -1]], [[2, 3, 4]]])
    found = part(tmp_path, ply(form, square, strips))
    np.testing.assert_array_equal(found.faces, [[0, 1, 2], [1, 3, 2], [2, 3, 4], [0, 1, 3], [2, 3, 4]])


def test_bytes_behind_the_last_face(tmp_path: Path) -> None:
    data = ply("binary_little_endian", vertex(), faces([0, 1, 2]))
    assert len(part(tmp_path, data + b"\n\0\0").faces) == 1
    with pytest.warns(SceneWarning, match="7 bytes behind the last element are ignored"):
        assert len(part(tmp_path, data + b"garbage").faces) == 1
    assert len(part(tmp_path, ply("ascii", vertex(), faces([0, 1, 2])) + b"\nand words; 1 2 3\x1a").faces) == 1


def test_a_byte_order_mark(tmp_path: Path) -> None:
    assert len(part(tmp_path, b"\xef\xbb\xbf" + ply("ascii", vertex(), faces([0, 1, 2]))).faces) == 1


def test_data_that_begin_with_a_newline(tmp_path: Path) -> None:
    """The header ends with a carriage return alone; the first byte of the data looks like a part of the line end."""
    rows: Rows = [[0, 0, 0], [10, 0, 0], [0, 10, 0]]
    data = ply("binary_little_endian", ("face", ["list uchar uchar vertex_index"], [[[0, 1, 2]] for _ in range(2)]),
               ("vertex", ["uchar x", "uchar y", "uchar z"], rows), end="\r")  # fmt: skip
    assert len(part(tmp_path, data).faces) == 2
    rows = [[10, 0, 0], [0, 0, 0], [0, 9, 0]]
    first = ply("binary_little_endian", ("vertex", ["uchar x", "uchar y", "uchar z"], rows), faces([0, 1, 2]), end="\r")
    np.testing.assert_array_equal(part(tmp_path, first).vertices[0], [10, 0, 0])


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("lists", [([0, 1, 2], [0, 2, 3], [0, 3, 4]), ([0, 1, 2], [0, 2, 3, 4], [0, 4, 5])])
def test_files_that_are_cut_short_say_where(tmp_path: Path, form: str, lists: tuple[list[int], ...]) -> None:
    data = ply(form, vertex(), faces(*lists))
    with pytest.raises(InputError, match="cut short at 2 of the 3 faces"):
        part(tmp_path, data[:-3])
    header = data.index(b"end_header\n") + 11
    with pytest.raises(InputError, match="cut short at 0 of the 6 vertices"):
        part(tmp_path, data[: header + 3])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"plyers", "no header"),
        (b"ply\nformat ascii 1.0\n", "no header"),
        (ply("ascii", vertex(), faces([0, 1, 2])).replace(b"ascii", b"binary_middle_endian"), "its format is none of"),
        (
            ply("ascii", ("vertex", ["float x", "float y"], [[0, 0]]), faces([0, 0, 0])),
            "no vertices with the properties",
        ),
        (ply("ascii", vertex()), "no faces"),
        (ply("ascii", vertex(), faces([0, 1, 6])), "refers to vertex 6, but the last is 5"),
        (ply("binary_big_endian", vertex(), faces([0, 1, -1])), "refers to vertex -1"),
        (ply("ascii", vertex(), faces([0, 1, 2])).replace(b"\n3 0", b"\n-3 0"), "a list of -3 values"),
        (ply("ascii", vertex(), faces([0, 1, 2])).replace(b"float x", b"quaternion x"), "unreadable"),
    ],
)
def test_bad_files_are_named(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        part(tmp_path, data)


def coloured(kind: str, *colours: object, names: str = "red green blue alpha") -> tuple[str, list[str], Rows]:
    properties = [f"float {axis}" for axis in "xyz"] + [f"{kind} {name}" for name in names.split()[: len(colours)]]
    return "vertex", properties, [[*v, *colours] for v in VERTICES]


@pytest.mark.parametrize("form", FORMATS)
def test_colours_of_vertices(tmp_path: Path, form: str) -> None:
    def found(*arguments: object, **more: str) -> object:
        colours = part(tmp_path, ply(form, coloured(*arguments, **more), faces([0, 1, 2]))).colours  # type: ignore[arg-type]
        return None if colours is None else np.unique(colours, axis=0).tolist()

    assert found("uchar", 255, 0, 51, 51) == [pytest.approx([1, 0, 0.0331048, 0.2], abs=1e-6)]
    assert found("ushort", 65535, 0, 13107) == [pytest.approx([1, 0, 0.0331048, 1], abs=1e-6)]
    assert found("float", 0.5, 2, 0, 0.25) == [[0.5, 2, 0, 0.25]]
    assert found("uint8", 0, 255, 0, names="diffuse_red diffuse_green diffuse_blue") == [[0, 1, 0, 1]]
    assert found("uchar", 255, 0) is None


@pytest.mark.parametrize("form", FORMATS)
def test_colours_of_faces(tmp_path: Path, form: str) -> None:
    properties = ["list uchar int vertex_indices", *(f"uchar {name}" for name in ("red", "green", "blue"))]
    element: tuple[str, list[str], Rows] = (
        "face",
        properties,
        [[[0, 1, 2], 255, 0, 0], [[0, 2, 3, 4], 0, 255, 0]],
    )
    found = part(tmp_path, ply(form, vertex(), element))
    assert found.colours is not None
    assert found.colours[found.faces[0]].tolist() == [[1, 0, 0, 1]] * 3
    assert np.unique(found.colours[found.faces[1:]].reshape(-1, 4), axis=0).tolist() == [[0, 1, 0, 1]]
    found = part(tmp_path, ply(form, coloured("uchar", 0, 0, 255), element))
    assert found.colours is not None and np.unique(found.colours, axis=0).tolist() == [[0, 0, 1, 1]]


@pytest.mark.parametrize("names", ["s t", "u v", "texture_u texture_v"])
def test_coordinates_of_vertices_go_down(tmp_path: Path, names: str) -> None:
    found = part(tmp_path, ply("ascii", coloured("float", 0.25, 0.75, names=names), faces([0, 1, 2])))
    assert found.uvs[0].tolist() == [[0.25, 0.25]] * 6 and found.material is None


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("ragged", [False, True])
def test_textures_of_faces(tmp_path: Path, form: str, ragged: bool) -> None:
    for name in ("my wood.png", "stone.jpg"):
        (tmp_path / name).write_bytes(b"")
    properties = ["list uchar int vertex_indices", "list uchar float texcoord", "int texnumber"]
    rows: Rows = [
        [[0, 1, 2], [0, 0, 1, 0, 1, 0.75], 0],
        [[0, 2, 3], [0, 0, 1, 0.75, 0.5, 0.5], 1],
        [[0, 3, 4], [0, 0, 0.5, 0.5, 0, 1], 1],
        [[0, 4, 5, 0][: 3 + ragged], [] if ragged else [0.5] * 6, -1],
    ]
    data = ply(form, vertex(), ("face", properties, rows))
    textures = b"comment TextureFile  my wood.png \ncomment TextureFile stone.jpg"
    path = tmp_path / "mesh.ply"
    path.write_bytes(data.replace(b"comment made by a test", textures))
    wood, stone, plain = read_model(path).parts
    assert wood.material and stone.material and plain.material is None
    texture = wood.material.base_colour.texture
    assert texture and texture.picture.path == tmp_path / "my wood.png" and texture.curve == "srgb"
    assert stone.name == "stone.jpg" and not wood.material.vertex_colours
    assert wood.uvs[0][wood.faces].tolist() == [[[0, 1], [1, 1], [1, 0.25]]]
    assert stone.uvs[0][stone.faces].tolist() == [[[0, 1], [1, 0.25], [0.5, 0.5]], [[0, 1], [0.5, 0.5], [0, 0]]]
    assert len(stone.vertices) == 4  # corners with the same coordinates share one
    (tmp_path / "stone.jpg").unlink()
    with pytest.warns(SceneWarning, match="its texture 'stone.jpg' is not there, and left out"):
        assert [each.material is None for each in read_model(path).parts] == [False, True, True]


def test_a_texture_without_coordinates_is_told(tmp_path: Path) -> None:
    data = ply("ascii", vertex(), faces([0, 1, 2])).replace(b"made by a test", b"TextureFile wood.png")
    with pytest.warns(SceneWarning, match="its texture is left out, as it has no coordinates for it"):
        assert part(tmp_path, data).material is None
