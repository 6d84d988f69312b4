"""Light paths beside those from the camera: the mean image of Mitsuba's ``path``, in fewer samples."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from itertools import islice
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux.integrators.sums import UNLIMITED
from tests.helpers import assert_same_mean, lamp, runs, scene_dict, set_few
from tests.variants import MONO

RUNS = 32
SLOW = pytest.mark.slow
METAL = {"type": "roughconductor", "alpha": 0.25, "material": "Al"}


def lamps() -> NDArray[np.float32]:
    """Two in a dim hall, each a thousandth of the sphere."""
    texels = 0.03 + 0.04 * np.random.default_rng(5).random((32, 64, 3))
    texels[6:8, 20:22] = [90, 60, 30]
    texels[9:11, 47:49] = [20, 40, 70]
    return texels.astype(np.float32)


def metal(bsdf: dict[str, Any] = METAL) -> dict[str, Any]:
    """A ball and a leaning box on a matte floor."""
    description = scene_dict("diffuse", lamps())
    description["ball"]["bsdf"] = bsdf
    return description


def bumpy() -> dict[str, Any]:
    """A direction that such a BSDF draws is not always one that it draws the other way round."""
    tilts = 0.5 + 0.3 * np.random.default_rng(6).standard_normal((8, 16, 2))
    normals = np.concatenate([tilts, np.ones((8, 16, 1))], axis=2).astype(np.float32)
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(normals), "raw": True}
    return metal({"type": "normalmap", "normalmap": texture, "of": METAL})


def rough_glass() -> dict[str, Any]:
    return metal({"type": "roughdielectric", "alpha": 0.3})


def layered() -> dict[str, Any]:
    """Beside something whose densities are not known to be alike both ways."""
    description = metal()
    description["floor"]["bsdf"] = {"type": "principled", "base_color": 0.6, "roughness": 0.4, "specular": 0.6}
    return description


def lens() -> dict[str, Any]:
    description = metal()
    description["sensor"] |= {"type": "thinlens", "aperture_radius": 0.2, "focus_distance": 4.0}
    return description


def filtered() -> dict[str, Any]:
    """Up to the edges of a part of the film."""
    description = metal()
    film = {"rfilter": {"type": "gaussian"}, "crop_offset_x": 3, "crop_offset_y": 2, "crop_width": 9, "crop_height": 7}
    description["sensor"]["film"] |= film
    return description


def mixed() -> dict[str, Any]:
    """A mirror and a lamp among what light paths meet."""
    description = metal()
    description["box"]["bsdf"] = {"type": "conductor"}
    description["lamp"] = lamp()
    return description


SCENES: dict[str, Callable[[], dict[str, Any]]] = {
    "metal": metal,
    "bumpy": bumpy,
    "rough glass": rough_glass,
    "layered": layered,
    "lens": lens,
    "filtered": filtered,
    "mixed": mixed,
}


@cache
def reference(variant: str, name: str, depth: int) -> NDArray[Any]:
    scene = SCENES[name]()
    scene["sensor"]["sampler"] = {"type": "multijitter", "sample_count": 2048}
    return runs(mi.load_dict(scene), {"type": "path", "max_depth": depth}, 2048, RUNS, 10_000)


@pytest.fixture(params=["in one", "apart"])
def kind(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    few = 1 << 30 if request.param == "in one" else 0
    set_few(monkeypatch, few)
    return str(request.param)


def _has_light_paths(integrator: mi.Integrator) -> bool:
    return any(name.startswith("light") for name in integrator.work)


CASES = [
    ("metal", 3, ()),
    ("metal", 8, SLOW),
    ("metal", -1, SLOW),
    ("bumpy", 8, ()),
    ("rough glass", 8, SLOW),
    ("layered", 4, SLOW),
    ("lens", 3, SLOW),
    ("filtered", 3, ()),
    ("mixed", 8, SLOW),
]


@pytest.mark.parametrize(("name", "depth"), [pytest.param(n, d, marks=m) for n, d, m in CASES])
def test_same_mean_as_path(kind: str, name: str, depth: int) -> None:
    integrator = mi.load_dict({"type": "path_stratified", "max_depth": depth})
    ours = runs(mi.load_dict(SCENES[name]()), integrator, 64, RUNS, 0)
    assert _has_light_paths(integrator)
    assert_same_mean(ours, reference(mi.variant(), name, depth))


@SLOW
def test_in_several_launches(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", 18 * 12 * 9)
    ours = runs(mi.load_dict(metal()), {"type": "path_stratified", "max_depth": 3}, 64, RUNS, 0)
    assert_same_mean(ours, reference(mi.variant(), "metal", 3))


@SLOW
def test_paths_that_end_at_random(kind: str) -> None:
    ours = runs(mi.load_dict(metal()), {"type": "path_stratified", "rr_depth": 1}, 128, RUNS, 0)
    assert_same_mean(ours, reference(mi.variant(), "metal", -1))


@SLOW
def test_in_grey(kind: str) -> None:
    mi.set_variant(MONO)
    ours = runs(mi.load_dict(metal()), {"type": "path_stratified", "max_depth": 8}, 64, RUNS, 0)
    assert_same_mean(ours, reference(MONO, "metal", 8))


def test_they_make_less_noise(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Less than 0.6 of the variance, where 0.4 was measured: a polished ball throws the light of lamps on the floor."""
    description = metal({**METAL, "alpha": 0.05})
    description["sensor"]["film"] |= {"width": 48, "height": 32}
    scene = mi.load_dict(description)
    found = {}
    for concentrated in (20.0, 1e9):
        monkeypatch.setattr("stratalux.integrators.path_stratified._CONCENTRATED", concentrated)
        integrator = mi.load_dict({"type": "path_stratified", "max_depth": 4})
        images = runs(scene, integrator, 16, 24, 0)
        found[concentrated] = (images.var(axis=0) / images.mean(axis=0) ** 2).mean()
        assert _has_light_paths(integrator) == (concentrated < 1e9)
    assert found[20.0] < 0.6 * found[1e9]


