"""BSDFs made of others, or of several lobes: no bias with any of them."""

from __future__ import annotations

from functools import cache
from typing import Any

import mitsuba as mi
import pytest
from numpy.typing import NDArray

from stratalux.integrators.straight import LAYERS
from tests.helpers import assert_same_mean, direct, runs, scene_dict

RUNS = 32
AUTOMATIC = {"type": "direct_stratified"}
PINNED = {"type": "direct_stratified", "strata": 8, "bsdf_samples": 2}

GLOSSY = {"type": "roughplastic", "alpha": 0.2, "diffuse_reflectance": {"type": "rgb", "value": [0.5, 0.2, 0.1]}}
METAL = {"type": "roughconductor", "alpha": 0.3}
BSDFS: dict[str, dict[str, Any]] = {
    "cut-out plastic": {"type": "mask", "opacity": 0.6, "nested": GLOSSY},
    "cut-out metal": {"type": "mask", "opacity": 0.6, "nested": METAL},
    "blend": {"type": "blendbsdf", "weight": 0.4, "first": {"type": "diffuse"}, "second": METAL},
    "principled": {"type": "principled", "roughness": 0.4, "metallic": 0.3, "clearcoat": 0.5, "sheen": 0.3},
    "tilted": {"type": "normalmap", "normalmap": {"type": "rgb", "value": [0.6, 0.5, 0.9]}, "nested": GLOSSY},
}


def scene(name: str) -> dict[str, Any]:
    description = scene_dict("diffuse")
    description["ball"]["bsdf"] = BSDFS[name]
    if name.startswith("cut-out"):  # alone, as its reference knows what is reflected twice
        del description["floor"], description["box"]
    return description


@cache
def reference(name: str) -> NDArray[Any]:
    if name.startswith("cut-out"):  # direct ends at masks; a ball that is black inside reflects no light twice
        path = {"type": "path", "max_depth": LAYERS, "rr_depth": LAYERS}
        return runs(mi.load_dict(scene(name)), path, 2048, RUNS, seed=10_000)
    return direct(scene(name), 512, bsdf_samples=2)


@pytest.mark.parametrize("ours", [AUTOMATIC, PINNED], ids=["automatic", "pinned"])
@pytest.mark.parametrize(
    "name", ["cut-out plastic", *(pytest.param(name, marks=pytest.mark.slow) for name in list(BSDFS)[1:])]
)
def test_same_mean_as_direct(name: str, ours: dict[str, Any]) -> None:
    assert_same_mean(runs(mi.load_dict(scene(name)), ours, 64, RUNS, 0), reference(name))
