"""Light through masks: no bias against Mitsuba's ``path``, where nothing is reflected twice."""

from __future__ import annotations

from functools import cache
from typing import Any

import mitsuba as mi
import pytest
from numpy.typing import NDArray

from stratalux.integrators.straight import LAYERS
from tests.helpers import MATERIALS, assert_same_mean, runs, scene_dict

RUNS = 32
OURS = {
    "automatic": ({"type": "direct_stratified"}, 64),
    "pinned": ({"type": "direct_stratified", "strata": 8, "proposals": 2, "bsdf_samples": 1}, 128),
    "importance": ({"type": "direct_importance", "samples": 8, "proposals": 16, "bsdf_samples": 1}, 128),
    "wavelet": ({"type": "direct_wavelet", "samples": 16, "resolution": 8}, 128),
}


def scene(material: str) -> dict[str, Any]:
    """A ball behind, under and beside leaves that are black, half there and full of holes."""
    T = mi.ScalarTransform4f
    holes = {"type": "checkerboard", "color0": 0.1, "color1": 0.9, "to_uv": T().scale(4)}
    described = scene_dict(material)
    del described["box"], described["floor"]
    black = {"type": "diffuse", "reflectance": 0.0}
    for k, (opacity, place) in enumerate(
        (
            (holes, T().translate([0.4, 0.9, 1.4]).rotate([1, 1, 0], 40)),
            (0.4, T().translate([0, 1.6, 0]).rotate([1, 0, 0], -80)),
            (holes, T().translate([-1.6, 0, 0]).rotate([0, 1, 0], 70).scale(2)),
        )
    ):
        leaf = {"type": "mask", "opacity": opacity, "covers": black}
        described[f"leaf{k}"] = {"type": "rectangle", "to_world": place, "bsdf": leaf}
    return described


@cache
def reference(material: str) -> NDArray[Any]:
    described = scene(material)
    described["sensor"]["sampler"] = {"type": "multijitter", "sample_count": 2048}
    path = {"type": "path", "max_depth": LAYERS, "rr_depth": LAYERS}
    return runs(mi.load_dict(described), path, 2048, RUNS, seed=20_000)


@pytest.mark.parametrize("name", ["automatic", *(pytest.param(n, marks=pytest.mark.slow) for n in list(OURS)[1:])])
@pytest.mark.parametrize("material", ["diffuse", pytest.param("roughplastic", marks=pytest.mark.slow)])
def test_same_mean_as_path(material: str, name: str) -> None:
    assert material in MATERIALS
    ours, spp = OURS[name]
    assert_same_mean(runs(mi.load_dict(scene(material)), ours, spp, RUNS, 0), reference(material))
