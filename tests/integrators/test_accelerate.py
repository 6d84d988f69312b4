"""Ours in place of Mitsuba's integrators."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from stratalux import accelerate
from stratalux.errors import SceneWarning
from stratalux.integrators.accelerate import description_of
from tests.helpers import scene_dict

PATH = {"type": "path", "max_depth": 7, "rr_depth": 3, "hide_emitters": True}
OURS = {**PATH, "type": "path_stratified"}


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        (PATH, OURS),
        ({"type": "path"}, {"type": "path_stratified"}),
        ({"type": "direct", "emitter_samples": 3, "hide_emitters": True},
         {"type": "direct_stratified", "hide_emitters": True}),
        ({"type": "aov", "aovs": "d:depth", "one": PATH, "two": {"type": "direct"}},
         {"type": "aov", "aovs": "d:depth", "one": OURS, "two": {"type": "direct_stratified"}}),
        ({"type": "moment", "one": {"type": "aov", "aovs": "d:depth", "two": PATH}},
         {"type": "moment", "one": {"type": "aov", "aovs": "d:depth", "two": OURS}}),
        ({"type": "scene", "ball": {"type": "sphere"}, "i": PATH},
         {"type": "scene", "ball": {"type": "sphere"}, "i": OURS}),
        ({"type": "scene"}, {"type": "scene", "integrator": {"type": "path_stratified"}}),
        (OURS, OURS),
        ({"type": "scene", "thing": {"type": "of nobody"}},
         {"type": "scene", "thing": {"type": "of nobody"}, "integrator": {"type": "path_stratified"}}),
    ],
)  # fmt: skip
def test_descriptions(theirs: dict[str, Any], ours: dict[str, Any]) -> None:
    before = str(theirs)
    assert accelerate(theirs) == ours
    assert str(theirs) == before


def test_what_is_loaded() -> None:
    for loaded in (mi.load_dict(PATH), mi.load_dict({"type": "scene", "i": PATH})):
        assert str(accelerate(loaded)) == "PathStratified[max_depth = 7, rr_depth = 3]"
        assert accelerate(loaded).hide_emitters
    for text in ("PathStratified[max_depth = -1, rr_depth = 5]",):
        assert str(accelerate(mi.load_dict({"type": "path"}))) == text
        assert str(accelerate(mi.load_dict({"type": "scene"}))) == text
    assert str(accelerate(mi.load_dict({"type": "direct"}))) == "DirectStratified[automatic]"
    ours = mi.load_dict(OURS)
    assert accelerate(ours) is ours


def test_what_is_left_alone_is_told() -> None:
    for left, line in (
        ({"type": "volpath"}, "volpath: left as it is"),
        ({"type": "path", "max_depth": 1}, "path with max_depth 1: left as it is"),
        ({"type": "path", "max_depth": 0}, "path with max_depth 0: left as it is"),
        (mi.load_dict({"type": "ptracer"}), "ParticleTracerIntegrator: left as it is"),
        (mi.load_dict({"type": "aov", "aovs": "d:depth", "one": PATH}), "aov: left as it is; once loaded, it does not"),
    ):
        with pytest.warns(SceneWarning, match=line):
            assert accelerate(left) is left


def test_descriptions_of_what_is_loaded() -> None:
    assert description_of(mi.load_dict(PATH)) == PATH
    assert description_of(mi.load_dict({"type": "path"})) == {
        "type": "path",
        "max_depth": -1,
        "rr_depth": 5,
        "hide_emitters": False,
    }
    assert description_of(mi.load_dict({"type": "volpath"})) is None


def test_inside_of_aov() -> None:
    """The same light, beside the depth of what is seen."""
    scene = mi.load_dict(scene_dict("diffuse"))
    inside = accelerate({"type": "aov", "aovs": "d:depth", "light": {"type": "path", "max_depth": 4}})
    image = mi.render(scene, integrator=mi.load_dict(inside), spp=64, seed=3).numpy()
    alone = mi.render(scene, integrator=mi.load_dict({"type": "path_stratified", "max_depth": 4}), spp=64).numpy()
    assert image.shape[-1] == 4 and image[..., 3].max() > 3
    np.testing.assert_allclose(image[..., :3].mean(axis=(0, 1)), alone.mean(axis=(0, 1)), rtol=0.02)
