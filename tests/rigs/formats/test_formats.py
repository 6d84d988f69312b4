"""Every format of rigs, read back by other means: where the lights are, and what they give to what faces them.

A light that stands for a texel must shine from where the tool shows this texel: each tool's published lookup of a map
finds (u, v) of the light's direction in the tool's own axes.
"""

from __future__ import annotations

import csv
import json
import math
import re
import sys
import types
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux.errors import InputError, RigWarning
from stratalux.maps.geometry import direction, map_coordinates
from stratalux.rigs.formats import FORMATS, write_rig
from stratalux.rigs.harmonics import COSINE, harmonics
from stratalux.rigs.lights import Lights
from stratalux.rigs.quality import irradiance, spread
from stratalux.scenes.formats import gltf

Floats = NDArray[np.float64]
Found = list[tuple[Floats, Floats, float]]
"""Direction to the light in the tool's axes, irradiance of what faces it, and angle in radians."""

# In the middle and right of it, tilted, in a corner of the map at the seam, straight above and below, straight behind.
PLACES = np.array([[0.5, 0.5], [0.75, 0.5], [0.3, 0.2], [0.001, 0.02], [0.5, 0.0], [0.5, 1.0], [0.0, 0.5]])
COLOURS = np.array(
    [[1.0, 2, 3], [3, 1e-3, 0], [0.5, 0.25, 1], [8, 7, 6], [0, 0, 0.125], [1e3, 2e3, 1.5e3], [1e-4, 1e-4, 1e-4]]
)
ANGLES = np.radians([0.0, 0.5, 2.0, 0.0, 0.0, 10.0, 0.0])
LIGHTS = Lights(direction(*PLACES.T), COLOURS, ANGLES, "by hand")
AMBIENT = np.concatenate([[[3.0, 2.0, 1.0]], np.random.default_rng(5).normal(0, 0.2, (8, 3))])


def linear(encoded: NDArray[Any]) -> Floats:
    e = np.asarray(encoded, dtype=np.float64)
    return np.where(e <= 0.04045, e / 12.92, ((e + 0.055) / 1.055) ** 2.4)


# ------------------------------- What each tool makes of its file -------------------------------


def read_json(path: Path) -> Found:
    said = json.loads(path.read_text())
    assert said["frame"]["up"] == "+y" and said["frame"]["middle_of_the_map"] == "+z"
    return [
        (np.array(x["direction"]), np.array(x["colour"]), math.radians(x.get("angle", 0))) for x in said["lights"]
    ]  # fmt: skip


def read_csv(path: Path) -> Found:
    rows = list(csv.DictReader(path.open(encoding="utf-8", newline="")))
    assert {row["kind"] for row in rows} <= {"distant", "ambient"}
    return [
        (
            np.array([float(row[c]) for c in "xyz"]),
            np.array([float(row[c]) for c in ("red", "green", "blue")]),
            math.radians(float(row["angle_degrees"])),
        )
        for row in rows
        if row["kind"] == "distant"
    ]


def read_mitsuba(path: Path) -> Found:
    """As its emitters are sampled."""
    scene = mi.load_file(str(path))
    found: Found = []
    for emitter in scene.emitters():
        if "Directional" in str(emitter):
            at = mi.Interaction3f()
            at.p, at.wavelengths = mi.Point3f(0), []
            sample, weight = emitter.sample_direction(at, mi.Point2f(0.5))
            found.append((np.array(sample.d).ravel(), np.array(weight).ravel(), 0.0))
    return found


def read_pbrt(path: Path) -> Found:
    text = path.read_text()
    pattern = r'"distant" "rgb L" \[ (.*) \]\s+"point3 from" \[ (.*) \] "point3 to" \[ 0 0 0 \]'
    return [(np.fromstring(d, sep=" "), np.fromstring(c, sep=" "), 0.0) for c, d in re.findall(pattern, text)]


def read_gltf(path: Path) -> Found:
    return [(light.matrix[:3, 2], np.array(light.colour), 0.0) for light in gltf.read(path).lights]


def read_usd(path: Path) -> Found:
    from stratalux.scenes.formats.usd.stage import read_stage

    lights = [light for light in read_stage(path).lights if light.kind == "distant"]
    return [(light.matrix[:3, 2], np.array(light.colour), light.angle) for light in lights]


