"""Mitsuba's XML scenes: what cannot be is refused in one line, and what is not shown is told."""

from __future__ import annotations

import warnings
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import stratalux
from stratalux import InputError, load_scene
from stratalux.errors import SceneWarning
from stratalux.scenes.mitsuba_xml import DIRECT, dark_behind
from tests.helpers import hall_map

PATH_2 = '<integrator type="path"><integer name="max_depth" value="2"/>{}</integrator>'
SCENE = """<scene version="3.0.0">
    {integrator}
    <sensor type="perspective">
        <transform name="to_world"><lookat origin="0,0,-9" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm">
            <integer name="width" value="{width}"/><integer name="height" value="{height}"/>
            <string name="pixel_format" value="rgba"/><rfilter type="box"/>
        </film>
    </sensor>
    <shape type="sphere">{bsdf}</shape>
    <emitter type="envmap"><string name="filename" value="map.exr"/></emitter>
    {more}
</scene>"""


def write(path: Path, integrator: str = "", bsdf: str = "", more: str = "", width: int = 12, height: int = 8) -> Path:
    mi.Bitmap(hall_map(16, 32)).write(str(path.parent / "map.exr"))
    path.write_text(SCENE.format(integrator=integrator, bsdf=bsdf, more=more, width=width, height=height))
    return path


def told(path: Path) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_scene(path)
    return [str(warning.message) for warning in caught if issubclass(warning.category, SceneWarning)]


@pytest.mark.parametrize(
    "integrator",
    ["", '<integrator type="direct"/>', '<integrator type="path"><integer name="max_depth" value="2"/></integrator>'],
)
def test_nothing_is_told_where_nothing_is_lost(tmp_path: Path, integrator: str) -> None:
    assert told(write(tmp_path / "a.xml", integrator)) == []


def test_what_is_not_shown_is_told_in_one_line(tmp_path: Path) -> None:
    (line,) = told(write(tmp_path / "a.xml", '<integrator type="volpath"/>'))
    assert line == f"{tmp_path / 'a.xml'}: its integrator 'volpath' is replaced by path tracing"
    aov = '<integrator type="aov"><string name="aovs" value="dd:depth"/><integrator type="direct"/></integrator>'
    (line,) = told(write(tmp_path / "a.xml", aov))
    assert "its AOVs (dd:depth) are left out" in line


def test_what_is_black_behind() -> None:
    """Behind glass, direct light alone is; behind a mask inside of a bump map, any."""
    mask = {"type": "mask", "opacity": 0.5, "covers": {"type": "diffuse"}}
    bumpy = {"type": "bumpmap", "bumps": {"type": "checkerboard"}, "covers": mask}
    for bsdf, direct, whole in (
        ({"type": "dielectric"}, ["SmoothDielectric"], []),
        (bumpy, ["BumpMap"], ["BumpMap"]),
        (mask, [], []),
    ):
        scene = mi.load_dict({"type": "scene", "ball": {"type": "sphere", "bsdf": bsdf}})
        assert (dark_behind(scene, DIRECT), dark_behind(scene, 8)) == (direct, whole)


@pytest.mark.parametrize("strata", [None, 4])
def test_the_scene_hides_its_emitters(tmp_path: Path, strata: int | None) -> None:
    """As Mitsuba's path: without the map, alpha is 0 and so is the pixel; with it, alpha is 1 everywhere."""
    hidden = PATH_2.format('<boolean name="hide_emitters" value="true"/>')
    image = stratalux.render(write(tmp_path / "a.xml", hidden), strata=strata, spp=4).image
    assert np.array_equal(image[0, 0], [0, 0, 0, 0]) and image[4, 6, 3] == pytest.approx(1)
    image = stratalux.render(write(tmp_path / "b.xml"), strata=strata, spp=4).image
    assert image[0, 0, :3].min() > 0 and np.allclose(image[..., 3], 1)


@pytest.mark.parametrize(("width", "height"), [(0, 8), (8, 0), (1 << 15, 1 << 15)])
def test_films_that_cannot_be_are_refused(tmp_path: Path, width: int, height: int) -> None:
    with pytest.raises(InputError, match="a film has no pixels|a film of 32768x32768 is too large"):
        load_scene(write(tmp_path / "a.xml", width=width, height=height))


def test_nesting_without_end_is_refused(tmp_path: Path) -> None:
    """Mitsuba's parser would end the process, by a stack that is full."""
    deep = tmp_path / "deep.xml"
    deep.write_text("<scene version='3.0.0'>" + "<shape type='sphere'>" * 100_000 + "</shape>" * 100_000 + "</scene>")
    with pytest.raises(InputError, match="deep.xml: elements are nested more than 200 deep"):
        load_scene(deep)
    include = '<default name="name" value="b"/><include filename="$name.xml"/>'
    write(tmp_path / "a.xml", more=include)
    (tmp_path / "b.xml").write_text('<scene version="3.0.0"><include filename="a.xml"/></scene>')
    with pytest.raises(InputError, match="a.xml: includes itself"):
        load_scene(tmp_path / "a.xml")
    (tmp_path / "b.xml").write_text('<scene version="3.0.0"><shape type="cube"/></scene>')
    assert len(load_scene(tmp_path / "a.xml").shapes()) == 2
