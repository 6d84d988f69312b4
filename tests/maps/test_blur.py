"""Blurred maps: what a round kernel on the sphere leaves as it is, and what it makes of a point."""

from __future__ import annotations

import numpy as np
import pytest

from stratalux.maps.blur import blurred
from stratalux.maps.geometry import direction, texel_solid_angle
from tests.helpers import hall_map


def mean(texels: np.ndarray) -> np.ndarray:
    weights = np.broadcast_to(texel_solid_angle(*texels.shape[:2]), texels.shape[:2])
    return np.asarray(np.einsum("ij,ijc->c", weights, texels) / weights.sum())


@pytest.mark.parametrize("degrees", [1, 5, 30, 180])
def test_light_is_kept(degrees: float) -> None:
    texels = hall_map(65, 128)
    np.testing.assert_allclose(mean(blurred(texels, degrees)), mean(texels), rtol=2e-3)


def test_an_even_map_stays_even() -> None:
    texels = np.full((16, 32, 3), [1, 2, 3], dtype=np.float32)
    np.testing.assert_allclose(blurred(texels, 4), np.broadcast_to([1, 2, 3], blurred(texels, 4).shape), rtol=4e-3)


def test_light_of_the_last_row_is_kept() -> None:
    """Where rows between those of the map have to be made."""
    for row in (0, -1):
        texels = np.zeros((9, 16, 3), dtype=np.float32)
        texels[row] = 1
        np.testing.assert_allclose(mean(blurred(texels, 30)), mean(texels), rtol=2e-2)


@pytest.mark.parametrize("degrees", [20, 45])
def test_slow_waves_stay_where_they_are(degrees: float) -> None:
    """Of degree l, they become weaker by exp(−l (l + 1) σ² / 2), as heat does, and are not turned."""

    def waves(height: int, width: int, first: float, second: float) -> np.ndarray:
        u, v = (np.arange(width) + 0.5) / width, np.arange(height) / (height - 1)
        x, y, z = np.moveaxis(direction(*np.broadcast_arrays(u[None], v[:, None])), -1, 0)
        return np.stack([3 + first * x, 3 + first * z + second * x * y, 3 + first * y + second * x * z], axis=-1)

    found = blurred(waves(129, 256, 1, 1).astype(np.float32), degrees)
    weaker = np.exp(-(np.radians(degrees) ** 2) * np.array([1, 3]))
    np.testing.assert_allclose(found, waves(*found.shape[:2], *weaker), atol=2e-3)


@pytest.mark.parametrize(("row", "column"), [(32, 40), (0, 0), (16, 0), (40, 127)])
def test_a_point_becomes_round(row: int, column: int) -> None:
    """Near the point, the heat kernel is a Gaussian of that standard deviation, wherever it is."""
    texels = np.zeros((65, 128, 3), dtype=np.float32)
    texels[row, column if row else slice(None)] = 1
    found = blurred(texels, 10)
    height, width = found.shape[:2]
    theta, phi = np.linspace(0, np.pi, height)[:, None], (np.arange(width) + 0.5) * 2 * np.pi / width
    at, around = row * np.pi / 64, (column + 0.5) * 2 * np.pi / 128
    cosine = np.cos(theta) * np.cos(at) + np.sin(theta) * np.sin(at) * np.cos(phi - around)
    distance = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    gaussian = np.exp(-((distance / 10) ** 2) / 2)
    near = distance < 25
    np.testing.assert_allclose(found[near, 0] / found[..., 0].max(), gaussian[near], atol=0.02)


def test_a_wide_one_leaves_the_mean() -> None:
    texels = hall_map(33, 64)
    found = blurred(texels, 180)
    np.testing.assert_allclose(found, np.broadcast_to(mean(texels), found.shape), rtol=0.05)
