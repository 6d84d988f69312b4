"""The shadows on a ground that is not seen: no bias against the ratio of two pictures of Mitsuba's ``direct``."""

from __future__ import annotations

from functools import cache
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.helpers import assert_same_mean, direct, runs, scene_dict

RUNS = 32
OURS = {
    "automatic": ({"type": "direct_stratified"}, 64),
    "pinned": ({"type": "direct_stratified", "strata": 8, "proposals": 2, "bsdf_samples": 1}, 64),
    "importance": ({"type": "direct_importance", "samples": 8, "proposals": 16, "bsdf_samples": 1}, 64),
    "wavelet": ({"type": "direct_wavelet", "samples": 16, "resolution": 8}, 64),
}
WHITE = {"type": "constant", "radiance": 1.0}


def scene(*left_out: str) -> dict[str, Any]:
    described = scene_dict("diffuse")
    described["floor"]["bsdf"] = {"type": "diffuse", "reflectance": 1.0}
    return {name: part for name, part in described.items() if name not in left_out}


@cache
def ground() -> NDArray[np.bool_]:
    """Pixels that show the floor alone, or nearly: of what else they show, Mitsuba's picture is divided as well."""
    film = {"film": {**scene()["sensor"]["film"], "pixel_format": "rgba"}}
    seen = [
        runs(
            mi.load_dict({**scene(left_out), "sensor": {**scene()["sensor"], **film}}),
            {"type": "direct_stratified", "strata": 1, "background": "none"},
            8192,
            1,
            0,
        )[0, ..., 3]
        for left_out in ("floor", "none")
    ]
    mask: NDArray[np.bool_] = (seen[0] == 0) & (seen[1] > 1 - 1e-5)
    assert mask.sum() > 30
    return mask


@cache
def reference() -> NDArray[Any]:
    """Shares that get through, as Mitsuba's ``direct`` has them."""
    shadowed, unshadowed = direct(scene()), direct(scene("ball", "box"))
    clear = unshadowed.mean(axis=0)[ground()].mean(axis=0)  # all places have the same light
    return np.where(ground()[..., None], shadowed / clear, 1)


@pytest.mark.parametrize("name", ["automatic", *(pytest.param(n, marks=pytest.mark.slow) for n in list(OURS)[1:])])
def test_same_mean_as_the_ratio(name: str) -> None:
    ours, spp = OURS[name]
    of = mi.load_dict({**scene(), "floor": scene_dict("diffuse")["floor"]})
    images = runs(of, {**ours, "catcher": "floor", "background": WHITE}, spp, RUNS, 0)
    assert_same_mean(np.where(ground()[..., None], images, 1), reference())
