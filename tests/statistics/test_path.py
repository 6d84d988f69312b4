"""``path_stratified``: the mean image of Mitsuba's ``path``, and what is known without it."""

from __future__ import annotations

from functools import cache
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from stratalux import EnvironmentMap
from tests.helpers import MATERIALS, assert_same_mean, hall_map, lamp, runs, scene_dict, sidak, sun_map
from tests.variants import MONO, SPECTRAL

RUNS = 32
SLOW = pytest.mark.slow
GLASS = {"type": "dielectric"}
EVEN = np.ones((16, 32, 3), dtype=np.float32)


def glass() -> dict[str, Any]:
    """A glass ball before the map and the floor."""
    description = scene_dict("diffuse")
    description["ball"]["bsdf"] = GLASS
    return description


def leaves() -> dict[str, Any]:
    """A ball behind, under and beside leaves that are half there and full of holes, and reflect."""
    holes = {"type": "checkerboard", "color0": 0.1, "color1": 0.9, "to_uv": mi.ScalarTransform4f().scale(4)}
    description = scene_dict("diffuse")
    places = (
        (holes, mi.ScalarTransform4f().translate([0.4, 0.9, 1.4]).rotate([1, 1, 0], 40)),
        (0.4, mi.ScalarTransform4f().translate([0, 1.6, 0]).rotate([1, 0, 0], -80)),
    )
    for k, (opacity, place) in enumerate(places):
        white = {"type": "twosided", "covers": {"type": "diffuse", "reflectance": 0.7}}
        bsdf = {"type": "mask", "opacity": opacity, "covers": white}
        description[f"leaf{k}"] = {"type": "rectangle", "to_world": place, "bsdf": bsdf}
    return description


def pane() -> dict[str, Any]:
    """A pane of thin glass before the scene."""
    description = scene_dict("diffuse")
    place = mi.ScalarTransform4f().translate([0.7, 0.8, 2.5]).scale([1, 0.6, 1])
    description["pane"] = {"type": "rectangle", "to_world": place, "bsdf": {"type": "thindielectric"}}
    return description


def instances() -> dict[str, Any]:
    group = {"type": "shapegroup", "thing": {"type": "sphere", "bsdf": MATERIALS["roughplastic"]}}
    copy = {
        "type": "instance",
        "to_world": mi.ScalarTransform4f().translate([1.5, 1, 0]).scale(0.6),
        "of": {"type": "ref", "id": "group"},
    }
    return scene_dict("diffuse", group=group, copy=copy)


def constant() -> dict[str, Any]:
    """An environment that is no image, and a lamp."""
    return scene_dict("roughplastic", lamp=lamp()) | {"sky": {"type": "constant", "radiance": 0.4}}


def point() -> dict[str, Any]:
    return scene_dict("diffuse", spot={"type": "point", "position": [0, 3, 3], "intensity": 9.0})


def room() -> dict[str, Any]:
    """What is inside is lit by what walls reflect."""
    description = scene_dict("diffuse", lamp=lamp())
    description["sky"]["scale"] = 3.0
    wall = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.8, 0.7, 0.5]}}}
    for k, place in enumerate(([1, 0, 0], [-1, 0, 0], [0, 0, -1])):
        turn = mi.ScalarTransform4f().look_at([3 * x for x in place], [0, 0, 0], [0, 1, 0])
        description[f"wall{k}"] = {"type": "rectangle", "to_world": turn.scale(3), "bsdf": wall}
    return description


def hidden() -> dict[str, Any]:
    """A lamp before two cubes. (Behind one, Mitsuba's ``path`` takes spheres and rectangles to be somewhere else.)"""
    described = scene_dict("roughplastic")
    place = mi.ScalarTransform4f().translate([0.7, 0.6, 2]).scale(0.5)
    described["ball"] |= {"type": "cube", "to_world": mi.ScalarTransform4f().rotate([1, 1, 0], 30).scale(0.7)}
    del described["floor"]
    return described | {"lamp": {**lamp(), "to_world": place}}


SCENES = {
    **{name: lambda name=name: scene_dict(name) for name in MATERIALS},
    **{made.__name__: made for made in (glass, leaves, pane, instances, constant, point, room, hidden)},
    "sun": lambda: scene_dict("roughplastic", sun_map()),
    "lamp": lambda: scene_dict("roughplastic", lamp=lamp()),
    "caustics": lambda: scene_dict("plastic", lamp=lamp()),
}


@cache
def reference(variant: str, name: str, properties: tuple[tuple[str, Any], ...]) -> NDArray[Any]:
    """Of a constant sky, in four parts each: Mitsuba's sums of 1024 numbers alike are off by one part in 80,000."""
    description = SCENES[name]()
    parts = 4 if name == "constant" else 1
    spp = 1024 // parts
    description["sensor"]["sampler"] = {"type": "multijitter", "sample_count": spp}
    images = runs(mi.load_dict(description), {"type": "path", **dict(properties)}, spp, RUNS * parts, seed=20_000)
    return images.reshape(RUNS, parts, *images.shape[1:]).mean(axis=1)


