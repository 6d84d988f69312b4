"""The whole light in one, as for a few samples: the mean image of Mitsuba's ``path``, and what is known without it."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import assert_same_mean, runs, scene_dict, set_few, sun_map
from tests.statistics.test_path import EVEN, MORE, SCENES, SLOW, furnace, glass, reference
from tests.variants import MONO

RUNS = 32
SPOTS = (
    np.where(np.random.default_rng(4).random((64, 128, 1)) < 0.005, 100.0, 0.01).repeat(3, axis=2).astype(np.float32)
)
"""What a polished metal shows many of."""


@pytest.fixture(autouse=True)
def _always(monkeypatch: pytest.MonkeyPatch) -> None:
    set_few(monkeypatch, 1 << 30)
    monkeypatch.setattr("stratalux.integrators.indirect.whole.PLANNED", 0)


def render(name: str, spp: int, **properties: Any) -> Any:
    """A quarter of the samples, as each stands for four."""
    return runs(mi.load_dict(SCENES[name]()), {"type": "path_stratified", **properties}, spp // 4, RUNS, 0)


def black() -> dict[str, Any]:
    """Light from one side alone."""
    texels = EVEN.copy()
    texels[:, : texels.shape[1] // 2] = 0
    return scene_dict("roughplastic", texels)


CASES = [
    ("diffuse", 2, SLOW),
    ("diffuse", 3, ()),
    ("diffuse", -1, SLOW),
    ("roughplastic", 8, ()),
    ("roughconductor", 8, SLOW),
    ("plastic", 8, SLOW),
    ("mirror", 3, SLOW),
    ("glass", 8, ()),
    ("instances", 8, SLOW),
    ("point", 8, SLOW),
    ("room", -1, SLOW),
    ("sun", 8, ()),
    ("lamp", 8, SLOW),
    ("caustics", 8, SLOW),
]


@pytest.mark.parametrize(("name", "depth"), [pytest.param(n, d, marks=m) for n, d, m in CASES])
def test_same_mean_as_path(name: str, depth: int) -> None:
    spp = min(MORE.get(name, 64), 1024)
    assert_same_mean(render(name, spp, max_depth=depth), reference(mi.variant(), name, (("max_depth", depth),)))


@SLOW
def test_paths_that_end_at_random() -> None:
    properties = {"max_depth": -1, "rr_depth": 1}
    assert_same_mean(
        render("diffuse", 128, **properties), reference(mi.variant(), "diffuse", tuple(properties.items()))
    )


@pytest.mark.parametrize("name", ["roughplastic", "sun", "black"])
def test_nothing_is_planned(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of the last map is black: there, samples of it bring nothing but what is left to those of the BSDF."""
    monkeypatch.setattr("stratalux.integrators.indirect.whole.PLANNED", 1 << 30)
    monkeypatch.setattr("stratalux.integrators.indirect.whole._LEVEL", 4.0)
    SCENES.setdefault("black", black)
    assert_same_mean(render(name, 256, max_depth=4), reference(mi.variant(), name, (("max_depth", 4),)))


def test_in_several_launches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", 18 * 12 * 9)
    assert_same_mean(render("diffuse", 64, max_depth=3), reference(mi.variant(), "diffuse", (("max_depth", 3),)))


@SLOW
def test_in_grey() -> None:
    mi.set_variant(MONO)
    assert_same_mean(render("roughplastic", 512, max_depth=8), reference(MONO, "roughplastic", (("max_depth", 8),)))


@pytest.mark.parametrize(
    "bsdf", [{"type": "diffuse", "reflectance": 1.0}, {"type": "conductor"}], ids=["white", "mirror"]
)
def test_a_white_furnace(bsdf: dict[str, Any]) -> None:
    """The map is nowhere brighter than its mean: all of its light is found by samples of the BSDF."""
    images = runs(furnace(bsdf), {"type": "path_stratified", "rr_depth": 1000}, 8, 2, 0)
    # A path in a thousand leaks where things touch, or stays there.
    assert (np.abs(images - 1) < 1e-4).mean() > 0.99 and images.mean() == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("hidden", [False, True])