@SLOW
def test_as_many_as_there_is_time_for(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nobody says how many samples there will be, all parts go on side by side."""
    if kind == "in one":
        pytest.skip("few samples are a known number")
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", 18 * 12 * 16)
    scene, images = mi.load_dict(metal()), []
    integrator = mi.load_dict({"type": "path_stratified", "max_depth": 3})
    for seed in range(RUNS):
        passes = integrator.passes(scene, scene.sensors()[0], seed, UNLIMITED)
        *_, (raw, _, _) = islice(passes, 40)
        images.append(raw[..., :3] / raw[..., -1:])
    done = {name.partition("/")[0]: samples for name, (samples, _) in integrator.work.items()}
    assert 0 < done["light"] < done["paths"]
    assert_same_mean(np.stack(images).astype(np.float64), reference(mi.variant(), "metal", 3))


def plain(material: str) -> dict[str, Any]:
    return scene_dict(material, lamps())


def even() -> dict[str, Any]:
    return scene_dict("roughconductor", np.ones((16, 32, 3), dtype=np.float32))


def far() -> dict[str, Any]:
    description = metal()
    del description["sensor"]["fov"]
    description["sensor"] |= {"type": "orthographic"}
    return description


def masked() -> dict[str, Any]:
    description = metal()
    description["box"]["bsdf"] = {"type": "mask", "opacity": 0.5, "of": METAL}
    return description


@pytest.mark.parametrize(
    ("described", "used"),
    [
        (metal, True),
        (partial(plain, "diffuse"), False),
        (partial(plain, "mirror"), False),
        (partial(plain, "roughplastic"), False),
        (even, False),
        (far, False),
        (masked, False),
    ],
    ids=["lamps on metal", "matte", "mirror", "plastic", "even map", "no point of view", "masks"],
)
def test_where_they_are_used(described: Callable[[], dict[str, Any]], used: bool) -> None:
    integrator = mi.load_dict({"type": "path_stratified"})
    mi.render(mi.load_dict(described()), integrator=integrator, spp=8)
    assert _has_light_paths(integrator) == used
