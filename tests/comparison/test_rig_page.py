"""The report of a rig: its pictures, and what the page says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import EnvironmentMap
from stratalux.comparison import rig_page, rig_scenes
from stratalux.comparison.rig_page import rig_report
from stratalux.comparison.rig_scenes import View, views
from stratalux.images.metrics import why_no_flip
from stratalux.maps.geometry import direction
from stratalux.report.html import write_report
from stratalux.report.model import ImageSet, Table
from stratalux.rigs.fitted import sun_and_sky
from stratalux.rigs.lights import Lights
from stratalux.rigs.quality import quality
from tests.report.browser import Browser, start
from tests.rigs.maps import blobs_map


def sky() -> NDArray[np.float32]:
    """A sun to the left, above and in front of what a camera at +z sees, in a dim sky."""
    u, v = np.meshgrid((np.arange(128) + 0.5) / 128, np.arange(64) / 63)
    d = direction(u, v)
    towards = np.array([-0.6, 0.5, 0.6]) / np.linalg.norm([-0.6, 0.5, 0.6])
    sun = 3000 * (d @ towards > np.cos(np.radians(2.5)))[..., None]
    return np.asarray(0.4 + 0.2 * d[..., 1:2] + sun * np.array([1, 0.8, 0.6]), dtype=np.float32)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"SPHERES": (54, 18), "OBJECT": (30, 20), "_SPP": 16, "_SPP_OF_ALL": 32, "_DETAIL": 1}.items():
        monkeypatch.setattr(rig_scenes, name, value)


@pytest.mark.usefixtures("small")
def test_lights_light_as_their_map_does() -> None:
    """A matte sphere and an object under a sun and its sky; a mirror has the sky, and no sun."""
    mi.set_variant("llvm_ad_rgb")
    environment = EnvironmentMap(sky())
    lights = sun_and_sky(environment)
    spheres, thing = views(environment, lights)
    assert spheres.under_map.shape == spheres.under_rig.shape == (18, 54, 3)
    matte = np.s_[2:-2, 1:16]
    apart = spheres.under_rig[matte] - spheres.under_map[matte]
    assert np.sqrt(np.mean(apart**2)) < 0.12 * np.sqrt(np.mean(spheres.under_map[matte] ** 2))
    assert thing.under_rig.mean() == pytest.approx(thing.under_map.mean(), rel=0.05)
    # From the left: it is brighter there, under both.
    for image in (spheres.under_map, spheres.under_rig):
        assert image[6:9, 2:7].mean() > 2 * image[9:12, 11:16].mean()
    alone = rig_scenes._under_lights(rig_scenes._spheres(), replace(lights, ambient=None, angle=np.zeros(1)))
    assert alone[matte].max() > 0 == alone[:, 40:].max()


def made(lights: Lights, **more: object) -> Lights:
    environment = EnvironmentMap(blobs_map())
    return replace(lights, quality=quality(environment, lights), map="maps/blobs.exr", **more)


def pictures() -> list[View]:
    under = np.full((20, 60, 3), 0.25, dtype=np.float32)
    under[5:, 30:] = 0.5
    return [View("Spheres", under, under * np.float32(1.1)), View("A thing", under, under)]


def test_the_page_has_the_map_the_pictures_and_the_errors() -> None:
    environment = EnvironmentMap(blobs_map())
    ambient = np.concatenate([np.full((1, 3), 0.4), np.zeros((8, 3))])
    three = Lights(np.eye(3), np.diag([3.0, 2.0, 1.0]) + 0.2, np.array([0.0, 0.1, 0.0]), "hand", ambient=ambient)
    lights = made(three)
    report = rig_report(environment, lights, pictures(), command="stratalux x")
    assert report.title == "Light rig: blobs.exr"
    assert report.summary[0] == "3 lights by hand and an ambient light in place of blobs.exr."
    assert "% off, in the shadow of a ball" in report.summary[1] and report.facts["command"] == "stratalux x"
    the_map, shown, errors, listed = report.sections
    (block,) = the_map.blocks
    assert isinstance(block, ImageSet)
    assert [picture.name for picture in block.pictures] == ["with the lights", "without"]
    assert (block.pictures[0].image != block.pictures[1].image).any()
    spheres, thing = shown.blocks
    assert isinstance(spheres, ImageSet) and spheres.reference is not None
    assert [picture.name for picture in spheres.pictures] == ["under the lights"]
    assert (spheres.pictures[0].flip is None) == (why_no_flip() is not None)
    (table,) = errors.blocks
    assert isinstance(table, Table) and table.rows[0][0] == "irradiance, over all normals"
    values = dict(table.rows)
    assert float(values["a thing: relative MSE"]) == 0 < float(values["spheres: relative MSE"])
    (rows,) = listed.blocks
    assert isinstance(rows, Table) and len(rows.rows) == 3 and rows.rows[0][3].endswith("%")
    assert isinstance(thing, ImageSet)


def test_the_picture_of_a_large_map_is_smaller(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rig_page, "_MAP_HEIGHT", 16)
    environment = EnvironmentMap(blobs_map(67, 131))
    (block,) = rig_report(environment, made(Lights(np.eye(3), np.eye(3), np.zeros(3), "hand")), []).sections[0].blocks
    assert isinstance(block, ImageSet) and block.pictures[1].image.shape == (16, 32, 3)
    np.testing.assert_allclose(block.pictures[1].image[0, 0], environment.texels[:4, :4].mean(axis=(0, 1)), rtol=1e-5)


def test_the_brightest_of_many_lights_are_listed() -> None:
    environment = EnvironmentMap(blobs_map())
    many = Lights(np.tile([[0.0, 1.0, 0.0]], (100, 1)), np.full((100, 3), 0.1), np.zeros(100), "made up")
    (table,) = rig_report(environment, many, pictures()).sections[-1].blocks
    assert isinstance(table, Table) and len(table.rows) == 64 and "The brightest 64 of 100." in table.text


def test_a_browser_shows_it(tmp_path: Path) -> None:
    environment = EnvironmentMap(sky())
    path = tmp_path / "rig.html"
    write_report(rig_report(environment, made(sun_and_sky(environment)), pictures()), path)
    driver = start()
    try:
        browser = Browser(driver, path)
        browser.open()
        assert browser.script("return document.querySelectorAll('.viewer').length") >= 1
        assert browser.text("h1") == "Light rig: blobs.exr"
        browser.click("without")
        assert browser.pressed("without") and browser.errors() == []
    finally:
        driver.quit()
