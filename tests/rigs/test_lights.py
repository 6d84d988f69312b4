"""Lights without a map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stratalux.errors import InputError
from stratalux.rigs.lights import Lights, frame_towards, quaternion_towards, split
from stratalux.rigs.quality import spread

LIGHTS = Lights(np.eye(3), np.ones((3, 3)), np.zeros(3), "by hand")
numbers = st.floats(-1, 1)


@given(x=numbers, y=numbers, z=numbers)
def test_rotations_take_the_axis_there(x: float, y: float, z: float) -> None:
    length = np.sqrt(x * x + y * y + z * z)
    d = np.array([x, y, z]) / length if length > 1e-3 else np.array([0.0, 0, -1])
    frame = frame_towards(d)
    np.testing.assert_allclose(frame[:, 2], d, atol=1e-9)
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(frame) == pytest.approx(1, abs=1e-6)
    np.testing.assert_allclose(Rotation.from_quat(quaternion_towards(d)).as_matrix()[:, 2], d, atol=1e-6)


def test_turning_is_counter_clockwise_seen_from_above() -> None:
    turned = LIGHTS.turn(90)
    np.testing.assert_allclose(turned.direction, [[0, 0, -1], [0, 1, 0], [1, 0, 0]], atol=1e-12)
    assert turned.turned == 90 and LIGHTS.turn(0) is LIGHTS
    assert turned.turn(30).turned == 120


def test_names_are_those_of_lights_that_shine() -> None:
    dark = replace(LIGHTS, colour=np.array([[1.0, 0, 0], [0, 0, 0], [0, 0, 1]]))
    assert [name for name, *_ in dark.named()] == ["light_1", "light_3"]


def test_a_colour_is_a_tint_and_a_strength() -> None:
    assert split(np.array([1.0, 4, 2])) == ([0.25, 1.0, 0.5], 4.0)
    assert split(np.zeros(3)) == ([1.0, 1.0, 1.0], 0.0)


def test_without_variation_the_mean_is_left() -> None:
    ambient = np.arange(27.0).reshape(9, 3)
    plain = replace(LIGHTS, ambient=ambient).without_variation()
    np.testing.assert_array_equal(plain.ambient_radiance, ambient[0] / np.sqrt(4 * np.pi))
    assert not plain.varies and LIGHTS.without_variation() is LIGHTS
    assert not LIGHTS.ambient_radiance.any()


@pytest.mark.parametrize(
    "wrong",
    [
        {"direction": 2 * np.eye(3)},
        {"direction": np.eye(4)[:, :3]},
        {"colour": -np.ones((3, 3))},
        {"colour": np.full((3, 3), np.inf)},
        {"angle": np.array([0, 0, 4.0])},
        {"angle": np.array([0, 0, np.nan])},
        {"angle": np.zeros(2)},
        {"ambient": np.zeros((4, 3))},
        {"ambient": np.full((9, 3), np.nan)},
    ],
)
def test_lights_that_do_not_fit_are_refused(wrong: dict[str, np.ndarray]) -> None:
    with pytest.raises(InputError, match="^lights: "):
        replace(LIGHTS, **wrong)  # type: ignore[arg-type]


def test_directions_are_spread_evenly() -> None:
    points = spread(500)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=2e-3)
    np.testing.assert_allclose(points.T @ points / 500, np.eye(3) / 3, atol=2e-3)
