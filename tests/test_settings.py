"""Settings: checked, documented, and the same as JSON, as a command line and as a Python call."""

from __future__ import annotations

import inspect
import json
import shlex
from dataclasses import FrozenInstanceError, dataclass, fields
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

import stratalux
from stratalux import InputError, PictureSettings
from stratalux.bench import BenchSettings
from stratalux.cli.flags import flags
from stratalux.comparison.settings import ComparisonSettings
from stratalux.images.settings import VIEW_NAMES, OutputSettings
from stratalux.rendering.settings import GROUPS, MachineSettings, SamplingSettings
from stratalux.reproduce.request import ReproductionSettings
from stratalux.scenes.materials import MATERIALS
from stratalux.scenes.settings import ENV_FRAMES, UP_AXES, CameraSettings, SceneSettings
from stratalux.settings import Settings, command_line, option

ALL = (*GROUPS.values(), ComparisonSettings, BenchSettings, ReproductionSettings)
words = st.text(st.characters(exclude_characters="\0", exclude_categories=("Cs",)), min_size=1, max_size=9)
names = words.filter(lambda text: "=" not in text and not text.startswith("-"))
numbers = st.floats(-1e6, 1e6)
lengths = st.floats(1e-6, 1e6)

scenes = st.builds(
    SceneSettings,
    source=words.filter(lambda text: not text.startswith("-")),
    environment=st.none() | words,
    rotate=st.tuples(numbers, numbers, numbers),
    scale=st.floats(0, 1e6),
    material=st.sampled_from(list(MATERIALS)),
    env_frame=st.sampled_from(list(ENV_FRAMES)),
    background=st.sampled_from(["map", "none", "white", "#fc0", "0.5,1.0,2.0", "blur:12.5", __file__]),
    ground=st.none() | st.sampled_from(["none", "catcher", "mirror", "matte", "matte:0.1,0.2,0.3"]),
    up=st.none() | st.sampled_from(UP_AXES),
    parameters=st.lists(st.tuples(names, words), max_size=3).map(tuple),
)
cameras = st.builds(
    CameraSettings,
    size=st.none() | st.tuples(st.integers(1, 16384), st.integers(1, 16384)),
    camera=st.sampled_from(["auto", "none"]),
    orbit=st.none() | st.tuples(numbers, st.floats(-90, 90)) | st.tuples(numbers, st.floats(-90, 90), lengths),
    look_at=st.none() | st.tuples(numbers, numbers, numbers),
    fov=st.none() | st.floats(1, 170),
    aperture=st.none() | st.floats(0, 1e6),
    focus=st.none() | lengths,
) | st.builds(
    CameraSettings, camera=st.integers(0, 9) | words, aperture=st.none() | st.floats(0, 1e6), focus=st.none() | lengths
)
samplings = st.builds(
    SamplingSettings,
    technique=st.just("path") | words.filter(lambda text: not text.startswith("-")),
    strata=st.none() | st.integers(1, 1 << 20),
    proposals=st.none() | st.integers(1, 1 << 16),
    spp=st.integers(0, 1 << 30),
    seed=st.integers(0, (1 << 32) - 1),
    hide_emitters=st.booleans(),
)
outputs = st.builds(
    OutputSettings,
    exposure=st.none() | st.floats(-100, 100),
    view=st.sampled_from(VIEW_NAMES),
    bits=st.sampled_from([8, 16]),
    float32=st.booleans(),
)
machines = st.builds(MachineSettings, variant=st.none() | st.just("llvm_ad_mono"))
pictures = st.builds(
    PictureSettings, scene=scenes, camera=cameras, sampling=samplings, output=outputs, machine=machines
)


@click.command()
@flags(**GROUPS)
@click.option("-o", multiple=True)
def understand(o: tuple[str, ...], **groups: Any) -> None:
    """What the command line makes of its words."""
    click.echo(json.dumps([PictureSettings(**groups).to_json(), list(o)]))


def understood(command: str) -> tuple[PictureSettings, list[str]]:
    program, name, *rest = shlex.split(command)
    assert (program, name) == ("stratalux", "render")
    answer = CliRunner().invoke(understand, rest, catch_exceptions=False)
    assert answer.exit_code == 0, answer.output
    content, files = json.loads(answer.output)
    return PictureSettings.from_json(content), files


@given(pictures)
def test_json_and_back(picture: PictureSettings) -> None:
    assert PictureSettings.from_text(json.dumps(json.loads(picture.to_text()))) == picture


