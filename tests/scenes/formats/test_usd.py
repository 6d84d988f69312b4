"""USD: surfaces, where they stand, and what is told of a stage. Files are written as text.

Most are read in this process, which is quicker than in one of their own.
"""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from stratalux.errors import InputError, SceneWarning
from stratalux.scenes.formats import read_model, usd
from stratalux.scenes.model import Model, Part

pytest.importorskip("pxr")
from stratalux.scenes.formats.usd import process
from stratalux.scenes.formats.usd.stage import read_stage

QUAD = """
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0)]
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 5, 2]
    uniform token subdivisionScheme = "none"
"""


def model(folder: Path, text: str, head: str = "", name: str = "scene.usda") -> Model:
    path = folder / name
    path.write_text(f"#usda 1.0\n(\n{head}\n)\n{text}")
    return read_stage(path)


def mesh(more: str = "", name: str = "quad", body: str = QUAD) -> str:
    return f'def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"])\n{{\n{body}\n{more}\n}}\n'


def only(folder: Path, text: str) -> Part:
    found = model(folder, text)
    assert len(found.parts) == 1
    return found.parts[0]


def corners(found: Part, values: np.ndarray) -> np.ndarray:
    """As floats: those of the triangles (0, 1, 2), (0, 2, 3), (1, 4, 5) and (1, 5, 2)."""
    return np.asarray(values[found.faces], dtype=np.float64)


def area_vector(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(points[faces], 1, 0)
    return np.asarray(np.cross(b - a, c - a).sum(axis=0) / 2)


def volume(found: Part) -> float:
    a, b, c = np.moveaxis(found.vertices[found.faces], 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6)


def test_a_mesh_where_it_stands(tmp_path: Path) -> None:
    text = 'def Xform "World"\n{\ndouble3 xformOp:translate = (1, 2, 3)\nfloat xformOp:rotateZ = 90\n'
    text += 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]\n' + mesh() + "}\n"
    found = model(tmp_path, text, 'upAxis = "Z"\nmetersPerUnit = 0.01')
    (part,), (instance,) = found.parts, found.instances
    assert part.name == "quad" and part.material is None and part.normals is None and part.colours is None
    assert corners(part, part.vertices)[0].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    np.testing.assert_allclose(instance.matrix @ [1, 0, 0, 1], [1, 3, 3, 1], atol=1e-12)
    assert found.up == "z" and found.metres == 0.01
    found = model(tmp_path, mesh())
    assert found.up == "y" and found.metres is None


def test_concave_polygons_holes_and_the_other_orientation(tmp_path: Path) -> None:
    outline = """
    point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0),
        (0, 0, 1), (1, 0, 1), (0, 1, 1)]
    int[] faceVertexCounts = [6, 3, 3]
    int[] faceVertexIndices = [3, 4, 5, 0, 1, 2, 6, 7, 8, 8, 7, 6]
    int[] holeIndices = [1]
    uniform token subdivisionScheme = "none"
    """
    part = only(tmp_path, mesh(body=outline))
    assert len(part.faces) == 5
    np.testing.assert_allclose(area_vector(part.vertices, part.faces), [0, 0, 3 - 0.5])
    numbered = ", ".join(f"({number}, 0)" for number in range(12))
    uvs = f'texCoord2f[] primvars:st = [{numbered}] (interpolation = "faceVarying")\n'
    part = only(tmp_path, mesh(uvs + 'uniform token orientation = "leftHanded"', body=outline))
    np.testing.assert_allclose(area_vector(part.vertices, part.faces), [0, 0, -3 + 0.5])
    # The last face: its corners are 9, 10 and 11.
    assert sorted(part.uvs[0][part.faces[-1]][:, 0].tolist()) == [9, 10, 11]
    at = {
        tuple(p): u for p, u in zip(part.vertices[part.faces[-1]].tolist(), part.uvs[0][part.faces[-1], 0], strict=True)
    }
    assert at == {(0, 1, 1): 9, (1, 0, 1): 10, (0, 0, 1): 11}


