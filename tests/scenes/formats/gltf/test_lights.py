"""Lights and cameras of glTF."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stratalux.errors import SceneWarning
from stratalux.scenes.formats import read_model
from stratalux.scenes.model import Model
from tests.scenes.formats.gltf_files import Gltf


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "scene.glb"


def with_light(path: Path, node: dict[str, Any] | None = None, **said: Any) -> Model:
    """A scene of a triangle and a node with a light, below one that is moved to x = 10."""
    gltf = Gltf(extensions={"KHR_lights_punctual": {"lights": [said]}})
    gltf.show_material()
    gltf.add("nodes", extensions={"KHR_lights_punctual": {"light": 0}}, **(node or {}))
    gltf.add("nodes", translation=[10, 0, 0], children=[1])
    return read_model(gltf.write(path))


@pytest.mark.parametrize(("kind", "expected"), [("point", "point"), ("spot", "spot"), ("directional", "distant")])
def test_kinds_of_lights(file: Path, kind: str, expected: str) -> None:
    """Intensity times colour, where the node is: half a turn about y takes -z to z."""
    node = {"rotation": [0, 1, 0, 0], "translation": [0, 2, 0], "name": "lamp"}
    model = with_light(file, node, type=kind, intensity=50, color=[0.8, 0.5, 0], name="bulb")
    (light,) = model.lights
    assert (light.kind, light.colour, light.name) == (expected, (40, 25, 0), "lamp")
    np.testing.assert_allclose(light.matrix[:3, 3], [10, 2, 0])
    np.testing.assert_allclose(light.matrix[:3, :3] @ [0, 0, -1], [0, 0, 1], atol=1e-12)


def test_what_a_light_has_by_default(file: Path) -> None:
    (light,) = with_light(file, type="spot", name="bulb").lights
    assert (light.colour, light.cone, light.name) == ((1, 1, 1), (0, math.pi / 4), "bulb")


def test_the_cone_of_a_spot(file: Path) -> None:
    (light,) = with_light(file, type="spot", spot={"innerConeAngle": 0.2, "outerConeAngle": 0.6}).lights
    assert light.cone == (0.2, 0.6)


def test_lights_of_other_kinds_and_ranges_are_told(file: Path) -> None:
    with pytest.warns(SceneWarning, match="a light of the kind 'tube' is not shown"):
        assert with_light(file, type="tube").lights == []
    with pytest.warns(SceneWarning, match="where the range of a light ends is not shown"):
        assert len(with_light(file, type="point", range=3).lights) == 1


def test_a_perspective_camera(file: Path) -> None:
    gltf = Gltf()
    gltf.show_material()
    said = {"yfov": 0.7, "aspectRatio": 1.5, "znear": 0.1}
    gltf.add(
        "nodes", camera=gltf.add("cameras", type="perspective", perspective=said), translation=[1, 2, 3], name="eye"
    )
    gltf.add("nodes", camera=gltf.add("cameras", type="perspective", perspective={"yfov": 1}, name="other"))
    eye, other = read_model(gltf.write(file)).cameras
    assert (eye.fov, eye.aspect, eye.height, eye.name) == (0.7, 1.5, None, "eye")
    np.testing.assert_array_equal(eye.matrix[:3, 3], [1, 2, 3])
    assert (other.aspect, other.name) == (None, "other")


def test_an_orthographic_camera(file: Path) -> None:
    gltf = Gltf()
    gltf.show_material()
    said = {"xmag": 6, "ymag": 2, "znear": 0, "zfar": 1}
    gltf.add("nodes", camera=gltf.add("cameras", type="orthographic", orthographic=said))
    (camera,) = read_model(gltf.write(file)).cameras
    assert (camera.height, camera.aspect) == (4, 3)


@pytest.mark.filterwarnings("ignore::stratalux.errors.SceneWarning")
def test_numbers_of_lights_are_clamped_to_their_range(file: Path) -> None:
    spot = {"innerConeAngle": 3, "outerConeAngle": 2}
    (light,) = with_light(file, type="spot", intensity=-1, spot=spot).lights
    assert (light.colour, light.cone) == ((0, 0, 0), (math.pi / 2, math.pi / 2))
    (light,) = with_light(file, type="spot", spot={"innerConeAngle": -1, "outerConeAngle": -1}).lights
    assert light.cone == (0, 0)


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("perspective", {}),
        ("perspective", {"yfov": 0}),
        ("perspective", {"yfov": 4}),
        ("perspective", {"yfov": 1, "aspectRatio": -0.5}),
        ("orthographic", {}),
        ("orthographic", {"xmag": 1}),
        ("orthographic", {"ymag": 1}),
    ],
)
def test_a_camera_that_sees_nothing_is_told(file: Path, kind: str, said: dict[str, float]) -> None:
    gltf = Gltf()
    gltf.show_material()
    gltf.add("nodes", camera=gltf.add("cameras", type=kind, **{kind: said}, name="shut"))
    with pytest.warns(SceneWarning, match="the camera 'shut', which has no field of view is not shown"):
        assert read_model(gltf.write(file)).cameras == []


def test_lights_and_cameras_of_what_is_not_shown_are_not_there(file: Path) -> None:
    gltf = Gltf(extensions={"KHR_lights_punctual": {"lights": [{"type": "point"}]}})
    gltf.show_material()
    gltf.add("cameras", type="perspective", perspective={"yfov": 1})
    lamp = {"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}
    gltf.add("nodes", **lamp)
    hidden = {"KHR_lights_punctual": {"light": 0}, "KHR_node_visibility": {"visible": False}}
    gltf.add("nodes", camera=0, extensions=hidden)
    gltf.json["scenes"] = [{"nodes": [0, 2]}]
    model = read_model(gltf.write(file))
    assert (model.lights, model.cameras) == ([], [])
    gltf.json["scenes"] = [{"nodes": [0, 1]}]
    model = read_model(gltf.write(file))
    assert (len(model.lights), len(model.cameras)) == (1, 1)
    assert (model.metres, model.up) == (1.0, "y")