@given(pictures)
def test_a_command_line_and_back(picture: PictureSettings) -> None:
    assert understood(picture.command("-strange name.exr", "b.png")) == (picture, ["-strange name.exr", "b.png"])


@given(pictures)
def test_a_python_call_and_back(picture: PictureSettings) -> None:
    class Stratalux:
        render = staticmethod(PictureSettings.of)

    assert eval(picture.call(), {"stratalux": Stratalux}) == picture


@given(st.lists(st.sampled_from(["path", "direct:bsdf_samples=4"]), min_size=1, unique=True), st.integers(1, 99))
def test_other_commands_take_their_settings_too(techniques: list[str], repeats: int) -> None:
    asked = ComparisonSettings(techniques=tuple(techniques), rays=(64, 16), repeats=repeats)
    assert asked.rays == (16, 64) and ComparisonSettings.from_json(json.loads(json.dumps(asked.to_json()))) == asked

    @click.command()
    @flags(one=ComparisonSettings)
    def comparing(one: ComparisonSettings) -> None:
        click.echo(json.dumps(one.to_json()))

    answer = CliRunner().invoke(comparing, list(asked.words()), catch_exceptions=False)
    assert ComparisonSettings.from_json(json.loads(answer.output)) == asked


@pytest.mark.parametrize("kind", ALL)
def test_every_setting_is_documented_and_frozen(kind: type[Settings]) -> None:
    for field in fields(kind):
        about = field.metadata["option"]
        assert about.help.endswith(".") and (about.flags or about.argument)
    needed = {SceneSettings: {"source": "x"}, ComparisonSettings: {"techniques": ("path",)}}
    one = kind(**needed.get(kind, {}))
    with pytest.raises(FrozenInstanceError):
        setattr(one, fields(kind)[0].name, "y")


def test_no_two_groups_share_a_name_or_a_flag() -> None:
    everything = [field for group in GROUPS.values() for field in fields(group)]
    flags_of_all = [flag for field in everything for flag in field.metadata["option"].flags]
    assert len({field.name for field in everything}) == len(everything)
    assert len(set(flags_of_all)) == len(flags_of_all)


@pytest.mark.parametrize("function", [stratalux.render, stratalux.render_passes])
def test_python_shows_all_settings(function: Any) -> None:
    shown = inspect.signature(function).parameters
    for field in (field for group in GROUPS.values() for field in fields(group)):
        if field.name != "source":
            assert shown[field.name].default == field.default
            assert f"``{field.name}``: {field.metadata['option'].help}" in function.__doc__
    assert "settings" not in shown