def compare(name: str, spp: int = 64, more: int = 1, **properties: Any) -> None:
    """``more`` renders in place of each of the usual ones, with as many samples less; of many samples, sums in single
    precision are off by more than the noise of what the camera sees of the map."""
    more = max(more, spp // 256)
    lit = mi.load_dict(SCENES[name]())
    images = runs(lit, {"type": "path_stratified", **properties}, spp // more, RUNS * more, 0)
    theirs = reference(mi.variant(), name, tuple(properties.items()))
    assert_same_mean(images.reshape(RUNS, more, *images.shape[1:]).mean(axis=1), theirs)


MORE = {
    "mirror": 2048,
    "roughconductor": 256,
    "glass": 256,
    "caustics": 4096,
    "plastic": 256,
    "roughplastic": 512,
    "constant": 512,
}
"""Samples per pixel where light comes in rare events."""
CASES = [
    ("diffuse", 3, ()),
    ("diffuse", 8, SLOW),
    ("diffuse", -1, SLOW),
    ("roughplastic", 8, SLOW),
    ("roughconductor", 3, SLOW),
    ("roughconductor", 8, SLOW),
    ("plastic", 8, SLOW),
    ("mirror", 3, SLOW),
    ("mirror", -1, SLOW),
    ("glass", 3, SLOW),
    ("glass", 8, ()),
    ("leaves", -1, ()),
    ("pane", -1, SLOW),
    ("instances", 8, SLOW),
    ("constant", 8, SLOW),
    ("point", 8, SLOW),
    ("room", 3, SLOW),
    ("room", -1, SLOW),
    ("sun", 8, SLOW),
    ("lamp", 8, SLOW),
    ("caustics", 8, SLOW),
]


@pytest.mark.parametrize(("name", "depth"), [pytest.param(n, d, marks=m) for n, d, m in CASES])
def test_same_mean_as_path(name: str, depth: int) -> None:
    compare(name, MORE.get(name, 64), max_depth=depth)


@SLOW
@pytest.mark.parametrize("rr_depth", [1, 2])
def test_paths_that_end_at_random(rr_depth: int) -> None:
    compare("diffuse", 128, max_depth=-1, rr_depth=rr_depth)


@SLOW
@pytest.mark.parametrize("depth", [3, 8])
def test_hidden_lights(depth: int) -> None:
    compare("hidden", 64, max_depth=depth, hide_emitters=True)


@SLOW
@pytest.mark.parametrize("spp", [1, 3])
def test_few_samples(spp: int) -> None:
    compare("diffuse", 26 * spp, 26, max_depth=8)


@SLOW
@pytest.mark.parametrize("variant", [MONO, SPECTRAL])
@pytest.mark.parametrize("name", ["roughplastic", "lamp"])
def test_other_variants(name: str, variant: str) -> None:
    mi.set_variant(variant)
    compare(name, MORE.get(name, 64), max_depth=8)


@SLOW
def test_more_samples_of_the_map_on_gloss(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stratalux.integrators.indirect.vertex.DETAIL", 1)
    compare("roughconductor", MORE["roughconductor"], max_depth=3)


def test_launches_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", 24 * 18 * 12)
    compare("diffuse", max_depth=3)


def test_one_segment_more_than_direct_light_is_left_out_at_depth_2() -> None:
    lit = mi.load_dict(scene_dict("roughplastic"))
    ours = runs(lit, {"type": "path_stratified", "max_depth": 2}, 4, 2, 0)
    np.testing.assert_allclose(ours, runs(lit, {"type": "direct_stratified"}, 4, 2, 0), rtol=1e-4, atol=1e-5)


def furnace(bsdf: dict[str, Any]) -> mi.Scene:
    """White things in a world that is 1 everywhere: nothing can be seen of them."""
    description = scene_dict("diffuse", EVEN)
    for name in ("ball", "box", "floor"):
        description[name]["bsdf"] = {"type": "twosided", "of": bsdf}
    description["sky"]["scale"] = 1.0
    return mi.load_dict(description)


@pytest.mark.parametrize(
    "bsdf",
    [
        {"type": "diffuse", "reflectance": 1.0},
        pytest.param({"type": "conductor"}, marks=SLOW),
        pytest.param({"type": "blendbsdf", "weight": 0.4, "a": {"type": "diffuse", "reflectance": 1.0},
                      "b": {"type": "diffuse", "reflectance": 1.0}}, marks=SLOW),
    ],
    ids=["white", "mirror", "blend"],
)  # fmt: skip
def test_a_white_furnace(bsdf: dict[str, Any]) -> None:
    images = runs(furnace(bsdf), {"type": "path_stratified"}, 64, RUNS, 0)
    assert np.isfinite(images).all()
    blocks = images.mean(axis=3).reshape(RUNS, 3, 4, 3, 6).mean(axis=(2, 4)).reshape(RUNS, -1)  # of 24 pixels
    noisy = blocks.std(axis=0) > 1e-5
    assert blocks[:, ~noisy] == pytest.approx(1, abs=1e-4)
    if noisy.any():
        means = np.concatenate([blocks[:, noisy], blocks.mean(axis=1, keepdims=True)], axis=1)
        assert stats.ttest_1samp(means, 1, axis=0).pvalue.min() > sidak(means.shape[1])
        assert abs(means.mean() - 1) < 0.002


def inside(kind: str, bsdf: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Within a closed thing, and a map around it."""
    described = scene_dict("diffuse", size=(6, 4))
    T = mi.ScalarTransform4f
    around = {"type": kind, "flip_normals": True, "bsdf": bsdf, **more}
    sensor = {**described["sensor"], "to_world": T().look_at([0.2, 0.1, 0], [1, 0.3, 0.4], [0, 1, 0])}
    return {"type": "scene", "around": around, "sensor": sensor, "sky": described["sky"]}


def assert_means(images: NDArray[Any], expected: NDArray[Any]) -> None:
    """Student's t-test of the means of the channels of images, at the level of all three."""
    means = images.mean(axis=(1, 2))
    error = means.std(axis=0, ddof=1) / np.sqrt(len(means))
    assert (error < 0.02 * expected).all()
    assert stats.ttest_1samp(means, expected, axis=0).pvalue.min() > sidak(3)


@pytest.mark.parametrize(("depth", "rr_depth"), [(-1, 5), (4, 1), pytest.param(3, 5, marks=SLOW)])
def test_light_within_a_ball_of_leaves(depth: int, rr_depth: int) -> None:
    """What is scattered once within a matte ball lights all of it alike. So of a map with the mean L̄, beyond direct
    light, there is (1 − o) L̄ Σ_k≥2 (o a)ᵏ with an opacity of o and an albedo of a."""
    a, opacity = np.array([0.9, 0.6, 0.4]), 0.7
    leaf = {"type": "twosided", "of": {"type": "diffuse", "reflectance": {"type": "rgb", "value": a.tolist()}}}
    described = inside("sphere", {"type": "mask", "opacity": opacity, "inside": leaf})
    texels = hall_map()
    mean = 0.5 * EnvironmentMap(texels).texels.reshape(-1, 3).T.astype(np.float64) @ weights(texels)
    scatterings = np.arange(2, 200 if depth < 0 else depth)
    expected = (1 - opacity) * mean * ((opacity * a) ** scatterings[:, None]).sum(axis=0)
    scene = mi.load_dict(described)
    whole = runs(scene, {"type": "path_stratified", "max_depth": depth, "rr_depth": rr_depth}, 128, RUNS, 0)
    direct = runs(scene, {"type": "direct_stratified"}, 512, RUNS, 1000)
    assert_means(whole - direct, expected)


def test_light_of_a_lamp_around_a_ball_of_leaves() -> None:
    """With direct light: (1 − o) e Σ (o a)ᵏ."""
    a, e, opacity = np.array([0.9, 0.6, 0.4]), np.array([1.0, 2.0, 3.0]), 0.7
    leaf = {"type": "twosided", "of": {"type": "diffuse", "reflectance": {"type": "rgb", "value": a.tolist()}}}
    described = inside("sphere", {"type": "mask", "opacity": opacity, "inside": leaf})
    described["lamp"] = {
        "type": "cube",
        "flip_normals": True,
        "to_world": mi.ScalarTransform4f().scale(3),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": e.tolist()}},
    }
    images = runs(mi.load_dict(described), {"type": "path_stratified", "max_depth": 4, "rr_depth": 1}, 64, RUNS, 0)
    assert_means(images, (1 - opacity) * e * ((opacity * a) ** np.arange(4)[:, None]).sum(axis=0))


def weights(texels: NDArray[Any]) -> NDArray[np.float64]:
    """Of texels in the mean over all directions, by Mitsuba's lookup: linear between rows."""
    height, width = texels.shape[:2]
    theta = (np.arange(400 * (height - 1)) + 0.5) / (400 * (height - 1)) * np.pi
    row = theta / np.pi * (height - 1)
    low = row.astype(int)
    sine = np.sin(theta) / np.sin(theta).sum()
    rows = np.bincount(low, sine * (1 - row + low), height) + np.bincount(low + 1, sine * (row - low), height)
    return np.repeat(rows / width, width)


@pytest.mark.parametrize("depth", [-1, pytest.param(4, marks=SLOW)])
def test_light_of_walls_that_shine(depth: int) -> None:
    """On each other, e Σ aᵏ; of the map, nothing. (They are even: of points on a ball that shines, Mitsuba takes some
    to be within it and some not.)"""
    a, e = np.array([0.6, 0.4, 0.2]), np.array([1.0, 2.0, 3.0])
    bsdf = {"type": "diffuse", "reflectance": {"type": "rgb", "value": a.tolist()}}
    emitter = {"type": "area", "radiance": {"type": "rgb", "value": e.tolist()}}
    scene = mi.load_dict(inside("cube", bsdf, emitter=emitter))
    images = runs(scene, {"type": "path_stratified", "max_depth": depth, "rr_depth": 2}, 64, RUNS, 0)
    expected = e * (a ** np.arange(100 if depth < 0 else depth)[:, None]).sum(axis=0)
    assert_means(images, expected)