def test_what_is_behind(hidden: bool) -> None:
    described = glass()
    described["sensor"]["film"]["pixel_format"] = "rgba"
    scene = mi.load_dict(described)
    properties = {"max_depth": 3, "hide_emitters": hidden}
    ours, theirs = (
        np.array(mi.render(scene, integrator=mi.load_dict({"type": name, **properties}), spp=256))
        for name in ("path_stratified", "path")
    )
    np.testing.assert_allclose(ours[..., 3], theirs[..., 3], atol=0.15)  # of 256 samples, in 216 pixels
    assert ours[..., 3].mean() == pytest.approx(theirs[..., 3].mean(), abs=0.01)
    behind = ours[..., 3] == 0
    assert behind.any() is np.bool_(hidden)
    np.testing.assert_array_equal(ours[behind], 0)


@pytest.mark.parametrize(
    ("texels", "material", "expected"),
    [
        (sun_map(), "diffuse", "FEW_IN_THE_SUN"),
        (None, "roughplastic", "FEW"),
        (EVEN, "diffuse", "FEW_MATTE"),
        (SPOTS, "roughconductor", "FEW_DETAILED"),
    ],
    ids=["sun", "gloss", "matte", "detail"],
)
def test_how_few_they_are(texels: Any, material: str, expected: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from stratalux.integrators.automatic.sample import AllocatedLight  # of the active variant
    from stratalux.integrators.environment import MapCache
    from stratalux.integrators.indirect import whole
    from stratalux.sampling.leaf_sampler import BrightLeafSampler

    scene = mi.load_dict(scene_dict(material, texels))
    integrator = mi.load_dict({"type": "path_stratified"})
    light = MapCache(BrightLeafSampler).get(scene)
    assert light is not None
    bright = AllocatedLight(light, integrator.prepare(scene).allocation)
    monkeypatch.setattr(whole, expected, 77)
    assert whole.few(bright, 1) == whole.few(bright, whole.USUAL) == 77
    # In more pixels, plans pay that are made of those around.
    assert whole.few(bright, 4 * whole.USUAL) == (38 if expected == "FEW" else 77)
    assert whole.few(bright, 1 << 24) == (whole.FEW_IN_MANY if expected == "FEW" else 77)


@pytest.mark.parametrize(("texels", "planned"), [(None, True), (sun_map(), False)])
def test_what_is_planned(texels: Any, planned: bool) -> None:
    """A quarter of the camera samples is the pilot, where there are enough; under a sun, where light paths find its
    glints, and there are more of them."""
    from stratalux.integrators.environment import MapCache  # of the active variant
    from stratalux.integrators.indirect.whole import pilot_whole
    from stratalux.sampling.leaf_sampler import BrightLeafSampler

    light = MapCache(BrightLeafSampler).get(mi.load_dict(scene_dict("diffuse", texels)))
    assert pilot_whole(light, 16, 1, False) == (16 if planned else 64)  # type: ignore[arg-type]
    assert pilot_whole(light, 23, 1, True) == (16 if planned else 92)  # type: ignore[arg-type]
    assert pilot_whole(light, 32, 1, True) == 32  # type: ignore[arg-type]
    assert pilot_whole(light, 32, 1, False) == (32 if planned else 128)  # type: ignore[arg-type]
    assert pilot_whole(light, 3, 1 << 30, True) == 12  # type: ignore[arg-type]


def test_another_kind_of_map() -> None:
    """A picture does not depend on those before it: here, of a sun in place of a hall."""
    scene = mi.load_dict(scene_dict("roughplastic"))
    integrator = mi.load_dict({"type": "path_stratified"})
    mi.render(scene, integrator=integrator, spp=2, seed=1)
    params = mi.traverse(scene)
    # With the halo columns of Mitsuba's own
    params["sky.data"] = mi.traverse(mi.load_dict(scene_dict("roughplastic", sun_map(25, 47))))["sky.data"]
    params.update()
    other = mi.render(scene, integrator=integrator, spp=2, seed=1).numpy()
    fresh = mi.render(scene, integrator=mi.load_dict({"type": "path_stratified"}), spp=2, seed=1).numpy()
    np.testing.assert_array_equal(other, fresh)