@pytest.mark.parametrize(
    ("primvar", "expected"),
    [
        ('[(0.5, 0.25)] (interpolation = "constant")', [[0.5, 0.75]] * 8),
        ('[(0, 0), (1, 0)] (interpolation = "uniform")', [[0, 1]] * 4 + [[1, 1]] * 4),
        (
            '[(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0)] (interpolation = "vertex")',
            [[x, 1] for x in (0, 1, 2, 3, 1, 4, 5, 2)],
        ),
        (
            '[(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0), (6, 0), (6, 0)] (interpolation = "faceVarying")',
            [[x, 1] for x in (0, 1, 2, 3, 4, 5, 6, 6)],
        ),
        (
            '[(0, 0), (0, 1)] (interpolation = "faceVarying")\nint[] primvars:st:indices = [0, 1, 0, 1, 1, 1, 1, 0]',
            [[0, 1 - v] for v in (0, 1, 0, 1, 1, 1, 1, 0)],
        ),
        (
            '[(0, 0), (0, 1)] (interpolation = "varying")\nint[] primvars:st:indices = [0, 1, 0, 1, 1, 1]',
            [[0, 1 - v] for v in (0, 1, 0, 1, 1, 1, 1, 0)],
        ),
    ],
)
def test_coordinates_of_every_interpolation(tmp_path: Path, primvar: str, expected: list[list[float]]) -> None:
    part = only(tmp_path, mesh(f"texCoord2f[] primvars:st = {primvar}"))
    triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]
    np.testing.assert_allclose(corners(part, part.uvs[0]), np.array(expected)[triangles])


def test_values_that_are_too_few_are_told(tmp_path: Path) -> None:
    with pytest.warns(SceneWarning, match=r"'st' with less values than its mesh has places for are left out \(/quad\)"):
        part = only(tmp_path, mesh('texCoord2f[] primvars:st = [(0, 0)] (interpolation = "faceVarying")'))
    assert part.uvs == {}


def test_normals(tmp_path: Path) -> None:
    part = only(tmp_path, mesh('normal3f[] normals = [(0, 0, 1), (0, 1, 0)] (interpolation = "uniform")'))
    assert part.normals is not None
    assert corners(part, part.normals).tolist() == [[[0, 0, 1]] * 3] * 2 + [[[0, 1, 0]] * 3] * 2
    both = 'normal3f[] normals = [(0, 0, 1)] (interpolation = "constant")\n'
    both += 'normal3f[] primvars:normals = [(1, 0, 0)] (interpolation = "constant")'
    part = only(tmp_path, mesh(both))
    assert part.normals is not None and np.unique(part.normals, axis=0).tolist() == [[1, 0, 0]]


def test_displayed_colours_and_opacities(tmp_path: Path) -> None:
    part = only(tmp_path, mesh('color3f[] primvars:displayColor = [(0.5, 1, 0)] (interpolation = "constant")'))
    assert part.colours is not None and np.unique(part.colours, axis=0).tolist() == [[0.5, 1, 0, 1]]
    text = 'color3f[] primvars:displayColor = [(1, 0, 0), (0, 0, 1)] (interpolation = "uniform")\n'
    text += 'float[] primvars:displayOpacity = [0, 1, 1, 1, 1, 0.5] (interpolation = "vertex")'
    part = only(tmp_path, mesh(text))
    assert part.colours is not None
    assert corners(part, part.colours)[0].tolist() == [[1, 0, 0, 0], [1, 0, 0, 1], [1, 0, 0, 1]]
    assert corners(part, part.colours)[2].tolist() == [[0, 0, 1, 1], [0, 0, 1, 1], [0, 0, 1, 0.5]]
    text = (
        'def Xform "a"\n{\ncolor3f[] primvars:displayColor = [(0, 1, 0)] (interpolation = "constant")\n' + mesh() + "}"
    )
    part = only(tmp_path, text)
    assert part.colours is not None and part.colours[0].tolist() == [0, 1, 0, 1]