def read_three(path: Path) -> Found:
    """``ObjectLoader``, ``Color.setStyle`` and ``WebGLLights``: from the target to the light."""
    root = json.loads(path.read_text())["object"]
    targets = {child["uuid"]: child for child in root["children"] if child["type"] == "Object3D"}
    found: Found = []
    for child in root["children"]:
        if child["type"] == "DirectionalLight":
            assert "matrix" not in targets[child["target"]]
            colour = linear(np.array(list(child["color"].to_bytes(3, "big"))) / 255)
            found.append((np.array(child["matrix"][12:15]), child["intensity"] * colour, 0.0))
    return found


def read_blender(path: Path) -> Found:
    """By a stand-in for Blender that remembers what is asked of it."""
    asked: list[Any] = []

    class Anything:
        def __init__(self, *arguments: Any) -> None:
            self.arguments = arguments

        def __getattr__(self, name: str) -> Any:
            made = Anything(name)
            object.__setattr__(self, name, made)
            return made

        def __call__(self, *arguments: Any, **named: Any) -> Any:
            made = Anything(*arguments)
            asked.append(made)
            return made

        def __getitem__(self, key: Any) -> Any:
            return self.__getattr__(f"item {key}")

    class Vector(tuple[float, ...]):
        def to_track_quat(self, axis: str, up: str) -> Any:
            assert (axis, up) == ("Z", "Y")
            return self

        def __mul__(self, factor: Any) -> Any:
            return self

    bpy, mathutils = Anything(), types.ModuleType("mathutils")
    mathutils.Vector = Vector  # type: ignore[attr-defined]
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "bpy", bpy)  # type: ignore[arg-type]
        patch.setitem(sys.modules, "mathutils", mathutils)
        exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), {})
    found: Found = []
    for thing in asked:
        if "rotation_quaternion" in vars(thing):
            light = thing.arguments[1]
            assert light.arguments[1] == "SUN"
            found.append((np.array(thing.rotation_quaternion), light.energy * np.array(light.color), light.angle))
    return found


def read_unreal(path: Path) -> Found:
    """By a stand-in for the editor."""
    found: Found = []

    class Light:
        def set_mobility(self, mobility: str) -> None: ...
        def set_intensity(self, lux: float) -> None:
            self.lux = lux

        def set_light_color(self, colour: tuple[float, ...], srgb: bool) -> None:
            assert srgb
            encoded = np.where(np.array(colour) <= 0.0031308, 12.92 * np.array(colour), 0)
            encoded = np.where(encoded > 0, encoded, 1.055 * np.maximum(colour, 1e-9) ** (1 / 2.4) - 0.055)
            self.colour = linear(np.floor(255.999 * np.clip(encoded, 0, 1)) / 255)[:3]  # FLinearColor::ToFColor

        def set_editor_property(self, name: str, value: Any) -> None:
            if name == "light_source_angle":
                p, y = np.radians(self.rotation)
                along = np.array([np.cos(p) * np.cos(y), np.cos(p) * np.sin(y), np.sin(p)])
                found.append((-along, self.lux * self.colour, math.radians(value)))

    class Actor(Light):
        def set_actor_label(self, name: str) -> None: ...
        def set_folder_path(self, name: str) -> None: ...
        def get_component_by_class(self, kind: Any) -> Light:
            return self

    class Actors:
        def spawn_actor_from_class(self, kind: str, at: Any, rotation: tuple[float, float]) -> Actor:
            actor = Actor()
            actor.rotation = rotation  # type: ignore[attr-defined]
            return actor

    unreal = types.SimpleNamespace(
        get_editor_subsystem=lambda kind: Actors(),
        EditorActorSubsystem="",
        DirectionalLight="",
        DirectionalLightComponent="",
        ComponentMobility=types.SimpleNamespace(MOVABLE=""),
        Rotator=lambda roll, pitch, yaw: (pitch, yaw),
        Vector=lambda *xyz: xyz,
        LinearColor=lambda *rgba: rgba,
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "unreal", unreal)  # type: ignore[arg-type]
        exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), {})
    return found


