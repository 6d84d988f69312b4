"""The command line: what it writes, and one clear line and exit code 2 for every bad input."""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from stratalux.cli import COMMANDS
from stratalux.comparison import rig_scenes
from stratalux.images.reading import read_image
from stratalux.integrators.techniques import techniques
from stratalux.rendering import variants
from stratalux.rigs import RIGS
from tests.cli.terminal import Terminal
from tests.helpers import asset, hall_map, run
from tests.reproduce.data import make_assets

CUBE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
XML = """<scene version="3.0.0">
    <default name="radius" value="1"/>
    <sensor type="perspective">
        <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="8"/></film>
    </sensor>
    <shape type="sphere">
        <float name="radius" value="$radius"/><transform name="to_world"><translate z="4"/></transform>
    </shape>
    {emitter}
</scene>"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Run in a folder with a map, a mesh and some scenes."""
    monkeypatch.chdir(tmp_path)
    mi.Bitmap(hall_map(24, 48)).write("map.exr")
    Path("mesh.obj").write_text(CUBE)
    Path("scene.xml").write_text(
        XML.format(emitter='<emitter type="envmap"><string name="filename" value="map.exr"/></emitter>')
    )
    Path("dark.xml").write_text(XML.format(emitter=""))
    Path("constant.xml").write_text(XML.format(emitter='<emitter type="constant"/>'))
    return tmp_path


def luminance(path: str) -> float:
    return float(np.array(mi.Bitmap(path))[..., :3].mean())


SMALL = ("--size", "24x16", "--spp", "2", "--strata", "4")


@pytest.mark.parametrize(
    "scene",
    [
        ("mesh.obj", "--env", "map.exr"),
        ("mesh.obj", "--env", "map.exr", "--material", "ceramic"),
        ("scene.xml",),
        ("demo",),
    ],
)
def test_renders_everything_it_promises(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], scene: tuple[str, ...]
) -> None:
    assert run(monkeypatch, "render", *scene, *SMALL, "-o", "a.exr", "-o", "a.png") == 0
    image = mi.Bitmap("a.exr")
    assert image.height() == 16 and image.width() == 24 and luminance("a.exr") > 0
    assert image.metadata()["strata"] == 4 and image.metadata()["spp"] == 2
    assert mi.Bitmap("a.png").component_format() == mi.Struct.Type.UInt8
    out = capsys.readouterr().out
    assert "2 spp in" in out and "rays/s" in out and "samples/s" in out and "wrote a.exr, a.png" in out


