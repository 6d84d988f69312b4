"""From what people have to a scene."""

from __future__ import annotations

import re

import mitsuba as mi
import numpy as np
import pytest

from stratalux import EnvironmentMap, InputError
from stratalux.scenes.load import load_scene

WHITE = EnvironmentMap.from_array(np.ones((4, 8, 3)))


@pytest.mark.parametrize("scale", [float("nan"), float("inf"), -1.0, 1e31])
def test_factors_that_are_none_for_light_are_refused(scale: float) -> None:
    with pytest.raises(InputError, match=re.escape(f"scale: {scale} is ")):
        load_scene("demo", environment=WHITE, scale=scale)


def test_a_factor_that_makes_a_map_too_bright_is_refused() -> None:
    bright = EnvironmentMap.from_array(np.full((4, 8, 3), 1e19))
    with pytest.raises(InputError, match="1e\\+15 times it is more than can be reckoned with"):
        load_scene("demo", environment=bright, scale=1e15, size=(8, 8))


@pytest.mark.parametrize("angle", [float("nan"), float("inf")])
def test_angles_that_are_none_are_refused(angle: float) -> None:
    with pytest.raises(InputError, match="is not finite; give degrees"):
        load_scene("demo", environment=WHITE, rotate=(0, angle, 0))


def test_the_map_is_turned_and_scaled() -> None:
    scene = load_scene("demo", environment=WHITE, scale=3, rotate=(0, 90, 0), size=(8, 8))
    params = mi.traverse(scene.environment())
    assert params["scale"].numpy() == 3
    turned = params["to_world"].matrix.numpy().reshape(4, 4)[:3, :3]
    np.testing.assert_allclose(turned, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-6)
