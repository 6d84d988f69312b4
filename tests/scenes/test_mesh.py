"""Meshes: every file format, orientation, shading normals, and every way a file can be bad."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from stratalux.errors import InputError, SceneWarning
from stratalux.scenes.mesh import TriangleMesh, smooth_shaded
from stratalux.scenes.model import Instance, Model, Part
from stratalux.scenes.shapes import FORMATS, load_mesh, object_of
from tests.helpers import asset
from tests.scenes.formats.gltf_files import Gltf


def written(folder: Path, mesh: trimesh.Trimesh | trimesh.Scene, extension: str, **options: object) -> Path:
    """The mesh in a file of the given format."""
    path = folder / f"mesh{extension}"
    if extension == ".gltf":
        scene = mesh if isinstance(mesh, trimesh.Scene) else trimesh.Scene(mesh)
        for name, data in scene.export(file_type="gltf", **options).items():
            (folder / (path.name if name.endswith(".gltf") else name)).write_bytes(data)
    else:
        mesh.export(path, **options)
    return path


def area(mesh: TriangleMesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices.astype(np.float64)[mesh.faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def volume(mesh: TriangleMesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices.astype(np.float64)[mesh.faces], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("extension", [suffix for suffix in FORMATS if not suffix.startswith(".usd")])
def test_every_format_reads_back_the_same_surface(tmp_path: Path, extension: str) -> None:
    box = trimesh.creation.box((1, 2, 3))
    mesh = load_mesh(written(tmp_path, box, extension), up="y")
    assert len(mesh.faces) == 12
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.bounds, box.bounds, atol=1e-6)
    assert volume(mesh) == pytest.approx(6, rel=1e-5)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    assert (mesh.vertices.dtype, mesh.faces.dtype, mesh.normals.dtype) == (np.float32, np.uint32, np.float32)


def test_an_upper_case_extension_is_the_same_format(tmp_path: Path) -> None:
    path = written(tmp_path, trimesh.creation.box(), ".ply").rename(tmp_path / "mesh.PLY")
    assert len(load_mesh(path).faces) == 12


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1, -1])
def test_up_turns_the_named_axis_to_y_without_mirroring(tmp_path: Path, axis: int, sign: int) -> None:
    cone = trimesh.creation.cone(radius=1, height=5)
    direction = np.zeros(3)
    direction[axis] = sign
    cone.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], direction))
    mesh = load_mesh(written(tmp_path, cone, ".ply"), up=("-" if sign < 0 else "") + "xyz"[axis])
    assert mesh.bounds[1, 1] - mesh.bounds[0, 1] == pytest.approx(5, abs=1e-4)
    apex = mesh.vertices[np.argmax(mesh.vertices[:, 1])]
    np.testing.assert_allclose(apex, [0, 5, 0], atol=1e-4)
    assert volume(mesh) == pytest.approx(cone.volume, rel=1e-4)


def test_stl_files_have_z_up_by_default(tmp_path: Path) -> None:
    box = trimesh.creation.box((1, 2, 3))
    assert np.ptp(load_mesh(written(tmp_path, box, ".stl")).bounds[:, 1]) == pytest.approx(3)
    assert np.ptp(load_mesh(written(tmp_path, box, ".ply")).bounds[:, 1]) == pytest.approx(2)


@pytest.mark.parametrize("extension", [".glb", ".gltf"])
def test_all_geometries_are_joined_with_their_transforms(tmp_path: Path, extension: str) -> None:
    scene = trimesh.Scene()
    box = trimesh.creation.box()
    scene.add_geometry(box, geom_name="box", transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    mirror = np.diag([-2.0, 2, 2, 1])
    scene.graph.update(frame_to="mirrored", geometry="box", matrix=mirror)
    mesh = load_mesh(written(tmp_path, scene, extension))
    assert len(mesh.faces) == 24
    np.testing.assert_allclose(mesh.bounds, [[-1, -1, -1], [5.5, 1, 1]], atol=1e-6)
    assert volume(mesh) == pytest.approx(9, rel=1e-5)


@pytest.mark.parametrize(
    ("extension", "option"),
    [(".ply", "vertex_normal"), (".obj", "include_normals"), (".glb", "include_normals")],
)
def test_normals_of_the_file_are_kept(tmp_path: Path, extension: str, option: str) -> None:
    box = trimesh.creation.box()
    tilted = trimesh.Trimesh(box.vertices, box.faces, vertex_normals=np.tile([0.6, 0.8, 0.0], (8, 1)), process=False)
    mesh = load_mesh(written(tmp_path, tilted, extension, **{option: True}))
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals, np.tile([0.6, 0.8, 0.0], (len(mesh.normals), 1)), atol=1e-6)


def test_unusable_normals_of_the_file_are_replaced(tmp_path: Path) -> None:
    path = tmp_path / "mesh.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nvn 0 0 1\nf 1//1 2//2 3//2\n")
    with pytest.warns(SceneWarning, match="the normals of 1 faces are not usable"):
        mesh = load_mesh(path)
    np.testing.assert_allclose(mesh.normals, np.tile([0, 0, 1], (3, 1)), atol=1e-6)


def test_a_cube_keeps_its_edges_and_a_sphere_is_smooth(tmp_path: Path) -> None:
    cube = load_mesh(written(tmp_path, trimesh.creation.box(), ".stl"))
    assert cube.normals is not None and len(cube.vertices) == 24
    assert np.all(np.sort(np.abs(cube.normals), axis=1) == [0, 0, 1])
    sphere = load_mesh(written(tmp_path, trimesh.creation.icosphere(subdivisions=4), ".stl"))
    assert sphere.normals is not None and len(sphere.vertices) == 2562
    np.testing.assert_allclose(sphere.normals, sphere.vertices, atol=5e-3)


def test_a_cylinder_is_smooth_around_and_sharp_at_its_rims(tmp_path: Path) -> None:
    mesh = load_mesh(written(tmp_path, trimesh.creation.cylinder(radius=1, height=2, sections=64), ".off"), up="z")
    assert mesh.normals is not None
    side = np.abs(mesh.normals[:, 1]) < 0.5
    radial = mesh.vertices * [1, 0, 1]
    np.testing.assert_allclose(mesh.normals[side], radial[side], atol=5e-3)
    np.testing.assert_allclose(np.abs(mesh.normals[~side, 1]), 1, atol=1e-5)


def test_faces_given_once_per_orientation_are_shaded_each_on_its_own_side() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=3)
    both = np.concatenate([sphere.faces, sphere.faces[:, ::-1]])
    mesh = smooth_shaded(TriangleMesh(sphere.vertices, both))
    assert mesh.normals is not None and len(mesh.vertices) == 2 * len(sphere.vertices)
    np.testing.assert_allclose(np.abs(np.sum(mesh.normals * mesh.vertices, axis=1)), 1, atol=1e-2)


def test_faces_without_area_and_stray_vertices_are_dropped(tmp_path: Path) -> None:
    path = tmp_path / "mesh.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 900 900 900\nv 0 0 0\nf 1 2 3\nf 1 1 2\nf 1 5 2\n")
    mesh = load_mesh(path)
    assert len(mesh.faces) == 1
    np.testing.assert_array_equal(mesh.bounds, [[0, 0, 0], [1, 1, 0]])


def test_no_triangle_is_shaded_on_its_own() -> None:
    """A hundred thousand take no more calls than ten: a loop over them in Python would take minutes for a real mesh."""

    def calls(subdivisions: int) -> int:
        sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
        soup = TriangleMesh(sphere.vertices[sphere.faces].reshape(-1, 3), np.arange(sphere.faces.size).reshape(-1, 3))
        counted = 0

        def count(*_: object) -> None:
            nonlocal counted
            counted += 1

        before = sys.getprofile()
        sys.setprofile(count)
        try:
            smooth_shaded(soup)
        finally:
            sys.setprofile(before)
        return counted

    calls(1)  # what is imported
    assert calls(6) < 2 * calls(1)


def test_mirroring_keeps_the_outside_outside() -> None:
    box = trimesh.creation.box()
    mesh = smooth_shaded(TriangleMesh(box.vertices, box.faces)).transformed(np.diag([-1.0, 2, 1, 1]))
    assert volume(mesh) == pytest.approx(2)
    assert mesh.normals is not None
    assert np.all(np.sum(mesh.normals * mesh.vertices, axis=1) > 0)


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("mesh.fbx", "", r"unknown mesh format '\.fbx'; use one of \.glb \.gltf \.obj \.off \.ply \.stl"),
        ("mesh", "", "unknown mesh format ''"),
        ("mesh.obj", None, "no such mesh file"),
        ("mesh.obj", "", "no faces"),
        ("mesh.obj", TRIANGLE, "no faces"),
        ("mesh.obj", TRIANGLE + "f 1 2 9\n", "a face refers to vertex 9, but the last is 3"),
        ("mesh.obj", TRIANGLE.replace("1 0 0", "nan 0 0") + "f 1 2 3\n", "not a finite"),
        ("mesh.obj", TRIANGLE.replace("1 0 0", "1e300 0 0") + "f 1 2 3\n", "not a finite"),
        ("mesh.obj", TRIANGLE.replace("1", "0") + "f 1 2 3\n", "zero extent"),
        ("mesh.obj", TRIANGLE.replace("0 1 0", "2 0 0") + "f 1 2 3\n", "zero extent"),
        ("mesh.stl", "\x00\xff garbage " * 20, "mesh.stl: "),
        ("mesh.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "mesh.off: "),
    ],
)
def test_bad_files_are_input_errors(tmp_path: Path, name: str, content: str | None, message: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_text(content, encoding="latin-1")
    with pytest.raises(InputError, match=message) as caught:
        load_mesh(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("extension", [".glb", ".gltf", ".off", ".ply", ".stl"])
@pytest.mark.parametrize("kept", [0.0, 0.02, 0.3, 0.6, 0.95])
def test_truncated_files_are_input_errors(tmp_path: Path, extension: str, kept: float) -> None:
    path = written(tmp_path, trimesh.creation.icosphere(subdivisions=2), extension)
    data = path.read_bytes()
    path.write_bytes(data[: int(kept * len(data))])
    with pytest.raises(InputError) as caught:
        load_mesh(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_a_truncated_text_ply_is_an_input_error(tmp_path: Path) -> None:
    path = written(tmp_path, trimesh.creation.icosphere(subdivisions=2), ".ply", encoding="ascii")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:-40]))
    with pytest.raises(InputError, match="cut short at 280 of the 320 faces"):
        load_mesh(path)


def test_an_unknown_up_axis_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="up axis 'w' is unknown; use one of x -x y -y z -z"):
        load_mesh(written(tmp_path, trimesh.creation.box(), ".ply"), up="w")


@pytest.mark.parametrize(
    ("vertices", "faces", "normals", "message"),
    [
        (np.zeros((3, 2)), np.zeros((1, 3)), None, r"vertices has shape \(3, 2\)"),
        (np.zeros((3, 3)), np.zeros((1, 4)), None, r"faces has shape \(1, 4\)"),
        (np.zeros((3, 3)), [[0, 1, 3]], None, "outside 0..2"),
        (np.zeros((3, 3)), [[0, 1, -1]], None, "outside 0..2"),
        (np.zeros((3, 3)), [[0, 1, 2]], np.zeros((2, 3)), "2 normals for 3 vertices"),
    ],
)
def test_arrays_that_do_not_fit_are_input_errors(
    vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray | None, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        TriangleMesh(vertices, np.asarray(faces), normals)


@pytest.mark.parametrize(("name", "faces", "tallest"), [("happy_buddha.obj", 100_000, 1), ("teapot.obj", 6_320, 0)])
def test_real_meshes(name: str, faces: int, tallest: int) -> None:
    mesh = load_mesh(asset(f"meshes/{name}"))
    assert mesh.normals is not None
    assert 0.98 * faces < len(mesh.faces) <= faces
    assert np.argmax(np.ptp(mesh.bounds, axis=0)) == tallest
    assert area(mesh) > 0
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-4)


FAR_AWAY = np.array([448250.0, 5411930.0, 120.0])


@pytest.mark.parametrize("extension", [".obj", ".off", ".ply", ".stl"])
def test_large_coordinates_keep_their_shape(tmp_path: Path, extension: str) -> None:
    """A ball of 1 m with millimetres of detail where surveyors put it, in files of double precision."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    points = np.round(ball.vertices, 6) + FAR_AWAY
    rows = "".join(f"{x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in points)
    path = tmp_path / f"mesh{extension}"
    if extension == ".obj":
        path.write_text("".join(f"v {row}\n" for row in rows.splitlines()) + "".join(
            f"f {a} {b} {c}\n" for a, b, c in ball.faces + 1
        ))  # fmt: skip
    elif extension == ".off":
        faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in ball.faces)
        path.write_text(f"OFF\n{len(points)} {len(ball.faces)} 0\n{rows}{faces}")
    elif extension == ".ply":
        header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n" + "".join(
            f"property double {axis}\n" for axis in "xyz"
        )
        header += f"element face {len(ball.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
        faces = np.zeros(len(ball.faces), [("count", "u1"), ("corners", "<i4", 3)])
        faces["count"], faces["corners"] = 3, ball.faces
        path.write_bytes(header.encode() + points.astype("<f8").tobytes() + faces.tobytes())
    else:
        facets = "".join(
            "facet normal 0 0 0\nouter loop\n"
            + "".join(f"vertex {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in points[face])
            + "endloop\nendfacet\n"
            for face in ball.faces
        )
        path.write_text(f"solid\n{facets}endsolid\n")
    mesh = load_mesh(path, up="y")
    assert len(mesh.faces) == len(ball.faces)
    assert volume(mesh) == pytest.approx(ball.volume, rel=1e-5)
    np.testing.assert_allclose(mesh.bounds, ball.bounds, atol=2e-6)
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals, mesh.vertices, atol=2e-2)


