"""From what people have to a scene."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import stratalux
from stratalux import EnvironmentMap, InputError
from stratalux.scenes.camera import sensor
from stratalux.scenes.load import load_scene
from stratalux.scenes.settings import ENV_FRAMES, CameraSettings

WHITE = EnvironmentMap.from_array(np.ones((4, 8, 3)))


@pytest.mark.parametrize("scale", [float("nan"), float("inf"), -1.0, 1e31])
def test_factors_that_are_none_for_light_are_refused(scale: float) -> None:
    with pytest.raises(InputError, match=re.escape(f"scale: {scale} is ")):
        load_scene("demo", environment=WHITE, scale=scale)


def test_a_factor_that_makes_a_map_too_bright_is_refused() -> None:
    bright = EnvironmentMap.from_array(np.full((4, 8, 3), 1e19))
    with pytest.raises(InputError, match="1e\\+15 times it is more than can be reckoned with"):
        load_scene("demo", environment=bright, scale=1e15, size=(8, 8))


@pytest.mark.parametrize("angle", [float("nan"), float("inf")])
def test_angles_that_are_none_are_refused(angle: float) -> None:
    with pytest.raises(InputError, match="is not finite; give degrees"):
        load_scene("demo", environment=WHITE, rotate=(0, angle, 0))


def test_the_map_is_turned_and_scaled() -> None:
    scene = load_scene("demo", environment=WHITE, scale=3, rotate=(0, 90, 0), size=(8, 8))
    params = mi.traverse(scene.environment())
    assert params["scale"].numpy() == 3
    turned = params["to_world"].matrix.numpy().reshape(4, 4)[:3, :3]
    np.testing.assert_allclose(turned, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-6)


# ------------------------------- Where a map stands -------------------------------

WIDTH, HEIGHT = 256, 128
VIEWS = {"near": 5, "far": 7}
"""Cameras by name, and the widths of their films."""


@pytest.fixture
def tetrahedron(tmp_path: Path) -> Path:
    path = tmp_path / "tetrahedron.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    return path


def labelled_map() -> EnvironmentMap:
    """A map that says where in it one is: cos 2πu, sin 2πu (both + 2) and v, from its upper left corner."""
    u, v = np.meshgrid((np.arange(WIDTH) + 0.5) / WIDTH, np.arange(HEIGHT) / (HEIGHT - 1))
    return EnvironmentMap.from_array(np.stack([2 + np.cos(2 * np.pi * u), 2 + np.sin(2 * np.pi * u), v], axis=-1))


def place_in_map(scene: mi.Scene, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(u, v) of what light from ``directions`` (N, 3) comes from, in a scene under the labelled map."""
    si = dr.zeros(mi.SurfaceInteraction3f, len(directions))
    si.wi = -mi.Vector3f(directions.T)
    cosine, sine, v = np.array(scene.environment().eval(si))
    return np.arctan2(sine - 2, cosine - 2) / (2 * np.pi) % 1, v


def mitsuba(d: np.ndarray) -> tuple[Any, Any]:
    return np.arctan2(d[0], -d[2]) / (2 * np.pi), np.arccos(d[1]) / np.pi


def openexr(d: np.ndarray) -> tuple[Any, Any]:
    """OpenEXR, and USD with it: longitude π is on the left, 0 towards +z and π/2 towards +x."""
    return 0.5 - np.arctan2(d[0], d[2]) / (2 * np.pi), 0.5 - np.arcsin(d[1]) / np.pi


def three(d: np.ndarray) -> tuple[Any, Any]:
    """equirectUv in three.js, whose v goes up."""
    return np.arctan2(d[2], d[0]) / (2 * np.pi) + 0.5, 1 - (np.arcsin(d[1]) / np.pi + 0.5)


def khronos(d: np.ndarray) -> tuple[Any, Any]:
    """dirToUV of the glTF Sample Renderer, after its rotation of 90 degrees; its v goes up."""
    turned = np.array([d[2], d[1], -d[0]])
    return 0.5 + 0.5 * np.arctan2(turned[2], turned[0]) / np.pi, 1 - (1 - np.arccos(turned[1]) / np.pi)


def blender(d: np.ndarray) -> tuple[Any, Any]:
    """direction_to_equirectangular of Cycles, whose v goes up, in a world that glTF's y-up one is imported into."""
    x, y, z = d[0], -d[2], d[1]
    return 0.5 - np.arctan2(y, x) / (2 * np.pi), 1 - (np.arctan2(z, np.hypot(x, y)) / np.pi + 0.5)


@pytest.mark.parametrize(
    ("frame", "lookup"),
    [("mitsuba", mitsuba), ("mitsuba", openexr), ("mitsuba", khronos), ("three", three), ("blender", blender)],
)
def test_a_map_stands_as_the_formula_of_a_tool_says(
    tetrahedron: Path, frame: str, lookup: Callable[[np.ndarray], Any]
) -> None:
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = directions[np.abs(directions[:, 1]) < 0.99]
    scene = load_scene(tetrahedron, environment=labelled_map(), env_frame=frame, size=(8, 8))
    u, v = place_in_map(scene, directions)
    wanted_u, wanted_v = lookup(directions.T)
    assert np.abs((u - wanted_u + 0.5) % 1 - 0.5).max() < 1e-3
    np.testing.assert_allclose(v, wanted_v, atol=1e-3)


