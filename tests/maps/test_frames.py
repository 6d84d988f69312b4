"""Where other tools have the middle of a map."""

from __future__ import annotations

import numpy as np
import pytest

from stratalux.maps.frames import ENV_FRAMES


@pytest.mark.parametrize(("tool", "middle"), [("mitsuba", [0, 0, 1]), ("blender", [1, 0, 0]), ("three", [1, 0, 0])])
def test_the_middle_of_the_map_goes_to_an_axis(tool: str, middle: list[int]) -> None:
    """Turned about +y, y up: docs/conventions.md."""
    angle = np.radians(ENV_FRAMES[tool])
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    np.testing.assert_allclose(turn @ [0, 0, 1], middle, atol=1e-12)


def test_there_are_three() -> None:
    assert set(ENV_FRAMES) == {"mitsuba", "blender", "three"}