def test_a_mesh_near_the_origin_stays_where_it_is(tmp_path: Path) -> None:
    box = trimesh.creation.box().apply_translation([5, 6, 7])
    np.testing.assert_array_equal(load_mesh(written(tmp_path, box, ".ply")).bounds, box.bounds)


def test_nodes_far_away_keep_their_places_and_their_detail(tmp_path: Path) -> None:
    """Two boxes of 1 cm a metre apart, 5000 km from the origin; and a stray one that is not there."""
    gltf = Gltf()
    box = trimesh.creation.box((0.01, 0.01, 0.01))
    first = gltf.show(gltf.primitive(box.vertices, box.faces.ravel()), translation=[0.5, 0, 0])
    second = gltf.add("nodes", mesh=0, translation=[-0.5, 0, 0])
    gltf.add("nodes", translation=[5e6, 1e5, -4e6], children=[first, second])
    mesh = load_mesh(gltf.write(tmp_path / "scene.glb"))
    assert volume(mesh) == pytest.approx(2e-6, rel=1e-4)
    np.testing.assert_allclose(mesh.bounds, [[-0.505, -0.005, -0.005], [0.505, 0.005, 0.005]], atol=1e-7)


def test_instances_that_are_stretched_and_mirrored_keep_outside_and_normals(tmp_path: Path) -> None:
    gltf = Gltf()
    ball = trimesh.creation.icosphere(subdivisions=3)
    normals = {"NORMAL": gltf.accessor(ball.vertices)}
    gltf.show(gltf.primitive(ball.vertices, ball.faces.ravel(), attributes=normals), scale=[-1, 2, 3])
    gltf.add("nodes", mesh=0, translation=[9, 0, 0], scale=[1, -1, 1])
    gltf.show(gltf.primitive(ball.vertices, ball.faces.ravel()), translation=[0, 0, 9], scale=[-1, 2, 3])
    mesh = load_mesh(gltf.write(tmp_path / "scene.glb"))
    assert volume(mesh) == pytest.approx((6 + 1 + 6) * ball.volume, rel=1e-5)
    assert mesh.normals is not None
    assert np.all(np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1, abs=1e-5))
    near = mesh.vertices[:, 0] > 5
    centres = np.where(near[:, None], [9, 0, 0], np.where(mesh.vertices[:, 2:] > 4.5, [0, 0, 9], [0, 0, 0]))
    axes = np.where(near[:, None], [1, 1, 1], [1, 2, 3])
    # The normals of an ellipsoid are the gradient of (x/a)² + (y/b)² + (z/c)².
    expected = (mesh.vertices - centres) / axes**2
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    cosines = np.sum(expected * mesh.normals, axis=1)
    assert cosines[: 2 * len(ball.vertices)].min() > 1 - 1e-6
    assert cosines.min() > 0.95  # the third is flat


