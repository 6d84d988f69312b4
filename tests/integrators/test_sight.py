"""What is special about a scene as rays see it."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import lamp, scene_dict


def sight(more: dict[str, Any] | None = None, sensor: int | None = None, **properties: Any) -> Any:
    """As an integrator with these properties finds it."""
    scene = mi.load_dict({**scene_dict(), "second": scene_dict()["sensor"], **(more or {})})
    integrator = mi.load_dict({"type": "direct_stratified", "strata": 4, **properties})
    camera = None if sensor is None else scene.sensors()[sensor]
    return scene, integrator, integrator.sight(scene, integrator.prepare(scene), camera)


def test_nothing_is_special() -> None:
    _, _, found = sight()
    assert not (found.masks or found.straight or found.fades)
    assert found.obstacles is None and found.backdrop is None and found.catcher is None
    assert found.parts() == () and found.arrays() == ((), ())


@pytest.mark.parametrize("hidden", [False, True])
def test_rays_go_straight_through_masks_and_hidden_lamps(hidden: bool) -> None:
    half = {"veil": {"type": "sphere", "bsdf": {"type": "mask", "opacity": 0.5, "inside": {"type": "diffuse"}}}}
    *_, masks = sight(half, hide_emitters=hidden)
    assert masks.masks and masks.straight and masks.obstacles is not None
    *_, lit = sight({"lamp": lamp()}, hide_emitters=hidden)
    assert lit.straight == hidden and not lit.masks and lit.obstacles is None
    *_, dark = sight(hide_emitters=hidden)
    assert not dark.straight


def test_what_is_behind() -> None:
    from stratalux.integrators.backdrop import Light, Nothing, Plate  # of the active variant

    *_, none = sight(background="none")
    assert isinstance(none.backdrop, Nothing) and none.parts() == () and not none.fades
    _, integrator, even = sight(background={"type": "constant"})
    assert isinstance(even.backdrop, Light)
    assert even.parts() == (integrator.background,) and even.arrays() == (even.parts(), ())
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(np.ones((2, 2, 3), np.float32)), "raw": True}
    for sensor in (None, 0, 1):
        scene, integrator, plate = sight(sensor=sensor, background=texture)
        assert isinstance(plate.backdrop, Plate)
        assert plate.parts() == (integrator.background, scene.sensors()[sensor or 0])


@pytest.mark.parametrize(("hidden", "background"), [(False, "map"), (True, "map"), (False, "none")])
def test_a_catcher_fades_over_nothing(hidden: bool, background: str) -> None:
    """Without a background, the map is behind it, unless that is hidden."""
    scene, _, found = sight(catcher="floor", hide_emitters=hidden, background=background)
    assert found.catcher is not None and found.straight and not found.masks
    assert found.fades == (hidden or background == "none")
    behind = () if found.fades else (scene.environment(),)
    assert found.parts() == (*behind, found.catcher.white)
    parts, arrays = found.arrays()
    assert parts == found.parts() and len(arrays) == 2
