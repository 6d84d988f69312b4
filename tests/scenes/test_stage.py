"""The stage: meshes in Mitsuba, framing at any aspect ratio, materials, and bad arguments."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
import trimesh

from stratalux.errors import InputError
from stratalux.scenes.assembly import to_mitsuba
from stratalux.scenes.camera import MARGIN
from stratalux.scenes.materials import MATERIALS, material
from stratalux.scenes.mesh import TriangleMesh, smooth_shaded
from stratalux.scenes.shapes import load_mesh
from stratalux.scenes.stage import stage, standing
from tests.helpers import asset
from tests.variants import MONO, RGB, SPECTRAL

SKY = {"type": "constant"}


@pytest.fixture(autouse=True)
def variant() -> Iterator[None]:
    before = mi.variant()
    mi.set_variant(RGB)
    yield
    if before is not None:
        mi.set_variant(before)


def from_trimesh(mesh: trimesh.Trimesh) -> TriangleMesh:
    return smooth_shaded(TriangleMesh(mesh.vertices, mesh.faces))


SHAPES = {
    "cube": from_trimesh(trimesh.creation.box()),
    "tower": from_trimesh(trimesh.creation.box((0.5, 9, 0.7))).transformed(np.diag([70.0, 70, 70, 1])),
    "plate": from_trimesh(trimesh.creation.box((8, 0.02, 5))),
    "wall": from_trimesh(trimesh.creation.box((0.01, 3, 6))),
    "far away": from_trimesh(trimesh.creation.icosphere(2)).transformed(
        [[1e-3, 0, 0, 50], [0, 1e-3, 0, -20], [0, 0, 1e-3, 30], [0, 0, 0, 1]]
    ),
}


def coverage(scene: Any, width: int, height: int) -> np.ndarray:
    """Which of (height, width) points of the film see something."""
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    position = mi.Point2f(mi.Float(x.ravel().astype(np.float32)), mi.Float(y.ravel().astype(np.float32)))
    ray, _ = scene.sensors()[0].sample_ray(0, 0.5, position, mi.Point2f(0.5))
    return np.array(scene.ray_intersect_preliminary(ray).is_valid()).reshape(height, width)


def free_borders(scene: Any, aspect: float) -> tuple[float, float, float, float]:
    """How much of the film is free to the left, right, top and bottom of all there is to see."""
    height = 160
    width = round(height * aspect)
    seen = coverage(scene, width, height)
    x, y = np.flatnonzero(seen.any(axis=0)), np.flatnonzero(seen.any(axis=1))
    return x[0] / width, 1 - (x[-1] + 1) / width, y[0] / height, 1 - (y[-1] + 1) / height


def check_framing(mesh: TriangleMesh, size: tuple[int, int]) -> None:
    scene = mi.load_dict(stage(mesh, material("diffuse"), SKY, size=size, ground=False))
    left, right, top, bottom = free_borders(scene, size[0] / size[1])
    tolerance = 0.02
    assert min(left, right, top, bottom) > MARGIN - tolerance
    # As close as it gets: one direction is filled up to the margins.
    assert max(left, right) < MARGIN + tolerance or max(top, bottom) < MARGIN + tolerance
    # And the object is in the middle of the other.
    assert abs(left - right) < 2 * tolerance and abs(top - bottom) < 2 * tolerance


@pytest.mark.parametrize("size", [(600, 400), (400, 600), (300, 300), (900, 200), (200, 900)])
@pytest.mark.parametrize("name", SHAPES)
def test_the_object_fills_the_frame_and_stays_inside(name: str, size: tuple[int, int]) -> None:
    check_framing(SHAPES[name], size)


@pytest.mark.parametrize("name", ["happy_buddha.obj", "teapot.obj"])
def test_real_meshes_are_framed(name: str) -> None:
    check_framing(load_mesh(asset(f"meshes/{name}")), (600, 400))


def test_the_object_is_upright_and_seen_from_the_front_right() -> None:
    cone = from_trimesh(trimesh.creation.cone(radius=1, height=2)).transformed(
        [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]]
    )
    scene = mi.load_dict(stage(cone, material("diffuse"), SKY, ground=False))
    seen = coverage(scene, 60, 40).sum(axis=1)
    rows = np.flatnonzero(seen)
    assert seen[rows[1]] < seen[rows[-8]]
    position = np.array(scene.sensors()[0].world_transform().matrix)[:3, 3]
    assert position[0] > 0 and position[1] > 0 and position[2] > position[0]


def test_standing_centres_the_object_on_the_ground() -> None:
    for mesh in SHAPES.values():
        low, high = standing(mesh).bounds
        np.testing.assert_allclose(low[[0, 2]], -high[[0, 2]], atol=1e-4)
        assert low[1] == pytest.approx(0, abs=1e-4)
        assert np.linalg.norm(high - low) == pytest.approx(2, rel=1e-3)


def test_the_ground_fills_the_frame_below_the_horizon() -> None:
    scene = mi.load_dict(stage(SHAPES["cube"], material("diffuse"), SKY))
    assert coverage(scene, 60, 40).all()


@pytest.mark.parametrize("name", [RGB, MONO, SPECTRAL])
@pytest.mark.parametrize("with_normals", [True, False])
def test_a_mesh_comes_over_in_every_variant(name: str, with_normals: bool) -> None:
    mi.set_variant(name)
    mesh = SHAPES["cube"]
    mesh = mesh if with_normals else TriangleMesh(mesh.vertices, mesh.faces)
    shape = to_mitsuba(mesh, material("diffuse"), "thing")
    assert shape.id() == "thing"
    assert (shape.vertex_count(), shape.face_count()) == (24, 12)
    assert shape.has_vertex_normals() is with_normals
    assert shape.surface_area()[0] == pytest.approx(6, rel=1e-4)
    params = mi.traverse(shape)
    np.testing.assert_array_equal(np.array(params["faces"]).reshape(-1, 3), mesh.faces)
    scene = mi.load_dict({"type": "scene", "shape": shape, "light": {"type": "constant"}})
    hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(0, 0, 5), mi.Vector3f(0, 0, -1)))
    np.testing.assert_allclose(np.array(hit.sh_frame.n).ravel(), [0, 0, 1], atol=1e-5)
    assert "TwoSided" in str(hit.bsdf())


def test_the_scene_renders() -> None:
    scene = stage(SHAPES["cube"], material("diffuse"), SKY, size=(30, 20), spp=4, sampler="multijitter")
    assert "integrator" not in scene
    image = np.array(mi.render(mi.load_dict({**scene, "integrator": {"type": "direct"}})))
    assert image.shape == (20, 30, 3) and image.dtype == np.float32
    assert 0.1 < image.mean() < 1


@pytest.mark.parametrize("name", MATERIALS)
def test_materials_are_two_sided_and_load(name: str) -> None:
    bsdf = mi.load_dict(material(name))
    assert mi.has_flag(bsdf.flags(), mi.BSDFFlags.FrontSide)
    assert mi.has_flag(bsdf.flags(), mi.BSDFFlags.BackSide)
    delta = mi.has_flag(bsdf.flags(), mi.BSDFFlags.DeltaReflection)
    assert delta is (name in ("mirror", "ceramic"))
    assert MATERIALS[name].description and "\n" not in MATERIALS[name].description


def test_materials_are_copies() -> None:
    material("gold")["type"] = "changed"
    assert material("gold")["type"] == "twosided"


def test_an_unknown_material_is_an_input_error() -> None:
    with pytest.raises(InputError, match="material 'wood' is unknown; use one of clay, diffuse, plastic, .*mirror"):
        material("wood")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"size": (0, 10)}, "size 0x10: width and height must be at least 1"),
        ({"size": (10, -1)}, "size 10x-1"),
        ({"spp": 0}, "spp 0"),
        ({"sampler": "sobol"}, "sampler 'sobol' is unknown; use one of independent, .*ldsampler"),
    ],
)
def test_bad_arguments_are_input_errors(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        stage(SHAPES["cube"], material("diffuse"), SKY, **options)