def test_creases_of_a_stretched_mesh_are_those_of_its_shape() -> None:
    """Edges of 90 degrees that flattening makes smooth, and those of 20 degrees that stretching makes sharp."""
    roof = np.array([[-1, 0, 0], [-1, 0, 1], [0, 1, 0], [0, 1, 1], [1, 0, 0], [1, 0, 1]], dtype=float)
    faces = np.array([[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]])
    for height, vertices in ((1.0, 8), (0.1, 6)):
        model = Model([Part(roof, faces)], [Instance(0, np.diag([1.0, height, 1, 1]))])
        (shape,) = object_of(Path("a"), model).shapes
        assert len(shape.mesh.vertices) == vertices


def test_many_instances_share_the_work(tmp_path: Path) -> None:
    gltf = Gltf()
    box = trimesh.creation.box()
    places = gltf.accessor(np.stack([2.0 * np.arange(500), np.zeros(500), np.zeros(500)], axis=1))
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}}
    gltf.show(gltf.primitive(box.vertices, box.faces.ravel()), extensions=extension)
    mesh = load_mesh(gltf.write(tmp_path / "scene.glb"))
    assert (len(mesh.faces), len(mesh.vertices)) == (6000, 12000)
    np.testing.assert_allclose(mesh.bounds, [[-0.5, -0.5, -0.5], [998.5, 0.5, 0.5]])
    assert volume(mesh) == pytest.approx(500, rel=1e-5)


def test_faces_without_normals_get_them_beside_those_that_have_some(tmp_path: Path) -> None:
    path = tmp_path / "mesh.obj"
    path.write_text(TRIANGLE + "v 1 1 5\nvn 0 0.6 0.8\nf 1//1 2//1 3//1\nf 2 4 3\n")
    mesh = load_mesh(path)
    assert mesh.normals is not None and len(mesh.vertices) == 6
    np.testing.assert_allclose(mesh.normals[mesh.faces[0]], np.tile([0, 0.6, 0.8], (3, 1)), atol=1e-6)
    a, b, c = mesh.vertices[mesh.faces[1]]
    normal = np.cross(b - a, c - a)
    np.testing.assert_allclose(mesh.normals[mesh.faces[1]], np.tile(normal / np.linalg.norm(normal), (3, 1)), atol=1e-6)