def read_godot(path: Path) -> Found:
    found: Found = []
    for node in path.read_text().split("[node ")[1:]:
        if 'type="DirectionalLight3D"' in node:
            said = dict(line.split(" = ", 1) for line in node.splitlines() if " = " in line)
            rows = np.array(re.findall(r"[-\d.e]+", said["transform"].split("(")[1]), dtype=float)[:9].reshape(3, 3)
            colour = linear(np.array(re.findall(r"[\d.e-]+", said["light_color"].split("(")[1]), dtype=float)[:3])
            energy = np.pi * float(said["light_energy"])
            found.append((rows[:, 2], energy * colour, math.radians(float(said["light_angular_distance"]))))
    return found


def read_radiance(path: Path) -> Found:
    text = path.read_text()
    radiances = {name: np.fromstring(c, sep=" ") for name, c in re.findall(r"light (\w+)\n0\n0\n3 (.*)", text)}
    found: Found = []
    for material, numbers in re.findall(r"(\w+) source \w+\n0\n0\n4 (.*)", text):
        x, y, z, degrees = np.fromstring(numbers, sep=" ")
        if material in radiances:
            share = np.pi * np.sin(math.radians(degrees) / 2) ** 2
            found.append((np.array([x, y, z]), share * radiances[material], math.radians(degrees)))
    return found


# ------------------------------- Where each tool looks a direction up in a map -------------------------------


def openexr(d: Floats) -> tuple[Floats, Floats]:
    return 0.5 - np.arctan2(d[:, 0], d[:, 2]) / (2 * np.pi), np.arccos(d[:, 1]) / np.pi


def three(d: Floats) -> tuple[Floats, Floats]:
    return np.arctan2(d[:, 2], d[:, 0]) / (2 * np.pi) + 0.5, 0.5 - np.arcsin(d[:, 1]) / np.pi


def cycles(d: Floats) -> tuple[Floats, Floats]:
    return np.arctan2(d[:, 1], d[:, 0]) / (-2 * np.pi) + 0.5, np.arccos(d[:, 2]) / np.pi


def godot(d: Floats) -> tuple[Floats, Floats]:
    return np.arctan2(d[:, 0], -d[:, 2]) / (2 * np.pi) % 1, np.arccos(d[:, 1]) / np.pi


def unreal(d: Floats) -> tuple[Floats, Floats]:
    cube = d[:, [0, 2, 1]]  # TransformSideToWorldSpace, then LookupLongLat
    return (1 + np.arctan2(cube[:, 0], -cube[:, 2]) / np.pi) / 2, np.arccos(cube[:, 1]) / np.pi


def z_up(d: Floats) -> tuple[Floats, Floats]:
    return openexr(np.stack([d[:, 0], d[:, 2], -d[:, 1]], axis=1))


Reader = Callable[[Path], Found]
TOOLS: dict[str, tuple[Reader, Callable[[Floats], tuple[Floats, Floats]], bool]] = {
    "json": (read_json, openexr, True),
    "csv": (read_csv, openexr, True),
    "mitsuba": (read_mitsuba, openexr, False),
    "pbrt": (read_pbrt, openexr, False),
    "gltf": (read_gltf, openexr, False),
    "usd": (read_usd, openexr, True),
    "three": (read_three, three, False),
    "blender": (read_blender, cycles, True),
    "unreal": (read_unreal, unreal, True),
    "godot": (read_godot, godot, True),
    "radiance": (read_radiance, z_up, True),
}
"""Reader, lookup, and whether lights have an angle."""
FILES = [(name, suffix) for name in TOOLS for suffix in FORMATS[name].suffixes]


def written(folder: Path, name: str, suffix: str, lights: Lights = LIGHTS, **more: Any) -> Path:
    if name == "usd":
        pytest.importorskip("pxr")
    path = folder / f"rig{suffix}"
    write_rig(lights, path, name, **more)
    return path


def test_all_formats_are_tested() -> None:
    assert set(TOOLS) == set(FORMATS) - {"blend"}


