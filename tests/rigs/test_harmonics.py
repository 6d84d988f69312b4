"""The nine harmonics: orthonormal, and what ambient light is made of."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from stratalux.maps.geometry import texel_solid_angle
from stratalux.maps.irradiance import irradiance
from stratalux.rigs.harmonics import COSINE, ambient_map, harmonics, turned
from stratalux.rigs.quality import spread
from stratalux.rigs.voronoi import texel_directions

COEFFICIENTS = np.concatenate([[[3.0, 2.0, 1.0]], np.random.default_rng(5).normal(0, 0.2, (8, 3))])


def test_they_are_orthonormal() -> None:
    Y = harmonics(spread(20000))
    np.testing.assert_allclose(4 * np.pi / 20000 * Y.T @ Y, np.eye(9), atol=1e-3)


def test_irradiance_is_their_sum_with_the_cosine() -> None:
    """By the integral of the map over a hemisphere."""
    texels = ambient_map(COEFFICIENTS, 128)
    for normal in spread(4):
        wanted = harmonics(normal) @ (COSINE[:, None] * COEFFICIENTS)
        np.testing.assert_allclose(irradiance(texels, normal), wanted, rtol=1e-3)


def test_turned_light_comes_from_elsewhere() -> None:
    rotation = Rotation.from_rotvec([0.3, -1.1, 0.6]).as_matrix()
    omega = spread(50)
    for coefficients in (COEFFICIENTS, *(COEFFICIENTS * (np.arange(9) == k)[:, None] for k in range(9))):
        there = harmonics(omega @ rotation.T) @ turned(coefficients, rotation)
        np.testing.assert_allclose(there, harmonics(omega) @ coefficients, atol=1e-12)


def test_a_constant_stays_one() -> None:
    constant = np.zeros((9, 3))
    constant[0] = [1, 2, 3]
    np.testing.assert_array_equal(turned(constant, Rotation.from_rotvec([0, 1, 0]).as_matrix()), constant)


def test_the_map_is_not_negative_and_keeps_its_mean() -> None:
    deep = COEFFICIENTS.copy()
    deep[2] += 4
    texels = ambient_map(deep, 64)
    assert texels.min() == 0
    weight = texel_solid_angle(64, 128).ravel()
    mean = weight @ texels.reshape(-1, 3) / (4 * np.pi)
    np.testing.assert_allclose(mean, deep[0] / np.sqrt(4 * np.pi), rtol=2e-3)
    plain = ambient_map(COEFFICIENTS, 64).reshape(-1, 3)
    np.testing.assert_allclose(plain, harmonics(texel_directions(64, 128)) @ COEFFICIENTS, rtol=2e-3, atol=2e-3)


def test_dim_and_black_light_is_kept_as_it_is() -> None:
    """Also where it is negative, which becomes 0."""
    np.testing.assert_allclose(ambient_map(1e-3 * COEFFICIENTS), 1e-3 * ambient_map(COEFFICIENTS), rtol=1e-5)
    assert not ambient_map(np.zeros((9, 3))).any()
    negative = np.zeros((9, 3))
    negative[0] = -1
    assert not ambient_map(negative).any()
    negative[1] = 2  # but not everywhere
    assert not ambient_map(negative).any()
