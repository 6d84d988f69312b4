"""The irradiance of a map from its spherical harmonics."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux.maps.geometry import direction
from stratalux.maps.irradiance import (
    DEGREES,
    clamped_cosine,
    irradiance,
    irradiance_coefficients,
    zonal_coefficients,
)
from tests.helpers import hall_map, sun_map


def bilinear(texels: NDArray[np.float32], fine: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions (K, 3) and L dω (K, C) at the middles of ``fine`` x ``fine`` parts of each cell."""
    height, width, _ = texels.shape
    t = (np.arange(fine) + 0.5) / fine
    y = (np.arange(height - 1)[:, None] + t).ravel()
    x = (np.arange(width)[:, None] + t).ravel()
    i, j = y.astype(int), x.astype(int)
    s, r = (y - i)[:, None, None], (x - j)[None, :, None]
    at = lambda a, b: texels[a][:, b % width].astype(np.float64)  # noqa: E731
    L = (1 - s) * ((1 - r) * at(i, j) + r * at(i, j + 1)) + s * ((1 - r) * at(i + 1, j) + r * at(i + 1, j + 1))
    u, v = np.meshgrid((x + 0.5) / width, y / (height - 1))
    omega = direction(u.ravel(), v.ravel())
    solid_angle = 2 * np.pi**2 / (fine * fine * width * (height - 1)) * np.sin(np.pi * v.ravel())
    return omega, L.reshape(-1, texels.shape[2]) * solid_angle[:, None]


@pytest.mark.parametrize("make", [sun_map, hall_map])
def test_the_sum_is_the_integral_with_the_polynomial(make):
    texels = make()
    coefficients = irradiance_coefficients(texels)
    omega, energy = bilinear(texels, 20)
    n = np.random.default_rng(3).normal(size=(10, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    expected = np.polynomial.polynomial.polyval(n @ omega.T, clamped_cosine()) @ energy
    harmonics = [mi.Float(y) for y in dr.sh_eval(mi.Vector3f(-n[:, 2], n[:, 0], n[:, 1]), max(DEGREES))]
    found = sum(harmonics[k].numpy()[:, None] * value for k, value in coefficients.items())
    assert np.abs(found - expected).max() < 1e-4 * np.abs(expected).max()  # of the sum over parts of cells


@pytest.mark.parametrize("height", [9, 256, 1100])
def test_a_white_sky_gives_pi(height):
    coefficients = irradiance_coefficients(np.ones((height, 16, 3), dtype=np.float32))
    assert coefficients[0] * np.sqrt(1 / (4 * np.pi)) == pytest.approx(np.full(3, np.pi), rel=1e-6)
    assert max(np.abs(value).max() for k, value in coefficients.items() if k) < 1e-6


def test_wide_maps_are_summed_in_blocks():
    """A channel alone has less than one block of columns, three have two and some left over."""
    texels = np.random.default_rng(5).random((70, 130, 3)).astype(np.float32)
    together, alone = (
        irradiance_coefficients(texels),
        [irradiance_coefficients(texels[..., c : c + 1]) for c in range(3)],
    )
    largest = together[0].max()
    for k, value in together.items():
        np.testing.assert_allclose(value, np.concatenate([one[k] for one in alone]), atol=1e-6 * largest)


def test_the_polynomial_is_near_the_clamped_cosine():
    t = np.linspace(-1, 1, 2001)
    error = np.polynomial.polynomial.polyval(t, clamped_cosine()) - np.maximum(t, 0)
    assert np.sqrt(np.mean(error**2)) < 0.012
    assert zonal_coefficients()[:3] == pytest.approx([np.pi, 2 * np.pi / 3, np.pi / 4])  # Ramamoorthi and Hanrahan


@pytest.mark.parametrize("make", [sun_map, hall_map])
def test_the_irradiance_of_one_normal(make):
    """Against the sum over other parts of the cells; under a map of 1, it is π on all sides."""
    texels = make()
    omega, energy = bilinear(texels, 31)
    n = np.random.default_rng(4).normal(size=(4, 3))
    n[0] = [0, 1, 0]
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    for normal in n:
        expected = np.maximum(omega @ normal, 0) @ energy
        assert irradiance(texels, normal) == pytest.approx(expected, rel=1e-5, abs=1e-5 * energy.sum())
        np.testing.assert_allclose(irradiance(np.ones_like(texels), normal), np.pi, rtol=1e-5)