def test_a_picture_is_made_again_from_what_its_file_remembers(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the command, and by the Python call, that ``settings`` prints."""
    import stratalux

    asked = ("--env", "map.exr", "--env-rotate=-30", "--material", "copper", "--up", "-z", "--seed", "7", "-N", "6")
    asked += ("--float32", "--view", "agx", "--exposure", "-0.5", "--bits", "16")
    assert run(monkeypatch, "render", "mesh.obj", *asked, "--size", "24x16", "--spp", "3", "-o", "a.exr", "-q") == 0
    image = np.array(mi.Bitmap("a.exr"))
    assert run(monkeypatch, "settings", "a.exr") == 0
    command = shlex.split(capsys.readouterr().out)
    assert command[0] == "stratalux" and run(monkeypatch, *command[1:], "-o", "again.exr", "-q") == 0
    # Threads add up in another order each time, so that the last digits may differ.
    np.testing.assert_allclose(np.array(mi.Bitmap("again.exr")), image, rtol=1e-4, atol=1e-6)
    assert run(monkeypatch, "settings", "a.exr", "--python") == 0
    result = eval(capsys.readouterr().out, {"stratalux": stratalux})
    np.testing.assert_allclose(result.image, image, rtol=1e-4, atol=1e-6)
    assert run(monkeypatch, "settings", "again.exr", "--json") == 0
    remembered = json.loads(capsys.readouterr().out)
    assert remembered == result.picture.to_json() and remembered["scene"]["rotate"] == [0, -30, 0]


def test_one_exposure_is_told_and_goes_for_all_pictures(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ("render", "mesh.obj", "--env", "map.exr", "--exposure", "auto", "--view", "standard", *SMALL)
    assert run(monkeypatch, *arguments, "-o", "a.exr", "-o", "a.png", "-o", "a.tif") == 0
    told = re.search(
        r"wrote a.exr, a.png, a.tif; exposure ([+-]\d+\.\d\d) stops \(automatic\)", capsys.readouterr().out
    )
    assert told is not None
    pictures = [np.array(read_image(name).pixels) for name in ("a.png", "a.tif")]
    assert np.array_equal(*pictures)
    assert run(monkeypatch, "develop", "a.exr", "-o", "b.png", "--view", "standard", f"--exposure={told[1]}") == 0
    assert f"wrote b.png; exposure {told[1]} stops\n" in capsys.readouterr().out
    np.testing.assert_allclose(read_image("b.png").pixels, pictures[0], atol=0.02)
    assert run(monkeypatch, "develop", "a.exr", "map.exr", "-o", "x-{}.jpg", "--view", "aces") == 0
    assert "wrote x-a.jpg, x-map.jpg; exposure" in capsys.readouterr().out
    assert run(monkeypatch, "render", "mesh.obj", "--env", "map.exr", *SMALL, "-o", "a.exr") == 0
    assert "exposure" not in capsys.readouterr().out


def test_the_film_of_a_scene_may_ask_for_32_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    text = Path("scene.xml").read_text()
    precise = '<film type="hdrfilm"><string name="component_format" value="float32"/>'
    Path("precise.xml").write_text(text.replace('<film type="hdrfilm">', precise))
    for source, asked, kind in (
        ("scene", (), np.float16),
        ("scene", ("--float32",), np.float32),
        ("precise", (), np.float32),
    ):
        assert run(monkeypatch, "render", f"{source}.xml", *asked, *SMALL[2:], "-o", "a.exr", "-q") == 0
        assert np.array(mi.Bitmap("a.exr")).dtype == kind
    assert run(monkeypatch, "render", "precise.xml", *SMALL[2:], "-o", "a.tif", "-q") == 0
    assert read_image("a.tif").said  # of 8 bits


def test_a_sun_beyond_half_is_told(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    mi.Bitmap(np.full((8, 16, 3), 1e5, dtype=np.float32)).write("bright.exr")
    assert run(monkeypatch, "render", "scene.xml", "--env", "bright.exr", "--spp", "1", "-o", "a.exr", "-q") == 0
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and "pixel(s) above 65504 are written as that; --float32 keeps them" in error


def test_the_map_of_a_scene_is_replaced_turned_and_scaled(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("scene.xml", "constant.xml", "dark.xml"):
        assert run(monkeypatch, "render", name, "--env", "map.exr", *SMALL, "-o", f"{name}.exr", "-q") == 0
    assert luminance("scene.xml.exr") == pytest.approx(luminance("dark.xml.exr"), rel=0.05)
    assert luminance("scene.xml.exr") == pytest.approx(luminance("constant.xml.exr"), rel=0.05)
    assert run(monkeypatch, "render", "scene.xml", "--env-scale", "3", *SMALL, "-o", "bright.exr", "-q") == 0
    assert luminance("bright.exr") == pytest.approx(3 * luminance("scene.xml.exr"), rel=0.05)
    assert run(monkeypatch, "render", "scene.xml", "--env-rotate", "flip", *SMALL, "-o", "flip.exr", "-q") == 0
    assert run(monkeypatch, "render", "scene.xml", "--env-rotate", "180,0,0", *SMALL, "-o", "x.exr", "-q") == 0
    assert luminance("flip.exr") == pytest.approx(luminance("x.exr"), rel=1e-3)
    assert luminance("flip.exr") != pytest.approx(luminance("scene.xml.exr"), rel=0.05)


def test_rotations_go_about_the_world_axes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A light straight up is turned by 90 degrees about x into +z, and then about y into +x."""
    from stratalux.scenes.load import load_scene

    scene = load_scene("scene.xml", rotate=(90, 90, 0))
    turned = mi.traverse(scene.environment())["to_world"].matrix.numpy().reshape(4, 4)[:3, :3] @ [0, 1, 0]
    np.testing.assert_allclose(turned, [1, 0, 0], atol=1e-6)


def test_definitions_and_defaults(monkeypatch: pytest.MonkeyPatch) -> None:
    assert run(monkeypatch, "render", "scene.xml", "-D", "radius=0.01", "--spp", "1", "-N", "2", "-q") == 0
    assert mi.Bitmap("scene.exr").width() == 12


def test_stratify_draws_and_lists(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(monkeypatch, "stratify", "map.exr", "-n", "37", "-o", "r.png", "--json", "r.json") == 0
    assert "37 region(s), energies" in capsys.readouterr().out
    described = json.loads(Path("r.json").read_text())
    assert len(described["regions"]) == 37 and described["width"] == 48
    region = described["regions"][0]
    assert set(region) == {"texels", "u", "v", "solid_angle", "energy", "mean_colour", "direction"}
    assert sum(r["solid_angle"] for r in described["regions"]) == pytest.approx(4 * np.pi)
    assert mi.Bitmap("r.png").width() >= 1024
    assert run(monkeypatch, "stratify", "map.exr", "-n", "2", "--json", "-") == 0
    captured = capsys.readouterr()
    assert len(json.loads(captured.out)["regions"]) == 2 and "cut in" in captured.err


def test_techniques_are_rendered_by_name(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    size = ("--size", "12x8", "--spp", "8")
    for text in ("stratified:strata=8", "importance:samples=8", "direct", "kmeans:lights=8,jitter=true"):
        assert run(monkeypatch, "render", "scene.xml", "--technique", text, *size, "-o", "a.exr") == 0
        assert mi.Bitmap("a.exr").metadata()["technique"] == text.partition(":")[0]
    assert run(monkeypatch, "techniques") == 0
    lines = capsys.readouterr().out.splitlines()
    for name in techniques():
        assert any(line.startswith(name) for line in lines)


def test_rigs_are_written_and_drawn(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for method in RIGS:
        arguments = ("rig", "map.exr", "--method", method, "-n", "12", "-o", "rig.json", "--plot", "rig.png")
        assert run(monkeypatch, *arguments) == 0
        rig = json.loads(Path("rig.json").read_text())
        assert len(rig["lights"]) == 12 and rig["method"] == method and rig["format"] == "stratalux rig"
        assert set(rig["lights"][0]) == {"direction", "colour", "solid_angle"}
        assert mi.Bitmap("rig.png").width() >= 1024
        assert f"12 light(s) by {method}" in capsys.readouterr().out
    assert run(monkeypatch, "rig", "map.exr", "-n", "2", "-o", "-") == 0
    assert len(json.loads(capsys.readouterr().out)["lights"]) == 2


def test_rigs_are_written_for_other_tools(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """By suffix, by name, several at once, and from the JSON of one that is there."""
    fit = ("--method", "fitted", "-n", "2", "--ambient", "sh2")
    outputs = ("-o", "rig.json", "--to", "rig.py", "--to", "three:three.json", "--to", "rig.xml")
    assert run(monkeypatch, "rig", "map.exr", *fit, *outputs, "--plot", "rig.png") == 0
    said = capsys.readouterr()
    assert "2 light(s) by fitted" in said.out and "% off, shadows" in said.out and said.err == ""
    made = json.loads(Path("rig.json").read_text())
    assert len(made["ambient"]) == 9 and set(made["quality"]) == {"irradiance_error", "shadow_error"}
    assert made["map"] == "map.exr"
    assert json.loads(Path("three.json").read_text())["object"]["type"] == "Group"
    assert "bpy" in Path("rig.py").read_text() and Path("rig-ambient.exr").exists() and Path("rig.png").exists()
    assert run(monkeypatch, "rig", "rig.json", "-o", "again.py", "--to", "unreal", "--to", "again.glb") == 0
    said = capsys.readouterr()
    assert said.err.splitlines() == [
        f"stratalux: warning: {name}: the format has no ambient light, which is left out; choose --ambient none"
        for name in ("again.py", "again.glb")
    ]
    assert "import unreal" in Path("again.py").read_text()
    assert run(monkeypatch, "rig", "rig.json", "-o", "-") == 0
    assert json.loads(capsys.readouterr().out) == made


def test_rigs_have_reports(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """A page with pictures, here of a few pixels."""
    for name, value in {"SPHERES": (24, 8), "OBJECT": (12, 8), "_SPP": 4, "_SPP_OF_ALL": 4, "_DETAIL": 1}.items():
        monkeypatch.setattr(rig_scenes, name, value)
    assert run(monkeypatch, "rig", "map.exr", "-n", "3", "--report", "rig.html") == 0
    assert capsys.readouterr().out.endswith("; open rig.html in a browser\n")
    page = Path("rig.html").read_text()
    assert "3 lights by median-cut in place of map.exr" in page and "stratalux rig map.exr --lights 3" in page
    assert run(monkeypatch, "rig", "map.exr", "--report", "rig.png") == 2
    assert "a report is a page; give a name that ends with .html" in capsys.readouterr().err


def test_the_sun_alone(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(monkeypatch, "rig", "map.exr", "--sun", "-o", "sun.json") == 0
    assert "1 light(s) by sun" in capsys.readouterr().out
    made = json.loads(Path("sun.json").read_text())
    assert len(made["lights"]) == 1 and made["lights"][0]["angle"] > 0 and len(made["ambient"]) == 9


def test_maps_are_converted(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """There and back, as six files, as harmonics, and without the sun; what was guessed is told."""
    assert run(monkeypatch, "map", "map.exr", "--to", "cross", "--size", "6", "-o", "sky_cross.hdr") == 0
    said = capsys.readouterr()
    assert said.out.startswith("wrote sky_cross.hdr: cross, six faces of 6x6, from latlong, ") and said.err == ""
    assert run(monkeypatch, "rig", "sky_cross.hdr", "-n", "2", "-o", "rig.json") == 0
    assert capsys.readouterr().err == (
        "stratalux: warning: sky_cross.hdr: taken for the layout cross, as its name says; --env-layout says otherwise\n"
    )
    assert run(monkeypatch, "stratify", "sky_cross.hdr", "-n", "2", "--env-layout", "cross") == 0
    assert capsys.readouterr().err == ""
    shown = ("--size", "6x4", "--spp", "1", "-q", "-o", "a.exr")
    assert run(monkeypatch, "render", "demo", "--env", "sky_cross.hdr", "--env-layout", "cross", *shown) == 0
    assert capsys.readouterr().err == ""
    assert run(monkeypatch, "map", "map.exr", "--to", "sh", "-o", "sh.json", "-o", "sh.glsl") == 0
    assert len(json.loads(Path("sh.json").read_text())["irradiance"]) == 9
    capsys.readouterr()
    lights = ("--light", "sun.json", "--light", "three:sun3.json")
    assert run(monkeypatch, "map", "map.exr", "--remove-sun", "-o", "rest.exr", *lights) == 0
    assert "left out: a sun of" in capsys.readouterr().out
    assert json.loads(Path("sun.json").read_text())["method"] == "sun" and Path("sun3.json").exists()


def test_doctor_and_completion(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(monkeypatch, "doctor") == 0
    out = capsys.readouterr().out
    assert "llvm_ad_rgb" in out and "works" in out and "libLLVM" in out
    for shell in ("bash", "zsh", "fish"):
        assert run(monkeypatch, "completion", shell) == 0
        assert "_STRATALUX_COMPLETE" in capsys.readouterr().out


def test_doctor_where_llvm_aborts(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert not variants.llvm_aborts()
    monkeypatch.setattr(variants, "llvm_aborts", lambda: True)
    monkeypatch.setattr(variants.dr, "has_backend", lambda backend: backend == dr.JitBackend.LLVM)
    assert run(monkeypatch, "doctor") == 1
    out = capsys.readouterr().out
    assert "aborts with this LLVM library" in out and "no variant works" in out


COMPARE = ("--size", "24x16", "--rays", "4", "--spp", "1", "--repeats", "1", "--reference-spp", "16")


def test_compare_writes_a_folder_and_a_table(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("STRATALUX_CACHE", "cache")
    arguments = ("compare", "mesh.obj", "--env", "map.exr", *COMPARE, "--technique", "stratified", "-t", "direct")
    assert run(monkeypatch, *arguments) == 0
    out = capsys.readouterr().out
    assert "reference: path (max_depth=2), 16 spp, made in" in out and "wrote compare-mesh" in out
    assert all(word in out for word in ("Equal shadow rays", "Equal time", "direct", "relMSE", "FLIP", "vs best"))
    content = json.loads(Path("compare-mesh/results.json").read_text())
    assert [entry["name"] for entry in content["entries"]] == ["stratified", "direct"]
    assert content["settings"]["rays"] == [4] and Path("compare-mesh/direct-4.png").exists()
    assert "report.html" in out and Path("compare-mesh/report.html").exists()
    assert len(list(Path("cache").rglob("*.npz"))) == 1
    command = shlex.split(content["settings"]["command"])
    assert run(monkeypatch, *command[1:], "--force", "-q") == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    assert json.loads(Path("compare-mesh/results.json").read_text())["settings"] == content["settings"]
    assert json.loads(Path("compare-mesh/results.json").read_text())["reference"]["cached"] is True


def test_reproduce_says_which_claims_hold(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    arguments = ("reproduce", "fig1", "--quick", "--assets", str(make_assets(folder / "assets")), "-o", "out")
    assert run(monkeypatch, *arguments) == 0
    captured = capsys.readouterr()
    assert "64 rectangles" in captured.out and "holds" in captured.out and "wrote out" in captured.out
    assert "note: A quick run" in captured.err
    assert json.loads(Path("out/claims.json").read_text())["sections"][0]["anchor"] == "fig1"
    assert run(monkeypatch, *arguments, "-q") == 0
    assert capsys.readouterr().out == ""


def test_an_interrupted_reproduction_says_how_to_go_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    def interrupt(*arguments: object, **options: object) -> None:
        os.kill(os.getpid(), signal.SIGINT)  # the handler has run when this returns, and it does not
        pytest.fail("the signal was lost")

    monkeypatch.setattr("stratalux.reproduce.run.write_all", interrupt)
    assert run(monkeypatch, "reproduce", "fig1", "--quick", "--assets", str(make_assets(folder / "assets"))) == 130
    assert "stratalux: interrupted; the same command resumes\n" in capsys.readouterr().err
    assert len(list((folder / "reproduction" / "steps").iterdir())) == 1


@pytest.mark.parametrize("command", [(), *((name,) for name in COMMANDS)])
def test_help_has_examples(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: tuple[str, ...]
) -> None:
    assert run(monkeypatch, *command, "--help") == 0
    assert "Examples:" in capsys.readouterr().out


def test_without_a_command_there_is_help(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(monkeypatch) == 0
    assert "Examples:" in capsys.readouterr().out


def test_an_error_of_ours_takes_one_line_and_a_traceback_only_when_asked(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("not\na number")

    monkeypatch.setattr("stratalux.maps.median_cut.median_cut", broken)
    assert run(monkeypatch, "stratify", "map.exr", "-n", "4") == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "ZeroDivisionError: not a number" in error and "please report" in error
    assert run(monkeypatch, "--debug", "stratify", "map.exr", "-n", "4") == 1
    assert "Traceback" in capsys.readouterr().err


def spoil() -> None:
    """All sorts of bad files."""
    data = Path("map.exr").read_bytes()
    Path("truncated.exr").write_bytes(data[: len(data) // 2])
    Path("text.exr").write_text("hello")
    Path("empty.obj").write_text("v 0 0 0\n")
    Path("mesh.xyz").write_text("")
    Path("bad.xml").write_text("<scene version='3.0.0'><shape type='sphere'></scene>")
    Path("plugin.xml").write_text("<scene version='3.0.0'><shape type='nonsense'/></scene>")
    Path("property.xml").write_text(
        XML.format(emitter='<shape type="sphere"><float name="nonsense" value="1"/></shape>')
    )
    Path("sensor.xml").write_text("<scene version='3.0.0'><shape type='sphere'/></scene>")
    Path("shape.xml").write_text("<shape version='3.0.0' type='sphere'/>")
    Path("lost.xml").write_text(
        XML.format(emitter='<emitter type="envmap"><string name="filename" value="no.exr"/></emitter>')
    )
    shear = '<emitter type="envmap"><string name="filename" value="map.exr"/>'
    shear += '<transform name="to_world"><scale x="2"/></transform></emitter>'
    Path("shear.xml").write_text(XML.format(emitter=shear))
    texture = '<bsdf type="diffuse" id="b"><texture type="bitmap" name="reflectance">{}</texture></bsdf>'
    Path("texture.xml").write_text(XML.format(emitter=texture.format("")))
    piped = texture.format('<string name="filename" value="pipe.xml"/>')
    Path("texture-pipe.xml").write_text(XML.format(emitter=piped))
    aov = '<integrator type="aov"><string name="aovs" value="depth"/><integrator type="direct"/></integrator>'
    Path("aov.xml").write_text(XML.format(emitter=aov))
    wide = '<film type="hdrfilm"><rfilter type="gaussian"><float name="stddev" value="-1e30"/></rfilter>'
    Path("wide.xml").write_text(XML.replace('<film type="hdrfilm">', wide).format(emitter=""))
    Path("latin.xml").write_bytes(XML.format(emitter='<shape type="\xe9"/>').encode("latin-1"))
    for name in ("pipe.xml", "pipe.exr"):
        os.mkfifo(name)
    os.symlink("loop.exr", "loop.exr")
    os.symlink("no/such/a.exr", "nowhere.exr")
    Path("folder.exr").mkdir()
    Path("full").mkdir()
    Path("full/precious.txt").touch()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("render none.xml", "none.xml: no such file"),
        ("render none.obj --env map.exr", "none.obj"),
        ("render mesh.obj", "--env"),
        ("render mesh.obj --env none.exr", "none.exr: no such file"),
        ("render mesh.obj --env truncated.exr", "truncated.exr: cannot be read"),
        ("render mesh.obj --env text.exr", "text.exr: cannot be read"),
        ("render mesh.xyz --env map.exr", "mesh.xyz: unknown kind"),
        ("render empty.obj --env map.exr", "empty.obj"),
        ("render bad.xml", "bad.xml"),
        ("render plugin.xml", "nonsense"),
        ("render property.xml", "nonsense"),
        ("render sensor.xml", "no sensor"),
        ("render shape.xml", "not a scene"),
        ("render lost.xml", "no.exr"),
        ("render shear.xml", "shears or scales unevenly"),
        ("render dark.xml --env-rotate 90", "no environment map"),
        ("render demo --strata 0", "strata"),
        ("render demo --proposals 0", "proposals"),
        ("render demo --spp 0", "spp"),
        ("render demo --quiet --verbose", "give one"),
        ("render demo --size 0x4", "not a size"),
        ("render demo --size big", "not a size"),
        ("render demo --env-rotate up", "not a rotation"),
        ("render demo --material cheese", "cheese"),
        ("render demo --camera 1 --orbit 0,0", "camera '1' and orbit contradict each other"),
        ("render mesh.obj --env map.exr --camera 1", "camera '1': the file has none"),
        ("render demo --orbit -30", "'-30' is not an orbit; write AZIMUTH,ELEVATION"),
        ("render demo --orbit 0,100", "beyond the zenith"),
        ("render demo --look-at up", "'up' is not a point"),
        ("render mesh.obj --env map.exr --focus 2", "give its aperture, too"),
        ("render scene.xml --orbit 0,0", "orbit: a Mitsuba scene brings its own cameras"),
        ("render scene.xml --camera left", "camera 'left': there is none; give one of 0"),
        ("compare scene.xml -t path --camera left", "camera 'left': there is none; give one of 0"),
        ("render demo --env-frame maya", "maya"),
        ("render demo --variant scalar_rgb", "scalar_rgb"),
        ("render demo --variant nonsense", "nonsense"),
        ("render demo -o no/such/place.exr", "cannot be written"),
        ("render demo -o folder.exr", "is a folder"),
        ("render demo -o a.gif", "unknown image format"),
        ("render demo -o a.png -o a.jpeg --bits 16", "a.jpeg: has no 16 bits; write one of .png, .tif, .tiff"),
        ("render demo -o a.png --bits 12", "bits: 12 is none of 8, 16"),
        ("render demo -o a.png --bits many", "none of 8, 16"),
        ("render demo -o a.png -o a.hdr --float32", "--float32: no output has a choice of 32 bits"),
        ("render demo -o a.webp --size 16384x1", "a.webp: has at most 16383 pixels along a side"),
        ("render demo --view sepia", "sepia"),
        ("render demo --exposure dim", "'dim' is no exposure; write a number of stops, or auto"),
        ("render demo --exposure nan", "not a finite number"),
        ("develop map.exr -o a.exr", "a.exr: unknown image format '.exr'; use one of .png, .jpg"),
        ("develop map.exr", "--output"),
        ("develop -o a.png", "IMAGE"),
        ("develop none.exr -o a.png", "none.exr: no such file"),
        ("develop map.exr text.exr -o {}.png", "text.exr: cannot be read as an image"),
        ("develop map.exr text.exr -o full/", "text.exr: cannot be read as an image"),
        ("develop map.exr map.exr -o a.png", "a.png: is one name for 2 pictures"),
        ("develop map.exr -o pipe/", "pipe/: no such folder"),
        ("develop map.exr -o a.webp --bits 16", "a.webp: has no 16 bits"),
        ("develop map.exr -o a.png --max-memory 1K", "max-memory"),
        ("develop mesh.obj -o a.png", "mesh.obj: cannot be read as an image"),
        ("stratify map.exr -o a.png --view sepia", "sepia"),
        ("render demo -D radius", "name=value"),
        (f"render demo -o {'x' * 252}.exr", "the name has 256 bytes"),
        ("render demo -o \udcff.exr", "the name is not UTF-8"),
        ("render demo --max-memory none", "'none' is no size of memory"),
        ("render mesh.obj --env map.exr --max-memory 1K", "max-memory"),
        ("render scene.xml -D nonsense=3", "nonsense"),
        ("compare demo", "technique"),
        ("compare demo -t nonsense", "technique 'nonsense' is unknown; use one of"),
        ("compare demo -t stratified:colour=2", "no property 'colour'"),
        ("compare demo -t stratified:strata=-1", "strata"),
        ("compare demo -t path -t path", "given twice"),
        ("compare demo -t path --rays many", "'many' is no list of numbers"),
        ("compare demo -t path --rays 4,,8", "no list of numbers"),
        ("compare demo -t path --rays 0", "no list of numbers"),
        ("compare demo -t path --spp 0", "spp"),
        ("compare demo -t path --repeats 0", "repeats"),
        ("compare demo -t path --seed -1", "seed"),
        ("compare demo -t path --size 0x4", "not a size"),
        ("compare none.xml -t path", "none.xml: no such file"),
        ("compare mesh.obj -t path", "--env"),
        ("compare demo -t path --variant nonsense", "nonsense"),
        ("compare demo -t path -o folder.exr/no/place", "cannot be written"),
        ("compare demo -t path -o map.exr", "is a file"),
        ("compare demo -t path -o full --force", "is not empty"),
        (f"render {'x' * 300}.xml", "File name too long"),
        ("render full", "full: is a folder; give a Mitsuba scene"),
        ("render pipe.xml", "pipe.xml: is a pipe or a device"),
        ("render demo -o pipe.exr", "pipe.exr: is a pipe or a device"),
        ("render demo -o loop.exr", "loop.exr: cannot be written"),
        ("render demo -o nowhere.exr", "no/such/a.exr: cannot be written"),
        ("render demo --output=", "is empty"),
        (f"render demo -o {'x' * 300}/a.exr", "the name has 300 bytes"),
        ("render demo -o a.exr -o ./a.exr", "is to be written twice"),
        ("render mesh.obj --env map.exr -o map.exr", "map.exr: is read, and would be lost"),
        ("render mesh.obj --env=", "is no map"),
        ("render demo --variant=", "variant : unknown"),
        ("render scene.xml -D radius=\udcff", "is not UTF-8"),
        ("render scene.xml -D radius=nan", "scene.xml, line 7: nan is no number"),
        ("render scene.xml -D radius=1e39", "1e39 is no number"),
        ("render texture.xml", "a bitmap without a file"),
        ("render texture-pipe.xml", "pipe.xml: is no file"),
        ("render aov.xml", "'depth' is no AOV; write name:type"),
        ("render wide.xml", "a reconstruction filter has a radius of"),
        ("render latin.xml", "latin.xml: is not UTF-8"),
        ("render a\fb.xml", "a\\x0cb.xml: no such file"),
        ("render demo -t direct:emitter_samples=0,bsdf_samples=0", "are all 0"),
        ("render demo -t direct:emitter_samples=1048576", "too large; give at most 512"),
        (f"compare demo -t path -o {'x' * 300}", "the name has 300 bytes"),
        ("compare demo -t path -o \udcff", "?: the name is not UTF-8"),
        ("compare demo -t path --output=", "is empty"),
        (f"reproduce -o {'x' * 300}", "the name has 300 bytes"),
        (f"stratify {'x' * 300}.exr", "File name too long"),
        ("stratify map.exr -o a.png --json a.png", "is to be written twice"),
        ("stratify map.exr --json map.exr", "is read, and would be lost"),
        ("stratify map.exr --output=", "is empty"),
        ("stratify map.exr -n 99999999999", "-n"),
        ("rig map.exr --output=", "is empty"),
        (f"settings {'x' * 300}.exr", "File name too long"),
        ("render", "SCENE"),
        ("render demo --nonsense", "nonsense"),
        ("render demo --technique nonsense", "nonsense"),
        ("render demo --technique stratified:strata", "key=value"),
        ("render demo --technique stratified:strata=-1", "strata"),
        ("render demo --technique stratified:strata=many", "strata"),
        ("render demo --technique stratified:colour=3", "colour"),
        ("render demo --technique importance:sequence=halton", "halton"),
        ("render demo --technique importance:samples=4294967296", "too large; give at most"),
        ("render demo --technique kmeans:lights=99999999", "too large"),
        ("render demo --technique path --strata 4", "strata"),
        ("map none.exr -o a.exr", "none.exr: no such file"),
        ("map map.exr", "Missing option '-o'"),
        ("map map.exr -o a.png", "unknown image format '.png'"),
        ("map map.exr -o a.exr --to globe", "globe"),
        ("map map.exr -o a.exr --size 0", "size"),
        ("map map.exr -o a.exr --light sun.json", "is for the sun that --remove-sun leaves out"),
        ("map map.exr -o map.exr", "is read, and would be lost"),
        ("map map.exr -o a.exr --env-layout faces", "cannot be the size of a face, which is 1:1"),
        ("render demo --env map.exr --env-layout cross", "cannot be the layout cross, which is 4:3"),
        ("render demo --env-layout cross", "says how the map of --env lies in its file; give both"),
        ("rig map.exr --env-layout angular", "cannot be the layout angular, which is 1:1"),
        ("rig none.exr", "no such file"),
        ("rig map.exr -n 0", "-n"),
        ("rig map.exr -n 1000000", "1000000"),
        ("rig map.exr --method nonsense", "nonsense"),
        ("rig map.exr --plot a.exr", "unknown image format"),
        ("rig map.exr -o no/such/rig.json", "cannot be written"),
        ("rig map.exr -o rig.txt", "no rig is written as '.txt'; use one of .json"),
        ("rig map.exr --to three", "is a format; give the file too, as in three:FILE"),
        ("rig map.exr --to three:rig.xml", "a rig for three ends with .json"),
        ("rig map.exr -o a.py --to unreal:a.py", "is to be written twice"),
        ("rig map.exr --sun -n 3", "leave --method and -n out"),
        ("rig map.exr --ambient sh2", "goes with --method fitted or --sun"),
        ("rig map.exr --method fitted -n 129", "choose kmeans"),
        ("rig map.exr --env-frame maya", "maya"),
        ("rig none.json", "none.json: no such file"),
        ("rig none.json -n 3", "is a rig already; lights is for maps"),
        ("rig none.json --plot a.png", "is a rig already; plot is for maps"),
        ("rig none.json --report a.html", "is a rig already; report is for maps"),
        ("settings map.exr", "map.exr: says nothing of settings"),
        ("settings none.exr", "none.exr: no such file"),
        ("settings text.exr", "text.exr: cannot be read"),
        ("settings map.exr --json --python", "ask for one of them"),
        ("render demo --seed 4294967296", "seed"),
        ("render demo --exposure 1e300", "exposure"),
        ("render demo --env-scale nan", "not a finite number"),
        ("render demo --env-scale -1", "env-scale"),
        ("render demo --size 65536x65536", "too large"),
        ("render demo --spp 2147483647", "spp"),
        ("reproduce fig9", "item 'fig9' is unknown; use fig1"),
        ("reproduce -o map.exr", "is a file"),
        ("reproduce -o full", "is not empty, and holds no reproduction"),
        ("reproduce -o no/such/place", "cannot be written"),
        ("reproduce fig1 --assets nowhere", "no such folder"),
        ("reproduce fig1 --variant nonsense", "nonsense"),
        ("nonsense", "nonsense"),
        ("stratify none.exr", "no such file"),
        ("stratify map.exr -n 0", "-n"),
        ("stratify map.exr -o regions.exr", "unknown image format"),
        ("stratify map.exr --json no/such/place.json", "cannot be written"),
    ],
)
def test_bad_input_takes_one_line_and_exits_with_2(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], arguments: str, words: str
) -> None:
    spoil()
    before = sorted(p.name for p in Path().iterdir())
    assert run(monkeypatch, *arguments.split(" ")) == 2
    captured = capfd.readouterr()
    assert captured.err.count("\n") == 1 and captured.err.startswith("stratalux: error: "), captured.err
    assert words in captured.err
    assert captured.out == ""
    assert sorted(p.name for p in Path().iterdir()) == before


@pytest.mark.parametrize(
    ("shell", "code", "words"),
    [
        ("stratify none.exr 2>&-", 2, ""),
        ("stratify map.exr >&- 2>&-", 0, ""),
        ("stratify map.exr >/dev/full", 2, "standard output, or another file: No space left on device\n"),
        ("stratify map.exr -o \udcff.png", 2, "the name is not UTF-8"),
    ],
)
def test_streams_that_are_closed_or_full(folder: Path, shell: str, code: int, words: str) -> None:
    command = f"exec {shlex.quote(sys.executable)} -m stratalux {shell}"
    done = subprocess.run(["sh", "-c", command], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == code and done.stderr.endswith(words) | (words in done.stderr), done
    assert "Traceback" not in done.stderr and done.stderr.count("\n") <= 1


def test_what_cannot_be_shown_is_escaped(folder: Path) -> None:
    command = [sys.executable, "-m", "stratalux", "techniques"]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True, env=environment)
    assert "Kollig" in done.stdout or "\\x" in done.stdout


def test_the_largest_seed_is_remembered(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(monkeypatch, "render", "scene.xml", "--seed", "4294967295", *SMALL, "-o", "a.exr", "-q") == 0
    assert run(monkeypatch, "settings", "a.exr") == 0
    assert "--seed 4294967295" in capsys.readouterr().out


def test_a_link_is_followed_and_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    os.symlink("real.exr", "link.exr")
    assert run(monkeypatch, "render", "scene.xml", *SMALL, "-o", "link.exr", "-q") == 0
    assert Path("link.exr").is_symlink() and Path("real.exr").is_file()


def test_turns_of_any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    for angle in ("90", str(90 + 360 * 10**9)):
        arguments = ("--env-rotate", angle, *SMALL, "-o", f"{len(angle)}.exr", "-q")
        assert run(monkeypatch, "render", "scene.xml", *arguments) == 0
    np.testing.assert_allclose(np.array(mi.Bitmap("2.exr")), np.array(mi.Bitmap("12.exr")), rtol=1e-5)


def test_odd_maps_are_rendered_with_a_warning(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    texels = hall_map(16, 32)
    texels[3, 3], texels[4, 4], texels[5, 5] = np.nan, np.inf, -1
    mi.Bitmap(texels).write("odd.exr")
    assert run(monkeypatch, "render", "mesh.obj", "--env", "odd.exr", *SMALL, "-o", "a.exr") == 0
    assert "1 NaN, 1 infinite, 1 negative texel(s) repaired" in capfd.readouterr().err
    assert np.isfinite(np.array(mi.Bitmap("a.exr"))).all()
    Path("odd.xml").write_text(Path("scene.xml").read_text().replace("map.exr", "odd.exr"))
    assert run(monkeypatch, "render", "odd.xml", *SMALL, "-o", "b.exr") == 0
    assert "repaired" in capfd.readouterr().err
    assert np.isfinite(np.array(mi.Bitmap("b.exr"))).all()
    mi.Bitmap(hall_map(16, 20)).write("square.exr")
    assert run(monkeypatch, "stratify", "square.exr") == 0
    assert "20x16 is not 2:1" in capfd.readouterr().err


def test_a_black_map_renders_black(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    mi.Bitmap(np.zeros((16, 32, 3), dtype=np.float32)).write("black.exr")
    assert run(monkeypatch, "render", "mesh.obj", "--env", "black.exr", *SMALL, "-o", "a.exr", "-o", "a.png") == 0
    assert luminance("a.exr") == 0
    assert run(monkeypatch, "stratify", "black.exr", "-o", "b.png", "--json", "b.json") == 0
    assert "1 region(s) (of 64 asked for" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("render", "scene.xml", "--spp", "2", "-o", "a.exr"), "2/2 spp"),
        (("compare", "scene.xml", "-t", "stratified", "--rays", "2", "--reference-spp", "16"), "comparing"),
        (("reproduce", "fig1", "--quick", "--assets", "assets"), "reproducing"),
    ],
)
def test_a_terminal_sees_progress(folder: Path, arguments: tuple[str, ...], words: str) -> None:
    make_assets(folder / "assets")
    with Terminal(folder, *arguments, STRATALUX_CACHE=str(folder / "cache")) as terminal:
        assert terminal.finish() == 0, terminal.seen
    assert words in terminal.seen and "left" in terminal.seen


@pytest.mark.parametrize("strata", [(), pytest.param(("--strata", "64"), marks=pytest.mark.slow)])
def test_interruption_keeps_what_is_done(folder: Path, strata: tuple[str, ...]) -> None:
    """Ctrl-C once the terminal tells of samples: they are in the file, and it is no error."""
    size = ("--size", "600x400", "--spp", "4096")  # minutes: it is not done by itself before it is stopped
    with Terminal(folder, "render", "demo", *size, *strata, "-o", "a.exr") as terminal:
        terminal.wait_for(r"\b[1-9]\d*/4096 spp")
        terminal.process.send_signal(signal.SIGINT)
        assert terminal.finish() == 130, terminal.seen
    assert "wrote a.exr" in terminal.out.read_text() and "Traceback" not in terminal.seen
    assert 0 < mi.Bitmap(str(folder / "a.exr")).metadata()["spp"] < 4096


@pytest.mark.parametrize("mesh", ["happy_buddha.obj", "teapot.obj"])
def test_real_meshes_in_grace(monkeypatch: pytest.MonkeyPatch, mesh: str) -> None:
    arguments = (str(asset(f"meshes/{mesh}")), "--env", str(asset("envmaps/grace_latlong.exr")), "--env-rotate", "flip")
    assert run(monkeypatch, "render", *arguments, "--size", "60x40", "--spp", "2", "-N", "16", "-o", "a.png") == 0


def test_matpreview_untouched(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = str(asset("scenes/matpreview/matpreview.xml"))
    assert run(monkeypatch, "render", scene, "-D", "spp=2", "-D", "width=60", "-D", "height=45", "-o", "a.exr") == 0
    assert luminance("a.exr") > 0 and mi.Bitmap("a.exr").width() == 60


def test_a_few_samples_less_than_asked_for_are_no_interruption() -> None:
    """Where the samples of a pixel follow its error, their mean comes out near what was asked for."""
    from types import SimpleNamespace

    from stratalux.cli.watch import Watched, watch

    done = SimpleNamespace(
        spp=63,
        spp_total=64,
        camera_rays=1,
        shadow_rays=1,
        seconds=1.0,
        part=0,
        parts=1,
        picture=None,
        error=None,
        enough=False,
        share=63 / 64,
        work={"": (63, 64)},
        workers="",
    )
    assert watch(lambda: iter([done]), None, quiet=True) == Watched(done, 0, "")