@pytest.mark.parametrize(("name", "suffix"), FILES)
def test_lights_shine_from_where_the_tool_shows_the_map(tmp_path: Path, name: str, suffix: str) -> None:
    read, look_up, has_angle = TOOLS[name]
    few = replace(LIGHTS) if name != "godot" else _first(7)
    found = read(written(tmp_path, name, suffix, few))
    directions, colours = np.array([x[0] for x in found]), np.array([x[1] for x in found])
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)
    u, v = look_up(np.clip(directions, -1, 1))
    wanted_u, wanted_v = map_coordinates(few.direction)
    np.testing.assert_allclose(v, wanted_v, atol=1e-3)
    off_poles = np.abs(np.cos(np.pi * wanted_v)) < 0.999
    np.testing.assert_allclose((u - wanted_u + 0.5)[off_poles] % 1, 0.5, atol=1e-5)
    if name in ("three", "unreal"):  # 8 bits
        off = np.abs(colours - COLOURS) / COLOURS.max(axis=1, keepdims=True)
        assert off.max() < 0.002
    else:
        np.testing.assert_allclose(colours, COLOURS, rtol=2e-6, atol=1e-9)
    if has_angle:
        angles = np.array([x[2] for x in found])
        wide = ANGLES > 0
        np.testing.assert_allclose(angles[wide], ANGLES[wide], rtol=1e-6)


def _first(count: int) -> Lights:
    return replace(LIGHTS, direction=LIGHTS.direction[:count], colour=COLOURS[:count], angle=ANGLES[:count])


@pytest.mark.parametrize("name", ["gltf", "usd", "mitsuba"])
def test_a_matte_ball_looks_as_under_the_rig(tmp_path: Path, name: str) -> None:
    """In our own frame: these tools have the map where we have it."""
    found = TOOLS[name][0](written(tmp_path, name, FORMATS[name].suffixes[0]))
    normals = spread(200)
    under = irradiance(np.array([x[0] for x in found]), np.array([x[1] for x in found]), normals)
    np.testing.assert_allclose(under, irradiance(LIGHTS.direction, COLOURS, normals), rtol=1e-5, atol=2e-3)


@pytest.mark.parametrize("k", [0, 2, 5])
def test_mitsuba_renders_what_was_written(tmp_path: Path, k: int) -> None:
    """A matte ball in a scene that includes the rig: every pixel has one sample, whose normal is known."""
    one = replace(LIGHTS, direction=LIGHTS.direction[[k]], colour=COLOURS[[k]], angle=ANGLES[[k]])
    written(tmp_path, "mitsuba", ".xml", one)
    (tmp_path / "scene.xml").write_text(
        """<scene version="3.0.0">
        <integrator type="aov"><string name="aovs" value="n:sh_normal"/><integrator type="direct"/></integrator>
        <sensor type="orthographic">
          <transform name="to_world"><lookat origin="3, 1, 2" target="0, 0, 0" up="0, 1, 0"/></transform>
          <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/>
            <rfilter type="box"/><string name="component_format" value="float32"/></film>
          <sampler type="independent"><integer name="sample_count" value="1"/></sampler>
        </sensor>
        <shape type="sphere"><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>
        <include filename="rig.xml"/></scene>"""
    )
    image = np.array(mi.render(mi.load_file(str(tmp_path / "scene.xml")), seed=4), dtype=np.float64)
    radiance, normals = image[..., :3], image[..., -3:]
    ball = np.linalg.norm(normals, axis=-1) > 0.5
    assert np.count_nonzero(ball) > 50
    wanted = 0.5 / np.pi * irradiance(one.direction, one.colour, normals[ball])
    if k == 0:
        assert 0.1 < np.mean(wanted[:, 0] > 0) < 0.95  # some of it is in its own shadow
    np.testing.assert_allclose(radiance[ball], wanted, rtol=1e-4, atol=1e-4 * wanted.max())


@pytest.mark.parametrize(("name", "suffix"), FILES)
def test_env_frame_turns_the_lights_as_the_map(tmp_path: Path, name: str, suffix: str) -> None:
    if name == "json":
        pytest.skip("is in the frame of the map always")
    read, look_up, _ = TOOLS[name]
    u = [
        look_up(np.array([read(written(tmp_path, name, suffix, _first(1), env_frame=frame))[0][0]]))[0][0]
        for frame in ("mitsuba", "three")
    ]
    assert (u[1] - u[0]) % 1 == pytest.approx(0.75, abs=1e-6)  # what was at +z is at +x: a quarter to the left


