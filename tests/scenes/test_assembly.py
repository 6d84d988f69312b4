"""What a file holds, as parts of a Mitsuba scene: instances, lamps in their units, and materials that replace all."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from stratalux.errors import SceneWarning
from stratalux.scenes import assembly
from stratalux.scenes.assembly import assembled
from stratalux.scenes.lamps import dome_emitter
from stratalux.scenes.materials import material as named
from stratalux.scenes.model import NONE, Instance, Light, Material, Model, Picture
from stratalux.scenes.shapes import object_of
from tests.scenes.models import parts, seen, square

WHITE = Material(metallic=NONE, specular=NONE)
MATTE = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 1.0}}}


def at(x: float, y: float, z: float, scale: float = 1.0) -> Any:
    matrix = np.diag([scale, scale, scale, 1])
    matrix[:3, 3] = x, y, z
    return matrix


def lit(light: Light, size: float = 1.0) -> Any:
    """The picture of a white, matte square under a lamp."""
    shapes = parts(Model([square(WHITE)], [Instance(0, at(0, 0, 0, size))], [light]))
    for name in shapes:
        if name.startswith("object"):
            shapes[name] = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(size), "bsdf": MATTE}
    return seen(shapes, spp=256)


def test_a_light_of_n_lux_gives_n_over_pi_on_white() -> None:
    tilted = np.eye(4)
    tilted[:3, :3] = [[1, 0, 0], [0, 0.5, -np.sqrt(0.75)], [0, np.sqrt(0.75), 0.5]]  # 60 degrees
    for matrix, cosine in ((np.eye(4), 1), (tilted, 0.5)):
        image = lit(Light("distant", matrix, (300.0, 200.0, 100.0)))
        np.testing.assert_allclose(image[4, 4, :3], np.array([300, 200, 100]) * cosine / np.pi, rtol=1e-4)


def test_a_point_of_one_candela() -> None:
    """I / d² of irradiance, below it."""
    image = lit(Light("point", at(0, 0, 20), (800.0, 800.0, 800.0)))
    assert image[3:5, 3:5, 0].mean() == pytest.approx(800 / 400 / np.pi, rel=0.01)


def test_a_spot_shines_within_its_cone() -> None:
    light = Light("spot", at(0, 0, 2), (8.0, 8.0, 8.0), cone=(0.3, 0.33))
    image = seen(parts(Model([square(WHITE)], [Instance(0, np.eye(4))], [light])), spp=64)
    assert image[3:5, 3:5, 0].mean() > 0.4
    assert image[2, 2, 0] == 0


@pytest.mark.parametrize("kind", ["rectangle", "disk"])
def test_areas_shine_forward(kind: Any) -> None:
    """A large one before the square: E = π L, from the side to which it shines alone."""
    towards, away = at(0, 0, 6, 100), at(0, 0, 6, 100) @ np.diag([1.0, -1, -1, 1])
    assert lit(Light(kind, towards, (2.0, 2.0, 2.0), size=(2, 2)))[4, 4, 0] == pytest.approx(2, rel=0.02)
    assert lit(Light(kind, away, (2.0, 2.0, 2.0), size=(2, 2)))[4, 4, 0] == 0


def test_a_sphere_has_its_diameter() -> None:
    """Radiance L from a ball of radius r in the distance d: E = π L r² / d²."""
    image = lit(Light("sphere", at(0, 0, 8, 2), (3.0, 3.0, 3.0), size=(1, 1)))
    assert image[3:5, 3:5, 0].mean() == pytest.approx(3 / 64, rel=0.06)


def test_lamps_that_are_shown_otherwise_are_told() -> None:
    with pytest.warns(SceneWarning, match="'sun' is 0.5 degrees wide"):
        parts(
            Model([square()], [Instance(0, np.eye(4))], [Light("distant", np.eye(4), (1,) * 3, "sun", angle=0.00873)])
        )


def test_a_dome_points_where_it_says(tmp_path: Path) -> None:
    """Its middle is along -z of the light; a quarter turn about y moves it from there to -x."""
    texels = np.zeros((16, 32, 3), dtype=np.float32)
    texels[7:9, 15:17] = 100
    mi.Bitmap(texels).write(str(tmp_path / "map.exr"))
    image = Picture("map.exr", tmp_path / "map.exr")
    quarter = np.array([[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1.0]])
    for matrix, expected in ((np.eye(4), [0, 0, -1]), (quarter, [-1, 0, 0])):
        emitter = mi.load_dict(dome_emitter(tmp_path / "a.usda", Light("dome", matrix, (0.5,) * 3, picture=image)))
        si = mi.SurfaceInteraction3f()
        si.wi = -mi.Vector3f(expected)
        assert emitter.eval(si)[0][0] == pytest.approx(50, rel=0.01)


@pytest.mark.parametrize("many", [False, True])
def test_instances_stand_where_they_should(monkeypatch: pytest.MonkeyPatch, many: bool) -> None:
    monkeypatch.setattr(assembly, "_WORTH_AN_INSTANCE", 1 if many else 1000)
    mirrored = at(0, 0, 0, 0.2) @ np.diag([-1.0, 1, 1, 1])
    mirrored[:3, 3] = -1, 1, 0
    places = [at(-1, -1, 0, 0.2), at(1, 1, 0, 0.2), mirrored]
    shapes = parts(Model([square(WHITE)], [Instance(0, place) for place in places]))
    kinds = [part["type"] for part in shapes.values() if isinstance(part, dict)]
    assert kinds == (["shapegroup", "instance", "instance"] if many else [])
    scene = mi.load_dict({"type": "scene", **shapes})
    x, y = np.meshgrid([-1, 0, 1], [-1, 0, 1])
    origin = mi.Point3f(mi.Float(x.ravel()), mi.Float(y.ravel()), 5)
    hit = np.array(scene.ray_test(mi.Ray3f(origin, mi.Vector3f(0, 0, -1)))).reshape(3, 3)
    np.testing.assert_array_equal(hit, [[True, False, False], [False, False, False], [True, False, True]])


def test_a_named_material_replaces_all() -> None:
    found = object_of(Path("a"), Model.of(square(WHITE), square(Material(emission=WHITE.base_colour))))
    shapes = assembled(Path("a"), found, "gold")
    assert len(shapes) == 2
    for shape in shapes.values():
        assert not shape.is_emitter()
        assert str(shape.bsdf()) == str(mi.load_dict(named("gold")))


def test_what_says_nothing_is_clay() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (shape,) = parts(square(None)).values()
    assert str(shape.bsdf()) == str(mi.load_dict(named("clay")))


def test_what_is_far_away_comes_with_its_lamps_and_cameras() -> None:
    far = at(448250, 120, 5411930)
    found = object_of(Path("a"), Model([square()], [Instance(0, far)], [Light("point", far @ at(0, 3, 0), (1,) * 3)]))
    np.testing.assert_allclose(found.origin, [448250, 120, 5411930])
    np.testing.assert_allclose(found.lights[0].matrix[:3, 3], [0, 3, 0], atol=1e-6)
    np.testing.assert_allclose(found.bounds, [[-1, -1, 0], [1, 1, 0]], atol=1e-6)


def test_z_up_turns_lamps_too() -> None:
    found = object_of(
        Path("a"), Model([square()], [Instance(0, np.eye(4))], [Light("point", at(0, 0, 3), (1,) * 3)]), "z"
    )
    np.testing.assert_allclose(found.lights[0].matrix[:3, 3], [0, 3, 0], atol=1e-12)
