"""Latitude-longitude geometry against numerical integration."""

from __future__ import annotations

import numpy as np
import pytest

from stratalux.maps.geometry import cell_solid_angle, direction, map_coordinates, row_weights


def test_directions_are_unit_and_invert() -> None:
    u, v = np.random.default_rng(0).random((2, 1000))
    omega = direction(u, v)
    np.testing.assert_allclose(np.linalg.norm(omega, axis=-1), 1, atol=1e-12)
    np.testing.assert_allclose(np.stack(map_coordinates(omega)), np.stack([u, v]), atol=1e-9)


def test_directions_of_arrays_of_any_shape() -> None:
    u, v = np.array([[0, 0.25, 0.5], [0.75, 0, 0]]), np.array([[0.5, 0.5, 0.5], [0.5, 0, 1]])
    expected = [[[0, 0, -1], [1, 0, 0], [0, 0, 1]], [[-1, 0, 0], [0, 1, 0], [0, -1, 0]]]
    np.testing.assert_allclose(direction(u, v), expected, atol=1e-15)


def test_rounding_leads_to_no_pole_that_does_not_exist() -> None:
    y = np.array([1, -1]) * (1 + 1e-12)
    _, v = map_coordinates(np.stack([0 * y, y, 0 * y], axis=-1))
    assert v.tolist() == [0, 1]


@pytest.mark.parametrize("height", [3, 4, 17, 512])
def test_row_weights_integrate_the_bilinear_hat(height: int) -> None:
    upper, lower = row_weights(height)
    t = (np.arange(1000) + 0.5) / 1000
    theta = np.pi * (np.arange(height - 1)[:, None] + t) / (height - 1)
    step = np.pi / (height - 1)
    np.testing.assert_allclose(upper, ((1 - t) * np.sin(theta)).mean(axis=1) * step, rtol=1e-5)
    np.testing.assert_allclose(lower, (t * np.sin(theta)).mean(axis=1) * step, rtol=1e-5)
    assert (upper > 0).all() and (lower > 0).all()


def test_cells_cover_the_sphere() -> None:
    height, width = 9, 14
    assert width * cell_solid_angle(height, width).sum() == pytest.approx(4 * np.pi)
    upper, lower = row_weights(height)
    np.testing.assert_allclose(cell_solid_angle(height, width), 2 * np.pi / width * (upper + lower))