@pytest.mark.parametrize(
    ("shape", "expected", "size"),
    [
        ('def Cube "s"\n{\n}', 8, (2, 2, 2)),
        ('def Cube "s"\n{\ndouble size = 3\n}', 27, (3, 3, 3)),
        ('def Sphere "s"\n{\ndouble radius = 2\n}', 4 / 3 * np.pi * 8, (4, 4, 4)),
        ('def Cylinder "s"\n{\ndouble radius = 0.5\ndouble height = 4\n}', np.pi, (1, 1, 4)),
        ('def Cylinder "s"\n{\ndouble radius = 0.5\ndouble height = 4\ntoken axis = "X"\n}', np.pi, (4, 1, 1)),
        ('def Cone "s"\n{\ndouble radius = 1\ndouble height = 3\ntoken axis = "Y"\n}', np.pi, (2, 3, 2)),
        ('def Capsule "s"\n{\ndouble radius = 1\ndouble height = 3\n}', np.pi * (3 + 4 / 3), (2, 2, 5)),
    ],
)
def test_basic_shapes(tmp_path: Path, shape: str, expected: float, size: tuple[float, ...]) -> None:
    part = only(tmp_path, shape)
    assert volume(part) == pytest.approx(expected, rel=0.01)
    np.testing.assert_allclose(np.ptp(part.vertices, axis=0), size, rtol=0.005)
    np.testing.assert_allclose(part.vertices.max(axis=0), -part.vertices.min(axis=0), atol=0.005)
    # Normals are those of the faces, within half a segment.
    assert part.normals is not None
    a, b, c = np.moveaxis(part.vertices[part.faces], 1, 0)
    flat = np.cross(b - a, c - a)
    real = np.linalg.norm(flat, axis=1) > 1e-9
    flat = flat[real] / np.linalg.norm(flat[real], axis=1)[:, None]
    assert np.einsum("ti,tki->tk", flat, part.normals[part.faces[real]]).min() > 0.99


@pytest.mark.parametrize(("axis", "size"), [("X", (0, 3, 2)), ("Y", (2, 0, 3)), ("Z", (2, 3, 0))])
def test_a_plane(tmp_path: Path, axis: str, size: tuple[float, ...]) -> None:
    part = only(tmp_path, f'def Plane "s"\n{{\ndouble width = 2\ndouble length = 3\ntoken axis = "{axis}"\n}}')
    np.testing.assert_allclose(np.ptp(part.vertices, axis=0), size)
    np.testing.assert_allclose(area_vector(part.vertices, part.faces), 6 * np.eye(3)["XYZ".index(axis)])


def test_what_is_not_seen(tmp_path: Path) -> None:
    hidden = 'def Xform "a"\n{\ntoken visibility = "invisible"\n' + mesh(name="below") + "}\n"
    guides = "".join(mesh(f'uniform token purpose = "{p}"', p) for p in ("guide", "proxy", "render", "default"))
    found = model(tmp_path, hidden + guides + 'class Mesh "abstract"\n{\n}\nover "nothing"\n{\n}\n')
    assert [part.name for part in found.parts] == ["render", "default"]


def test_instances_share_their_parts(tmp_path: Path) -> None:
    prototype = 'def Xform "proto"\n{\n' + mesh() + 'def Cube "cube"\n{\n}\n}\n'
    copies = "".join(
        f'def Xform "i{x}" (instanceable = true\nreferences = </proto>)\n{{\ndouble3 xformOp:translate = ({x}, 0, 0)\n'
        'uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
        for x in (5, 7)
    )
    found = model(tmp_path, prototype + copies)
    assert len(found.parts) == 4  # those of the prototype of the file, and those of its instances
    shown = [(found.parts[each.part].name, each.matrix[0, 3]) for each in found.instances]
    assert shown == [("quad", 0), ("cube", 0), ("quad", 5), ("cube", 5), ("quad", 7), ("cube", 7)]
    assert found.instances[2].part == found.instances[4].part


def test_points_with_prototypes(tmp_path: Path) -> None:
    text = """def Xform "all"
{
    double3 xformOp:translate = (100, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def PointInstancer "many"
    {
        rel prototypes = [</all/many/a>, </all/many/b>]
        int[] protoIndices = [0, 1, 1, 0]
        point3f[] positions = [(0, 0, 0), (0, 10, 0), (0, 20, 0), (0, 30, 0)]
        quath[] orientations = [(1, 0, 0, 0), (0.70703125, 0, 0, 0.70703125), (1, 0, 0, 0), (1, 0, 0, 0)]
        float3[] scales = [(1, 1, 1), (2, 2, 2), (1, 1, 1), (1, 1, 1)]
        int64[] invisibleIds = [2]
        def Cube "a"
        {
        }
        def Xform "b"
        {
            double3 xformOp:translate = (1, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
            def Sphere "ball"
            {
            }
        }
    }
}
"""
    found = model(tmp_path, text)
    shown = [(found.parts[each.part].name, (each.matrix @ [0, 0, 0, 1])[:3]) for each in found.instances]
    assert [name for name, _ in shown] == ["a", "a", "ball"]
    np.testing.assert_allclose([at for _, at in shown], [[100, 0, 0], [100, 30, 0], [100, 12, 0]], atol=2e-2)
    assert np.cbrt(np.linalg.det(found.instances[2].matrix[:3, :3])) == pytest.approx(2, rel=1e-3)


