"""The mean image of ``direct_stratified`` against that of Mitsuba's ``direct``: no bias in any pixel or channel."""

from __future__ import annotations

from itertools import product
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import assert_same_mean, asset, direct, lamp, reference, runs, scene_dict, sun_map
from tests.variants import MONO, SPECTRAL

RUNS = 32
SLOW = pytest.mark.slow


def stratified(strata: int, proposals: int = 1, **more: Any) -> dict[str, Any]:
    return {"type": "direct_stratified", "strata": strata, "proposals": proposals, **more}


def spp_for(strata: int, proposals: int) -> int:
    """About equal work for each test; enough for the mean of a run to be nearly normal."""
    return {1: 512, 16: 128}.get(strata, 64) // (2 if proposals > 1 else 1)


def case(material: str, strata: int, proposals: int) -> Any:
    quick = material != "roughconductor" and strata in (1, 37)
    return pytest.param(material, strata, proposals, marks=() if quick else SLOW)


@pytest.mark.parametrize(
    ("material", "strata", "proposals"),
    [case(*args) for args in product(("diffuse", "roughplastic", "roughconductor"), (1, 16, 37, 64), (1, 8))],
)
def test_same_mean_as_direct(material: str, strata: int, proposals: int) -> None:
    scene = mi.load_dict(scene_dict(material))
    # The dark pixels of a conductor get their light from few directions, which the samples of a run have in common.
    more, count = (2, 8 * RUNS) if material == "roughconductor" else (1, RUNS)
    spp = spp_for(strata, proposals) // more
    assert_same_mean(runs(scene, stratified(strata, proposals), spp, count, seed=0), reference(material))


def test_the_test_has_teeth() -> None:
    """Light that is 1 % too bright in one channel is noticed."""
    images = runs(mi.load_dict(scene_dict("diffuse")), stratified(16), 128, RUNS, seed=0)
    images[..., 2] *= 1.01
    with pytest.raises(AssertionError):
        assert_same_mean(images, reference("diffuse"))


@pytest.mark.parametrize("material", ["plastic", "mirror"])
def test_delta_lobes(material: str) -> None:
    scene = mi.load_dict(scene_dict(material))
    assert_same_mean(runs(scene, stratified(16, 4), 128, RUNS, 0), reference(material))


@pytest.mark.parametrize("material", ["diffuse", *(pytest.param(m, marks=SLOW) for m in ("plastic", "roughconductor"))])
def test_with_an_area_light(material: str) -> None:
    scene = mi.load_dict(scene_dict(material, lamp=lamp()))
    assert_same_mean(runs(scene, stratified(16, 4), 128, RUNS, 0), reference(material, lit_by_lamp=True))


@pytest.mark.slow
def test_with_a_point_light_and_hidden_emitters() -> None:
    spot = {"type": "point", "position": [1, 3, 2], "intensity": {"type": "rgb", "value": [2, 3, 4]}}
    description = scene_dict("roughplastic", lamp=lamp(), spot=spot)
    ours = runs(mi.load_dict(description), stratified(16, hide_emitters=True), 128, RUNS, 0)
    # With several samples of emitters, Mitsuba's own is wrong about lights that only they can hit.
    assert_same_mean(ours, direct(description, emitter_samples=1, hide_emitters=True))


@pytest.mark.parametrize("sky", [None, {"type": "constant", "radiance": {"type": "rgb", "value": [0.3, 0.2, 0.5]}}])
def test_without_an_environment_map(sky: dict[str, Any] | None) -> None:
    description = scene_dict("roughplastic", lamp=lamp())
    del description["sky"]
    if sky:
        description["sky"] = sky
    assert_same_mean(runs(mi.load_dict(description), stratified(16), 128, RUNS, 0), direct(description, 256))


def test_a_sun() -> None:
    description = scene_dict("diffuse", sun_map())
    # All samples of a run have their points of the sun in common: pixels that see a sliver of it need many runs.
    ours = runs(mi.load_dict(description), stratified(37, 4), 16, 6 * RUNS, 0)
    assert_same_mean(ours, direct(description))


@pytest.mark.parametrize("variant", [pytest.param(MONO, marks=SLOW), SPECTRAL])
def test_other_variants(variant: str) -> None:
    mi.set_variant(variant)
    scene = mi.load_dict(scene_dict("roughplastic"))
    assert_same_mean(runs(scene, stratified(16, 4), 64, RUNS, 0), direct(scene_dict("roughplastic"), 256))


@pytest.mark.parametrize("sampler", ["multijitter", "stratified", "orthogonal"])
def test_stratified_samplers(sampler: str) -> None:
    """Seeds change the scrambling of these samplers, so runs stay independent."""
    description = scene_dict("diffuse")
    description["sensor"]["sampler"] = {"type": sampler, "sample_count": 64}
    scene = mi.load_dict(description)
    assert_same_mean(runs(scene, stratified(16, 2), 64, RUNS, 0), reference("diffuse"))


@pytest.mark.slow
@pytest.mark.parametrize("strata", [16, 64])
@pytest.mark.parametrize("name", ["grace_latlong.exr", "venice.hdr", "sky.hdr", "night.hdr", "studio.hdr"])
def test_real_maps(name: str, strata: int) -> None:
    texels = np.array(
        mi.Bitmap(str(asset(f"envmaps/{name}"))).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32)
    )
    description = scene_dict("roughplastic", texels)
    ours = runs(mi.load_dict(description), stratified(strata, 4), 4096 // strata, RUNS, 0)
    assert_same_mean(ours, direct(description, 4096, emitter_samples=4, bsdf_samples=2))
