"""Image files that a Mitsuba scene names: read by our reader, to the picture that Mitsuba makes of sound ones."""

from __future__ import annotations

import warnings
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import InputError, load_scene
from stratalux.errors import EnvironmentMapWarning, SceneWarning
from tests.helpers import hall_map, run
from tests.images.make import write

SCENE = """<scene version="3.0.0">
    <sensor type="perspective">
        <transform name="to_world"><lookat origin="0,0,-4" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/></film>
    </sensor>
    <shape type="sphere"><bsdf type="diffuse">
        <texture type="bitmap" name="reflectance"><string name="filename" value="{texture}"/></texture>
    </bsdf></shape>
    <shape type="cube"><transform name="to_world"><scale value="0.5"/><translate x="2"/></transform>
        <bsdf type="normalmap">
            <texture type="bitmap" name="normalmap">
                <boolean name="raw" value="true"/><string name="filename" value="{texture}"/>
            </texture>
            <bsdf type="roughplastic"/>
        </bsdf>
    </shape>
    <emitter type="envmap">
        <string name="filename" value="{map}"/><float name="scale" value="0.5"/>
        <transform name="to_world"><rotate y="1" angle="70"/></transform>
    </emitter>
</scene>"""


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A scene beside its map and its texture."""
    write(tmp_path / "map.exr", hall_map(16, 32))
    write(tmp_path / "texture.png", np.random.default_rng(5).random((8, 8, 3), dtype=np.float32), type="uint8")
    return scene(tmp_path)


def scene(folder: Path, map: str = "map.exr", texture: str = "texture.png") -> Path:
    path = folder / "scene.xml"
    path.write_text(SCENE.format(map=map, texture=texture))
    return path


def loaded(path: Path) -> tuple[mi.Scene, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = load_scene(path)
    return found, [str(w.message) for w in caught if issubclass(w.category, (SceneWarning, EnvironmentMapWarning))]


def texels(found: mi.Scene) -> NDArray[np.float32]:
    return np.array(mi.traverse(found.environment())["data"])[:, 1:-1]


def test_the_scene_is_that_of_mitsuba(files: Path) -> None:
    ours, said = loaded(files)
    assert not said
    theirs = mi.load_file(str(files))
    data = []
    for found in (ours, theirs):
        params = mi.traverse(found)
        names = list(params.keys())
        data.append([params[key] for key in names if key.endswith(("data", "scale", "to_world"))])
    for a, b in zip(*data, strict=True):
        assert type(a) is type(b)
        np.testing.assert_array_equal(np.array(getattr(a, "matrix", a)), np.array(getattr(b, "matrix", b)))
    assert [np.array(a).shape for a in data[0]].count((8, 8, 3)) == 2  # the texture, decoded and raw


def test_a_window_is_cropped(files: Path) -> None:
    """Mitsuba's own reader ends the process."""
    write(files.parent / "map.exr", hall_map(20, 40), at=(-4, -2), display=(0, 0, 32, 16))
    found, (line,) = loaded(files)
    np.testing.assert_array_equal(texels(found), hall_map(20, 40)[2:18, 4:36])
    where = "pixels, 40x20 at -4,-2, in a display window, 32x16 at 0,0"
    assert line == f"{files.parent / 'map.exr'}: {where}: what is outside is cropped"


def test_an_infinite_sun_is_the_largest_half(files: Path) -> None:
    pixels = hall_map(16, 32).astype(np.float32)
    pixels[3, 4] = np.inf
    with np.errstate(over="ignore"):
        write(files.parent / "map.exr", pixels, type="half")
    found, (line,) = loaded(files)
    assert (texels(found)[3, 4] == 65504).all() and texels(found).max() == 65504
    assert "1 infinite texel(s) repaired (infinite to 65504, the largest half" in line


@pytest.mark.parametrize("name", ["map.exr", "texture.exr"])
def test_damaged_files_are_one_line(
    files: Path, name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(files.parent / name, np.random.default_rng(6).random((64, 128, 3), dtype=np.float32))
    path.write_bytes(path.read_bytes()[:20_000])
    scene(files.parent, texture=name if name == "texture.exr" else "texture.png")
    monkeypatch.chdir(files.parent)
    for command in (["render", "--spp", "1", "-o", "a.exr"], ["compare", "--technique", "direct", "--rays", "4"]):
        assert run(monkeypatch, command[0], str(files), *command[1:]) == 2
        (line,) = capsys.readouterr().err.strip().splitlines()
        assert line.startswith(f"stratalux: error: {path}: cannot be read as an image (")
    assert not (files.parent / "a.exr").exists()


def test_what_is_replaced_is_not_read(files: Path) -> None:
    scene(files.parent, map="none.exr")
    found = load_scene(files, environment=str(files.parent / "map.exr"))
    np.testing.assert_array_equal(texels(found), hall_map(16, 32))
    with pytest.raises(InputError, match="none.exr: no such file"):
        load_scene(files)


@pytest.mark.parametrize("what", ["map.exr", "texture.exr"])
def test_memory_is_limited(files: Path, what: str) -> None:
    height = {"map.exr": 16, "texture.exr": 16, what: 32}
    write(files.parent / "map.exr", hall_map(height["map.exr"], 2 * height["map.exr"]))
    write(files.parent / "texture.exr", np.full((height["texture.exr"], 64, 3), 0.5, dtype=np.float32))
    scene(files.parent, texture="texture.exr")
    with pytest.raises(InputError, match=f"{what}: 64x32 pixels take .* --max-memory"):
        load_scene(files, max_memory=12 * 64 * 32 - 1)
    assert load_scene(files, max_memory=12 * 64 * 32)