def test_our_json_stays_in_the_frame_of_the_map(tmp_path: Path) -> None:
    with pytest.warns(RigWarning, match="in the map's frame always"):
        path = written(tmp_path, "json", ".json", env_frame="blender")
    np.testing.assert_allclose(read_json(path)[0][0], [0, 0, 1], atol=1e-9)


# ------------------------------- Ambient light -------------------------------


def constant(radiance: Floats) -> Floats:
    return np.concatenate([radiance[None] * np.sqrt(4 * np.pi), np.zeros((8, 3))])


WHITE = np.array([0.5, 0.25, 0.125])


def test_constant_ambient_light_is_radiance(tmp_path: Path) -> None:
    lights = replace(_first(2), ambient=constant(WHITE))
    scene = mi.load_file(str(written(tmp_path, "mitsuba", ".xml", lights)))
    ray = mi.SurfaceInteraction3f()
    np.testing.assert_allclose(np.array(scene.environment().eval(ray)).ravel(), WHITE, rtol=1e-6)
    three_lights = json.loads(written(tmp_path, "three", ".json", lights).read_text())["object"]["children"]
    ambient = next(child for child in three_lights if child["type"] == "AmbientLight")
    tint = linear(np.array(list(ambient["color"].to_bytes(3, "big"))) / 255)
    np.testing.assert_allclose(ambient["intensity"] * tint, np.pi * WHITE, rtol=5e-3)  # an irradiance
    assert "0.5 0.25 0.125" in written(tmp_path, "pbrt", ".pbrt", lights).read_text()
    radiance = written(tmp_path, "radiance", ".rad", lights).read_text()
    assert "void glow ambient_radiance\n0\n0\n4 0.5 0.25 0.125 0\n" in radiance and "4 0 0 1 360" in radiance
    scene_text = written(tmp_path, "godot", ".tscn", lights).read_text()
    said = re.search(r"ambient_light_color = Color\((.*)\)\nambient_light_energy = (.*)", scene_text)
    assert said is not None
    tint = linear(np.array(said[1].split(","), dtype=float)[:3])
    np.testing.assert_allclose(float(said[2]) * tint, WHITE, rtol=1e-6)


def test_ambient_light_that_varies_is_a_map_or_harmonics(tmp_path: Path) -> None:
    """Its irradiance is that of the coefficients."""
    from stratalux import EnvironmentMap
    from stratalux.maps.irradiance import irradiance as exact

    lights = replace(_first(1), ambient=AMBIENT)
    normals = spread(5)
    wanted = harmonics(normals) @ (COSINE[:, None] * AMBIENT)
    written(tmp_path, "mitsuba", ".xml", lights)
    texels = EnvironmentMap.load(tmp_path / "rig-ambient.exr").texels
    got = np.array([exact(texels, normal) for normal in normals])
    np.testing.assert_allclose(got, wanted, rtol=5e-3)
    emitter = mi.load_file(str(tmp_path / "rig.xml")).environment()
    assert "EnvironmentMapEmitter" in str(emitter)
    children = json.loads(written(tmp_path, "three", ".json", lights).read_text())["object"]["children"]
    sh = np.array(next(child for child in children if child["type"] == "LightProbe")["sh"]).reshape(9, 3)
    quarter = np.stack([normals[:, 2], normals[:, 1], -normals[:, 0]], axis=1)  # z to x: as the map in three.js
    np.testing.assert_allclose(harmonics(quarter) @ (COSINE[:, None] * sh), wanted, rtol=1e-9)


def test_blenders_world_has_the_ambient_light_where_it_has_the_map(tmp_path: Path) -> None:
    path = written(tmp_path, "blender", ".py", replace(_first(1), ambient=AMBIENT))
    said: dict[str, Any] = {}
    body = path.read_text(encoding="utf-8").split("LIGHTS = ")[1].split("\nrig = ")[0]
    exec("LIGHTS = " + body, said)
    height, width, rows = said["AMBIENT_MAP"]
    texels = np.array(rows)
    assert texels.shape == (height, width, 3)
    u, v = (np.arange(width) + 0.5) / width, np.arange(height) / (height - 1)
    wanted = harmonics(direction(*np.broadcast_arrays(u[None], v[:, None]))) @ AMBIENT
    positive = (wanted > 0.05).all(axis=-1)
    np.testing.assert_allclose(texels[positive], wanted[positive], rtol=0.02)  # the middle of it is that of the map
    np.testing.assert_allclose(said["AMBIENT"], AMBIENT[0] / np.sqrt(4 * np.pi), rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "suffix", "words"),
    [("gltf", ".glb", "no ambient light"), ("unreal", ".py", "no ambient light"), ("pbrt", ".pbrt", "its mean")],
)
def test_what_a_format_cannot_say_is_told(tmp_path: Path, name: str, suffix: str, words: str) -> None:
    with pytest.warns(RigWarning, match=words):
        written(tmp_path, name, suffix, replace(_first(1), ambient=AMBIENT))