def test_numbers_of_numpy_and_paths_are_taken(tmp_path: Any) -> None:
    taken = PictureSettings.of(
        tmp_path / "a.xml", spp=np.int64(8), scale=np.float32(2), size=np.array([4, 3]), environment=tmp_path / "b.hdr"
    )
    assert taken.scene == SceneSettings(str(tmp_path / "a.xml"), environment=str(tmp_path / "b.hdr"), scale=2.0)
    assert type(taken.sampling.spp) is int and taken.camera.size == (4, 3)
    assert SceneSettings("a", parameters={"radius": 2}).definitions == {"radius": "2"}


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"spp": -1}, "spp: -1 is too small; give at least 1"),
        ({"spp": 1 << 40}, "spp: 1099511627776 is too large"),
        ({"spp": 2.5}, "spp: 2.5 is not of type int"),
        ({"spp": True}, "spp: True is not of type int"),
        ({"seed": 1 << 32}, "seed: 4294967296 is too large; give at most"),
        ({"seed": -1}, "seed: -1 is too small"),
        ({"strata": 0}, "strata: 0 is too small; give at least 1"),
        ({"exposure": 1e300}, "exposure: 1e.300 is too large"),
        ({"exposure": -101}, "exposure: -101 is too small; give at least -100"),
        ({"exposure": "auto"}, "exposure: 'auto' is no number of stops"),
        ({"view": "sepia"}, "view: 'sepia' is unknown; use one of reinhard, standard"),
        ({"bits": 12}, "bits: 12 is none of 8, 16"),
        ({"bits": True}, "bits: True is none of"),
        ({"exposure": float("nan")}, "exposure: nan is not a finite number"),
        ({"scale": float("inf")}, "scale: inf is not a finite number"),
        ({"scale": -1}, "scale: -1.0 is too small"),
        ({"scale": "bright"}, "scale: 'bright' is not of type float"),
        ({"rotate": (0, 0)}, "rotate: .0, 0. is not a rotation"),
        ({"rotate": (0, float("nan"), 0)}, "is not finite"),
        ({"size": (0, 4)}, "size 0x4: width and height must be at least 1 pixel"),
        ({"size": (65536, 65536)}, "size 65536x65536: too large"),
        ({"size": "big"}, "size: 'big' is not one"),
        ({"material": "cheese"}, "material: 'cheese' is unknown; use one of clay"),
        ({"background": "blur:0"}, "background 'blur:0': write blur:DEGREES, 1 to 180"),
        ({"background": "nowhere.jpg"}, "background 'nowhere.jpg': no such file; give that of a picture, map, none"),
        ({"background": 3}, "background 3: no such file"),
        ({"ground": "grass"}, "ground 'grass': give none, catcher, mirror, matte or matte:COLOUR"),
        ({"ground": "matte:2,0,0"}, "ground 'matte:2,0,0': give none"),
        ({"up": "up"}, "up: 'up' is unknown"),
        ({"environment": 3}, "environment: 3 is no map"),
        ({"env_frame": "maya"}, "env_frame: 'maya' is unknown; use one of mitsuba, blender, three"),
        ({"camera": -1}, "camera: -1 is none; give its name, its index, auto or none"),
        ({"camera": True}, "camera: True is none"),
        ({"camera": ""}, "camera: '' is none"),
        ({"camera": "\ud800"}, "camera: .* is not UTF-8"),
        ({"orbit": (1,)}, "is not an orbit; write AZIMUTH,ELEVATION"),
        ({"orbit": 3}, "3 is not an orbit"),
        ({"orbit": (0, 91)}, "orbit: an elevation of 91 degrees is beyond the zenith; give -90 to 90"),
        ({"orbit": (0, -91)}, "orbit: an elevation of -91 degrees"),
        ({"orbit": (0, 0, 0)}, "orbit: a distance of 0 is too small"),
        ({"orbit": (0, float("nan"))}, "is not an orbit"),
        ({"look_at": (1e30, 0, 0)}, "is not a point; write X,Y,Z"),
        ({"look_at": (0, 0)}, "is not a point"),
        ({"fov": 180}, "fov: 180.0 is too large; give at most 179"),
        ({"aperture": -1}, "aperture: -1.0 is too small"),
        ({"focus": 0}, "focus: 0.0 is too small"),
        ({"camera": 1, "orbit": (0, 0)}, "camera '1' and orbit contradict each other"),
        ({"camera": "left", "look_at": (0, 0, 0)}, "camera 'left' and look-at contradict each other"),
        ({"camera": "left", "fov": 40}, "camera 'left' and fov contradict each other"),
        ({"parameters": 3}, "parameters: 3 is not a list"),
        ({"hide_emitters": 1}, "hide_emitters: 1 is not of type bool"),
        ({"technique": 3}, "technique: 3 is not of type str"),
        ({"nonsense": 1}, "setting 'nonsense' is unknown"),
    ],
)
def test_bad_values_are_named(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        PictureSettings.of("demo", **settings)


def test_what_is_no_settings_is_told() -> None:
    for text, message in (
        ("{", "x.exr: is no JSON"),
        ("[]", r"x.exr: settings: \[\] are none"),
        ('{"nonsense": 1}', "x.exr: settings: 'nonsense' is unknown; this version has camera, machine"),
        ('{"camera": {"size": [0, 1]}}', "x.exr: size 0x1"),
        ('{"scene": {"scale": 2}}', "x.exr: settings: .*source"),
    ):
        with pytest.raises(InputError, match=message):
            PictureSettings.from_text(text, "x.exr")


def test_what_no_command_can_say_is_told() -> None:
    environment = stratalux.EnvironmentMap.from_array(np.ones((4, 8, 3)))
    picture = PictureSettings.of("demo", environment=environment)
    with pytest.raises(InputError, match="array of a program"):
        picture.command("a.exr")
    assert picture.to_json()["scene"]["environment"] == {"of a program": [4, 8, 3]}
    with pytest.raises(InputError, match="loaded by a program"):
        PictureSettings().call()


def test_a_kind_of_its_own() -> None:
    @dataclass(frozen=True)
    class Some(Settings):
        many: tuple[str, ...] = option((), "Words.", "--word", several=True)
        loud: bool = option(False, "Whether.", "--loud")

    some = Some(many=("a b", "-c"), loud=True)
    assert command_line("x", some) == "x --word 'a b' --word=-c --loud"
    assert some.changed() == {"many": ("a b", "-c"), "loud": True} and Some().changed() == {}
