"""Files that others have made. What is expected was counted in their JSON, by other means than the reader."""

from __future__ import annotations

import warnings
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest

from stratalux.errors import SceneWarning
from stratalux.scenes.formats import read_model
from stratalux.scenes.model import Material, Model, Texture
from tests.helpers import asset

# Parts, triangles, materials, textures, images, lights and cameras.
MODELS = [
    ("AlphaBlendModeTest.glb", 9, 61, 6, 8, 8, 0, 1),
    ("AnisotropyStrengthTest.glb", 50, 97240, 50, 1, 1, 0, 0),
    ("AttenuationTest.glb", 18, 232, 18, 2, 2, 0, 0),
    ("BoxMeshopt.glb", 1, 12, 1, 0, 0, 0, 0),
    ("BoxVertexColors.glb", 1, 12, 1, 0, 0, 0, 0),
    ("CesiumMilkTruck.glb", 4, 2856, 4, 1, 1, 0, 0),
    ("ClearCoatTest.glb", 27, 37116, 19, 6, 6, 0, 0),
    ("CornellBox.glb", 6, 36, 5, 0, 0, 0, 0),
    ("Duck.glb", 1, 4212, 1, 1, 1, 0, 1),
    ("FlightHelmet/FlightHelmet.gltf", 6, 94722, 6, 15, 15, 0, 0),
    ("Fox.glb", 1, 576, 1, 1, 1, 0, 0),
    ("Lights.glb", 1, 12, 1, 0, 0, 4, 1),
    ("NormalTangentTest.glb", 1, 7774, 1, 3, 3, 0, 0),
    ("PBR_Spheres.glb", 12, 100320, 12, 12, 12, 0, 0),
    ("SpecularTest.glb", 24, 44828, 24, 4, 4, 0, 0),
    ("SunglassesKhronos.glb", 8, 13396, 5, 1, 1, 0, 0),
    ("TonemappingTest/TonemappingTest.gltf", 8, 6590, 8, 1, 1, 0, 0),
    ("TransmissionRoughnessTest.glb", 9, 77792, 9, 5, 5, 0, 0),
    ("TwoSidedPlane.glb", 1, 2, 1, 3, 3, 0, 0),
    ("geometry-camera-light.glb", 2, 14, 2, 0, 0, 2, 2),
    ("heart_draco.glb", 1, 180, 1, 0, 0, 0, 0),
    ("simple-instancing.glb", 1, 12, 1, 0, 0, 0, 0),
]
NEEDS = {"BoxMeshopt.glb": "meshopt", "heart_draco.glb": "DracoPy"}


def load(name: str) -> Model:
    pytest.importorskip(NEEDS.get(name, "numpy"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return read_model(asset(f"models/{name}"))


def textures(said: Any) -> list[Texture]:
    """All textures within a material or a part of one."""
    if isinstance(said, Texture):
        return [said]
    return (
        [each for field in fields(said) for each in textures(getattr(said, field.name))] if is_dataclass(said) else []
    )


def looks(model: Model) -> list[Material]:
    found = {id(part.material): part.material for part in model.parts}
    return [material for material in found.values() if material is not None]


@pytest.mark.parametrize(("name", "expected"), [(name, numbers) for name, *numbers in MODELS])
def test_what_is_in_a_file(name: str, expected: list[int]) -> None:
    if name == "SunglassesKhronos.glb":
        with pytest.warns(SceneWarning, match="KHR_materials_iridescence is not shown"):
            model = read_model(asset(f"models/{name}"))
    else:
        model = load(name)
    found = looks(model)
    used = {id(texture): texture for material in found for texture in textures(material)}
    pictures = {id(texture.picture) for texture in used.values()}
    faces = sum(len(part.faces) for part in model.parts)
    lamps, eyes = len(model.lights), len(model.cameras)
    assert [len(model.parts), faces, len(found), len(used), len(pictures), lamps, eyes] == expected


def test_a_box_compressed_by_meshoptimizer() -> None:
    model = load("BoxMeshopt.glb")
    part, matrix = model.parts[0], model.instances[0].matrix
    placed = part.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_allclose([placed.min(axis=0), placed.max(axis=0)], [[-0.5] * 3, [0.5] * 3], atol=1e-4)
    assert part.normals is not None
    np.testing.assert_allclose(np.abs(part.normals).sum(axis=1), 1, atol=1e-6)
    corners = placed[part.faces]
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(1, abs=1e-3)  # the volume: all faces look outwards


def test_instances_of_a_file() -> None:
    assert len(load("simple-instancing.glb").instances) == 125


def test_lights_and_cameras_of_a_file() -> None:
    """Under the lamps of this file from Blender are nodes that turn them, and the lamps take their names from these."""
    lights = load("Lights.glb").lights
    assert [light.kind for light in lights] == ["point", "spot", "spot", "distant"]
    assert [light.colour for light in lights][:3] == [(5, 0, 0), (0, 10, 0), (0, 0, 10)]
    np.testing.assert_allclose(lights[0].matrix[:3, 3], [2.598804473876953, 3.5685081481933594, -1.0054539442062378])
    np.testing.assert_allclose(lights[1].cone, [0.3337942263919169, 0.39269909262657166])
    perspective, orthographic = load("geometry-camera-light.glb").cameras
    assert (perspective.name, perspective.aspect) == ("CameraPersp", pytest.approx(16 / 9))
    assert (orthographic.height, orthographic.aspect) == (27, 1)


def test_looks_of_files() -> None:
    lamp = next(look for look in looks(load("CornellBox.glb")) if look.name == "Emitter_Light_temp")
    assert lamp.emission.factor == (100, 100, 100)
    glass = next(look for look in looks(load("AttenuationTest.glb")) if look.name == "R2_ThicknessFac_1.5")
    assert (glass.transmission.factor, glass.thin, glass.attenuation) == ((1,), False, (0.1, 0.5, 0.9))
    strengths = {look.anisotropy.factor[0] for look in looks(load("AnisotropyStrengthTest.glb"))}
    np.testing.assert_allclose(sorted(strengths), np.arange(7) / 6)
    colours = load("BoxVertexColors.glb").parts[0].colours
    assert colours is not None and colours.shape == (24, 4) and colours.max() == 1
    helmet = looks(load("FlightHelmet/FlightHelmet.gltf"))
    assert all(look.normal is not None for look in helmet)
    assert {look.alpha_mode for look in helmet} == {"opaque", "blend"}