def test_godot_shows_eight(tmp_path: Path) -> None:
    many = Lights(np.tile([[0.0, 1, 0]], (9, 1)), np.ones((9, 3)), np.zeros(9), "by hand")
    with pytest.warns(RigWarning, match="shows 8 directional lights, and the rig has 9"):
        written(tmp_path, "godot", ".tscn", many)


# ------------------------------- USD and glTF as a whole -------------------------------


@pytest.mark.parametrize("suffix", FORMATS["usd"].suffixes)
def test_usd_is_valid_and_has_the_map_beside_the_lights(tmp_path: Path, suffix: str) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdLux, UsdValidation

    from stratalux.images.writing import write_image

    (tmp_path / "maps").mkdir()
    write_image(tmp_path / "maps" / "sky.exr", np.ones((4, 8, 3), np.float32))
    lights = replace(LIGHTS, map=str(tmp_path / "maps" / "sky.exr"))
    path = written(tmp_path, "usd", suffix, lights)
    stage = Usd.Stage.Open(str(path))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 10
    assert [error.GetMessage() for error in UsdValidation.ValidationContext(validators).Validate(stage)] == []
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    dome = stage.GetPrimAtPath("/rig/map")
    assert not dome.IsActive()
    dome.SetActive(True)
    turned = Usd.Stage.Open(str(written(tmp_path / "maps", "usd", suffix, lights, env_frame="three")))
    middle = UsdGeom.Xformable(turned.GetPrimAtPath("/rig/map")).GetLocalTransformation().TransformDir((0, 0, 1))
    np.testing.assert_allclose(middle, [1, 0, 0], atol=1e-9)
    asset = UsdLux.DomeLight(dome).GetTextureFileAttr().Get()
    assert asset.resolvedPath and str(asset.path).endswith(".exr")
    # A stage that is broken is one for the validators.
    stage.ClearMetadata("upAxis")
    assert UsdValidation.ValidationContext(validators).Validate(stage)


def test_a_map_that_a_package_cannot_have_is_told(tmp_path: Path) -> None:
    with pytest.warns(RigWarning, match=r"no room for sky\.hdr"):
        written(tmp_path, "usd", ".usdz", replace(LIGHTS, map="sky.hdr"))


def test_a_rig_that_is_black_is_a_file_too(tmp_path: Path) -> None:
    black = Lights(np.array([[0.0, 1.0, 0.0]]), np.zeros((1, 3)), np.zeros(1), "by hand", ambient=np.zeros((9, 3)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RigWarning)
        for name, suffix in FILES:
            path = written(tmp_path, name, suffix, black)
            assert name == "json" or TOOLS[name][0](path) == []


def test_formats_that_are_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, path, words in [
        (None, "rig.txt", "no rig is written as '.txt'; use one of .json"),
        ("nuke", "rig.py", "is no format of rigs; use one of json, csv"),
        ("three", "rig.py", "a rig for three ends with .json"),
    ]:
        with pytest.raises(InputError, match=re.escape(words)):
            write_rig(LIGHTS, tmp_path / path, name)
    with pytest.raises(InputError, match="'maya' is unknown"):
        write_rig(LIGHTS, tmp_path / "rig.py", env_frame="maya")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'stratalux\[usd\]'"):
        write_rig(LIGHTS, tmp_path / "rig.usda")
    with pytest.raises(InputError, match="pip install bpy"):
        write_rig(LIGHTS, tmp_path / "rig.blend")
    assert list(tmp_path.iterdir()) == []