def test_the_first_moment_is_shown(tmp_path: Path) -> None:
    text = 'def Xform "a"\n{\ndouble3 xformOp:translate.timeSamples = {3: (1, 0, 0), 9: (7, 0, 0)}\n'
    text += 'uniform token[] xformOpOrder = ["xformOp:translate"]\n' + mesh() + "}\n"
    with pytest.warns(SceneWarning, match=r"what moves is shown as it is at the first moment \(/a\)"):
        assert model(tmp_path, text).instances[0].matrix[0, 3] == 1
    with pytest.warns(SceneWarning):
        assert model(tmp_path, text, "startTimeCode = 5\nendTimeCode = 9").instances[0].matrix[0, 3] == 3


@pytest.mark.parametrize(
    ("indices", "weights", "kind"),
    [("[0]", "[1]", "constant"), ("[0, 0, 0, 0, 0, 0]", "[1, 1, 1, 1, 1, 1]", "vertex")],
)
def test_a_skeleton_poses_its_mesh(tmp_path: Path, indices: str, weights: str, kind: str) -> None:
    text = """def SkelRoot "root"
{
    def Skeleton "bones" (prepend apiSchemas = ["SkelBindingAPI"])
    {
        uniform token[] joints = ["a"]
        uniform matrix4d[] bindTransforms = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1))]
        uniform matrix4d[] restTransforms = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1))]
        rel skel:animationSource = </root/bones/move>
        def SkelAnimation "move"
        {
            uniform token[] joints = ["a"]
            float3[] translations = [(0, 5, 0)]
            quatf[] rotations = [(1, 0, 0, 0)]
            half3[] scales = [(1, 1, 1)]
        }
    }
"""
    skin = """
    rel skel:skeleton = </root/bones>
    int[] primvars:skel:jointIndices = INDICES (interpolation = "KIND"
        elementSize = 1)
    float[] primvars:skel:jointWeights = WEIGHTS (interpolation = "KIND"
        elementSize = 1)
    """
    for word, value in {"INDICES": indices, "WEIGHTS": weights, "KIND": kind}.items():
        skin = skin.replace(word, value)
    body = mesh(skin).replace('"MaterialBindingAPI"', '"SkelBindingAPI"')
    found = model(tmp_path, text + body + "}\n")
    points = found.parts[0].vertices @ found.instances[0].matrix[:3, :3].T + found.instances[0].matrix[:3, 3]
    np.testing.assert_allclose(points[:, 1], [5, 5, 6, 6, 5, 6])


def test_what_is_not_shown_is_one_line(tmp_path: Path) -> None:
    others = 'def BasisCurves "hair"\n{\n}\ndef Points "dust"\n{\n}\ndef Points "more"\n{\n}\n'
    others += 'def Material "m"\n{\ntoken outputs:mtlx:surface.connect = </m/s.outputs:out>\ndef Shader "s"\n{\n'
    others += 'uniform token info:id = "ND_standard_surface_surfaceshader"\ntoken outputs:out\n}\n}\n'
    smooth = QUAD.replace('"none"', '"catmullClark"')
    with pytest.warns(SceneWarning) as caught:
        model(tmp_path, mesh("rel material:binding = </m>", body=smooth) + others + mesh("", "other"))
    (said,) = [str(each.message) for each in caught]
    assert said.startswith(f"{tmp_path / 'scene.usda'}: ") and "\n" not in said
    assert "prims of the type BasisCurves are not shown (/hair)" in said
    assert "prims of the type Points are not shown (/dust, /more)" in said
    assert "materials without a UsdPreviewSurface are not shown (/m)" in said
    assert "surfaces that are to be subdivided are shown as they are (/quad)" in said


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (QUAD.replace("[4, 4]", "[4, 5]"), "meshes whose faces have less corners than they say"),
        (QUAD.replace("5, 2]", "6, 2]"), "meshes that refer to points that are not there"),
        (QUAD.replace("5, 2]", "-1, 2]"), "meshes that refer to points that are not there"),
    ],
)
def test_broken_meshes_are_left_out(tmp_path: Path, body: str, message: str) -> None:
    with pytest.warns(SceneWarning, match=message):
        assert len(model(tmp_path, mesh(body=body, name="bad") + mesh()).parts) == 1