def test_every_frame_is_compared_with_a_formula() -> None:
    assert set(ENV_FRAMES) == {"mitsuba", "three", "blender"}


@pytest.mark.parametrize(("frame", "middle"), [("mitsuba", 0.0), ("blender", 90.0), ("three", 90.0)])
@pytest.mark.parametrize("angle", [0.0, 30.0, -100.0])
def test_the_map_turns_counter_clockwise_seen_from_above_as_the_camera_does(
    tetrahedron: Path, frame: str, middle: float, angle: float
) -> None:
    scene = load_scene(tetrahedron, environment=labelled_map(), env_frame=frame, rotate=(0, angle, 0), size=(8, 8))
    azimuth = np.radians(middle + angle)  # from +z towards +x
    (u,), _ = place_in_map(scene, np.array([[np.sin(azimuth), 0, np.cos(azimuth)]]))
    assert u == pytest.approx(0.5, abs=1e-3)
    # A camera at this azimuth has the middle of the map in its back.
    towards = sensor(CameraSettings(orbit=(middle + angle, 0)), np.eye(3))["to_world"].matrix
    np.testing.assert_allclose(-np.array(towards)[:3, 2], [np.sin(azimuth), 0, np.cos(azimuth)], atol=1e-6)


def test_the_frame_comes_before_other_turns(tetrahedron: Path) -> None:
    """Upside down about x after the turn about y: the middle, at +x, stays there, and what is up goes down."""
    scene = load_scene(tetrahedron, environment=labelled_map(), env_frame="three", rotate=(180, 0, 0), size=(8, 8))
    (u, _), (v, below) = place_in_map(scene, np.array([[1.0, 0, 0], [0, -1, 0]]))
    assert u == pytest.approx(0.5, abs=1e-3) and v == pytest.approx(0.5, abs=1e-3) and below < 1e-3


def test_the_frame_comes_before_the_turn_that_a_scene_has(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    turn = '<transform name="to_world"><rotate x="1" angle="90"/></transform>'
    mi.Bitmap(labelled_map().texels).write(str(tmp_path / "map.exr"))
    light = f'<emitter type="envmap"><string name="filename" value="map.exr"/>{turn}</emitter>'
    path.write_text(f'<scene version="3.0.0"><sensor type="perspective"/>{light}</scene>')
    # The middle at +x stays there, and what was up comes to +z.
    (u, _), (_, v) = place_in_map(load_scene(path, env_frame="three"), np.array([[1.0, 0, 0], [0, 0, 1]]))
    assert u == pytest.approx(0.5, abs=1e-3) and v < 1e-3


def test_there_has_to_be_a_map_that_stands_in_a_frame(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    path.write_text('<scene version="3.0.0"><sensor type="perspective"/><emitter type="constant"/></scene>')
    with pytest.raises(InputError, match="no environment map to rotate"):
        load_scene(path, env_frame="blender")


# ------------------------------- From where it is seen -------------------------------


def test_the_demo_and_meshes_are_seen_from_where_one_says(tetrahedron: Path) -> None:
    for source in ("demo", tetrahedron):
        scene = load_scene(source, environment=WHITE, size=(8, 6), orbit=(90, 0), fov=20)
        (seen,) = scene.sensors()
        matrix = seen.world_transform().matrix.numpy().reshape(4, 4)
        np.testing.assert_allclose(matrix[:3, 2], [-1, 0, 0], atol=1e-6)
        assert tuple(seen.film().size()) == (8, 6)
        with pytest.raises(InputError, match="camera 'front': the file has none"):
            load_scene(source, environment=WHITE, camera="front")


def test_a_camera_of_a_mitsuba_scene_is_chosen(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    film = '<film type="hdrfilm"><integer name="width" value="{}"/><integer name="height" value="4"/></film>'
    sensors = "".join(f'<sensor type="perspective" id="{name}">{film.format(w)}</sensor>' for name, w in VIEWS.items())
    path.write_text(f'<scene version="3.0.0">{sensors}<emitter type="constant"/></scene>')
    for wanted, width in (("auto", 5), (0, 5), (1, 7), ("near", 5), ("far", 7)):
        assert stratalux.render(path, camera=wanted, spp=1).image.shape[:2] == (4, width)
        assert stratalux.render(load_scene(path), camera=wanted, spp=1).image.shape[:2] == (4, width)
    for asked, message in (
        ({"camera": "middle"}, r"camera 'middle': there is none; give one of 0 \('near'\), 1 \('far'\)"),
        ({"orbit": (0, 0)}, "orbit: a Mitsuba scene brings its own cameras"),
    ):
        with pytest.raises(InputError, match=message):
            stratalux.render(path, spp=1, **asked)
    with pytest.raises(InputError, match="setting 'orbit': the scene is loaded already"):
        stratalux.render(load_scene(path), orbit=(0, 0))
