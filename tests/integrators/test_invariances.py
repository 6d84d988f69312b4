"""What must stay the same: pictures of maps and scenes that differ by something known."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.helpers import assert_same_mean, hall_map, runs, scene_dict
from tests.variants import RGB

AUTOMATIC = {"type": "direct_stratified"}
PINNED = {"type": "direct_stratified", "strata": 16, "proposals": 2, "bsdf_samples": 1}
IMPORTANCE = {"type": "direct_importance", "samples": 8, "proposals": 16, "bsdf_samples": 1}
mi.set_variant(RGB)
RUNS = 32
FLOOR = {
    "type": "rectangle",
    "to_world": mi.ScalarTransform4f().translate([0, -1, 0]).rotate([1, 0, 0], -90).scale(6),
    "bsdf": {"type": "diffuse", "reflectance": 0.5},
}
both = pytest.mark.parametrize(
    "ours", [AUTOMATIC, pytest.param(PINNED, marks=pytest.mark.slow)], ids=["automatic", "pinned"]
)


def picture(ours: dict[str, Any], description: dict[str, Any], spp: int = 16) -> NDArray[Any]:
    scene = mi.load_dict(description)
    return np.array(mi.render(scene, integrator=mi.load_dict(ours), spp=spp, seed=3)).astype(np.float64)


def assert_nearly_all_equal(a: NDArray[Any], b: NDArray[Any]) -> None:
    """But for rounding, which may change what a few rays are decided by."""
    far = (np.abs(a - b) > 1e-4 * (np.abs(b) + np.mean(b))).any(axis=-1)
    assert far.mean() < 0.02, f"{far.sum()} of {far.size} pixels differ"
    np.testing.assert_allclose(a.mean(axis=(0, 1)), b.mean(axis=(0, 1)), rtol=5e-3)


@pytest.mark.parametrize("ours", [AUTOMATIC, PINNED, IMPORTANCE], ids=["automatic", "pinned", "importance"])
@pytest.mark.parametrize(("where", "factor"), [("scale", 1024), ("scale", 1000), ("texels", 1000)])
def test_brighter(where: str, factor: float, ours: dict[str, Any]) -> None:
    """A power of two leaves every digit as it is, but for sums in another order."""
    plain, brighter = scene_dict("roughplastic"), scene_dict("roughplastic")
    if where == "scale":
        brighter["sky"]["scale"] *= factor
    else:
        brighter = scene_dict("roughplastic", hall_map() * np.float32(factor))
    a, b = picture(ours, brighter) / factor, picture(ours, plain)
    if factor == 1024:
        np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-7)
    else:
        assert_nearly_all_equal(a, b)


@pytest.mark.parametrize("ours", [AUTOMATIC, PINNED], ids=["automatic", "pinned"])
def test_map_objects_and_camera_turned_together(ours: dict[str, Any]) -> None:
    """By a quarter, which turns parts of the sphere to others."""
    description, turned = scene_dict("diffuse"), scene_dict("diffuse")
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], 90)
    for name in ("ball", "box", "floor", "sky", "sensor"):
        turned[name]["to_world"] = turn @ turned[name].get("to_world", mi.ScalarTransform4f())
    assert_nearly_all_equal(picture(ours, turned), picture(ours, description))


def refined(texels: NDArray[np.float32]) -> NDArray[np.float32]:
    """The same light from a grid with two rows for one and three columns for one, which has all of the old texels."""
    rows = np.empty((2 * len(texels) - 1, *texels.shape[1:]), dtype=np.float64)
    rows[::2], rows[1::2] = texels, (texels[1:] + texels[:-1].astype(np.float64)) / 2
    before, after = np.roll(rows, 1, axis=1), np.roll(rows, -1, axis=1)
    columns = np.stack([(before + 2 * rows) / 3, rows, (after + 2 * rows) / 3], axis=2)
    return columns.reshape(len(rows), -1, 3).astype(np.float32)


@both
def test_a_finer_grid(ours: dict[str, Any]) -> None:
    fine, coarse = (
        runs(mi.load_dict(scene_dict("roughplastic", texels)), ours, 16, RUNS, seed)
        for texels, seed in ((refined(hall_map()), 0), (hall_map(), 5000))
    )
    assert_same_mean(fine, coarse)


@both
def test_channels_swapped(ours: dict[str, Any]) -> None:
    """Samples follow the luminance, so the noise is another, and the mean alone has to be the same."""
    grey = {"ball": {"type": "sphere", "bsdf": {"type": "roughplastic", "alpha": 0.2}}, "floor": FLOOR}
    texels = hall_map()
    swapped, plain = (
        runs(mi.load_dict(scene_dict("diffuse", t) | grey), ours, 16, RUNS, seed)
        for t, seed in ((texels[..., ::-1].copy(), 0), (texels, 5000))
    )
    assert_same_mean(swapped[..., ::-1], plain)


@both
def test_the_sum_of_two_maps(ours: dict[str, Any]) -> None:
    a, b = hall_map(), np.roll(hall_map(), 17, axis=1)[::-1].copy()
    parts = [runs(mi.load_dict(scene_dict("roughplastic", t)), ours, 16, RUNS, s) for t, s in ((a, 5000), (b, 9000))]
    assert_same_mean(runs(mi.load_dict(scene_dict("roughplastic", a + b)), ours, 16, RUNS, 0), sum(parts))