def test_references_and_what_they_lack(tmp_path: Path) -> None:
    model(tmp_path, mesh(), 'defaultPrim = "quad"', "other.usda")
    text = 'def "a" (references = @other.usda@)\n{\n}\ndef "b" (references = @missing.usda@)\n{\n}\n'
    with pytest.warns(SceneWarning, match="USD says: .*missing.usda") as caught:
        assert len(model(tmp_path, text).instances) == 1
    assert len(caught) == 1


def test_every_container(tmp_path: Path) -> None:
    from pxr import Usd

    (tmp_path / "plain.usda").write_text("#usda 1.0\n" + mesh())
    stage = Usd.Stage.Open(str(tmp_path / "plain.usda"))
    for name in ("a.usdc", "b.usd"):
        stage.Export(str(tmp_path / name))
        assert len(read_stage(tmp_path / name).parts[0].faces) == 4
    with zipfile.ZipFile(tmp_path / "c.usdz", "w", zipfile.ZIP_STORED) as package:
        package.write(tmp_path / "a.usdc", "a.usdc")
    assert len(read_model(tmp_path / "c.usdz").parts[0].faces) == 4


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.usda", b"#usda 1.0\ndef Mesh {"),
        ("a.usda", b"no stage"),
        ("a.usdc", b"PXR-USDC"),
        ("a.usdz", b"PK"),
        ("a.usd", b""),
    ],
)
def test_damaged_files_are_one_line(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError) as caught:
        read_model(tmp_path / name)
    assert "unreadable as USD" in str(caught.value) and "\n" not in str(caught.value) and len(str(caught.value)) < 400


def test_without_the_package_one_is_told_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    (tmp_path / "a.usda").write_text("#usda 1.0\n" + mesh())
    with pytest.raises(InputError, match=r"pip install 'stratalux\[usd\]'"):
        read_model(tmp_path / "a.usda")


# ------------------------------- The process that reads -------------------------------


def test_a_process_of_its_own_gives_the_same(tmp_path: Path) -> None:
    text = mesh("texCoord2f[] primvars:st = [(0.5, 0.5)]") + 'def Points "dust"\n{\n}\ndef Camera "eye"\n{\n}\n'
    with pytest.warns(SceneWarning):
        here = model(tmp_path, text, "metersPerUnit = 2")
    with pytest.warns(SceneWarning) as caught:
        there = read_model(tmp_path / "scene.usda")
    assert [str(each.message) for each in caught] == [
        f"{tmp_path / 'scene.usda'}: prims of the type Points are not shown (/dust)"
    ]
    np.testing.assert_array_equal(there.parts[0].vertices, here.parts[0].vertices)
    np.testing.assert_array_equal(there.parts[0].uvs[0], here.parts[0].uvs[0])
    assert there.metres == 2 and there.cameras[0].name == "eye"


def test_a_reader_that_does_not_survive_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.usda").write_text("#usda 1.0\n" + mesh())
    monkeypatch.setattr(usd, "_PROGRAM", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    with pytest.raises(InputError, match=r"damaged: reading it ended the reader \(SIGSEGV\)"):
        read_model(tmp_path / "a.usda")
    monkeypatch.setattr(usd, "_PROGRAM", "import time; time.sleep(60)")
    monkeypatch.setattr(usd, "_SECONDS", 0.1)
    with pytest.raises(InputError, match="reading it was given up after 0.1 s"):
        read_model(tmp_path / "a.usda")


def test_a_stage_that_does_not_fit_into_memory_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def read(path: Path) -> Model:
        raise MemoryError

    monkeypatch.setattr("stratalux.scenes.formats.usd.stage.read_stage", read)
    kind, reason, told, _ = process.answer(tmp_path / "a.usda")
    assert (kind, told) == ("refused", []) and "its data do not fit into memory" in reason
