"""Errors of lights, against closed forms and the integral over a hemisphere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stratalux import EnvironmentMap
from stratalux.maps import irradiance as exact
from stratalux.rigs import quality as module
from stratalux.rigs.lights import Lights
from stratalux.rigs.quality import irradiance, quality, sources, spread
from tests.rigs.maps import MAPS, integral


def one(direction: list[float], colour: list[float], angle: float = 0.0) -> Lights:
    d = np.array([direction], dtype=np.float64)
    return Lights(d / np.linalg.norm(d), np.array([colour]), np.array([angle]), "by hand")


def constant_ambient(radiance: float) -> np.ndarray:
    ambient = np.zeros((9, 3))
    ambient[0] = radiance * np.sqrt(4 * np.pi)
    return ambient


@pytest.mark.parametrize("name", ["hall", "random", "blobs"])
def test_sources_light_as_the_map(name: str) -> None:
    environment = EnvironmentMap(MAPS[name])
    points, flux = sources(environment)
    np.testing.assert_allclose(flux.sum(axis=0), integral(environment), rtol=1e-5)
    normals = spread(6)
    wanted = np.array([exact.irradiance(environment.texels, normal) for normal in normals])
    np.testing.assert_allclose(irradiance(points, flux, normals), wanted, rtol=0.01)


def test_large_maps_have_few_sources() -> None:
    texels = np.random.default_rng(0).uniform(0, 1, (130, 260, 3)).astype(np.float32)
    points, flux = sources(EnvironmentMap(texels))
    assert len(points) == 64 * 128 and flux.shape == points.shape


def test_no_error_for_the_map_itself() -> None:
    texels = np.zeros((16, 32, 3), np.float32)
    texels[5, 9] = [3, 2, 1]
    environment = EnvironmentMap(texels)
    points, flux = sources(environment)
    itself = Lights(points, flux, np.zeros(1), "by hand")
    assert quality(environment, itself) == {"irradiance_error": 0.0, "shadow_error": 0.0}
    brighter = quality(environment, replace(itself, colour=1.25 * flux))
    assert brighter["irradiance_error"] == pytest.approx(0.25) and brighter["shadow_error"] == pytest.approx(0.25)


def test_ambient_light_is_that_of_a_constant_map() -> None:
    """Its irradiance is exact. On the floor it has no shadow, and the map has one, that of the ball."""
    environment = EnvironmentMap(np.full((64, 128, 3), 0.5, np.float32))
    lights = replace(one([0, 1, 0], [0.0, 0, 0]), ambient=constant_ambient(0.5))
    found = quality(environment, lights)
    assert found["irradiance_error"] < 1e-3
    # A ball of radius 1 whose centre is seen from distance D at height 1 takes sin² of its radius times cos of its
    # centre, 1 / D³, where it is above the horizon as a whole, which it always is here: it touches the floor.
    t = 6 * (np.arange(24) + 0.5) / 24 - 3
    D = np.sqrt(t[:, None] ** 2 + t**2 + 1)
    under = 1 - 1 / D**3
    expected = np.sqrt(np.mean((1 - under) ** 2) / np.mean(under**2))
    assert found["shadow_error"] == pytest.approx(expected, rel=0.02)


def test_the_floor_is_lit_from_above() -> None:
    """Ambient light that is as bright on either side of it makes no difference to it; what comes from above does."""
    texels = np.zeros((16, 32, 3), np.float32)
    texels[5, 9] = [3, 2, 1]
    environment = EnvironmentMap(texels)
    lights = one([0, 1, 0], [1.0, 1, 1])
    plain = quality(environment, lights)["shadow_error"]
    for k, counts in ((1, True), (2, False), (3, False)):  # Y of y, z, x
        ambient = np.zeros((9, 3))
        ambient[k] = 0.5
        found = quality(environment, replace(lights, ambient=ambient))["shadow_error"]
        assert (found != pytest.approx(plain, rel=1e-9)) == counts
    ambient = np.zeros((9, 3))
    ambient[1] = 0.5
    found = quality(environment, replace(lights, colour=np.zeros((1, 3)), ambient=ambient))["shadow_error"]
    under, even = module._on_the_floor(*sources(environment)), 2 / 3 * np.pi * np.sqrt(3 / (4 * np.pi)) * 0.5
    assert found == pytest.approx(np.sqrt(np.sum((even - under) ** 2) / np.sum(under**2)), rel=1e-9)


def test_the_shadow_of_a_light_is_where_the_ball_is_in_the_way() -> None:
    """From straight above it is a disk of radius 1; from 45 degrees, an ellipse of area π √2 around (−1, 0)."""
    for direction, area, centre in (([0, 1, 0], np.pi, 0.0), ([1, 1, 0], np.pi * np.sqrt(2), -1.0)):
        d = np.array([direction]) / np.linalg.norm(direction)
        lit = module._on_the_floor(d, np.ones((1, 3)))[:, 0].reshape(24, 24)
        assert np.unique(lit.round(12)).tolist() == sorted({0.0, round(float(d[0, 1]), 12)})
        t = 6 * (np.arange(24) + 0.5) / 24 - 3
        x = np.meshgrid(t, t)[0]
        assert np.sum(lit == 0) * (6 / 24) ** 2 == pytest.approx(area, rel=0.06)
        assert x[lit == 0].mean() == pytest.approx(centre, abs=0.05)
    slanted = np.array([[1.0, 2, 3]]) / np.sqrt(14)
    dark = module._on_the_floor(slanted, np.ones((1, 3)))[:, 0].reshape(24, 24) == 0
    middle = [grid[dark].mean() for grid in np.meshgrid(t, t)]  # where a ray through the centre ends, more or less
    assert middle == pytest.approx([-0.5, -1.5], abs=0.15)
    below = module._on_the_floor(np.array([[0, -1.0, 0]]), np.ones((1, 3)))
    assert not below.any()


def test_a_light_with_an_angle_is_a_disk() -> None:
    direction, colour = module.disks(one([1, 2, 3], [4.0, 2, 1], angle=np.radians(20)))
    lit = colour.any(axis=1)
    np.testing.assert_allclose(colour.sum(axis=0), [4, 2, 1])
    axis = np.array([1, 2, 3]) / np.sqrt(14)
    off = np.degrees(np.arccos(direction[lit] @ axis))
    assert off.max() < 10 and off.max() > 9
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1)
    mean = direction[lit].mean(axis=0)
    np.testing.assert_allclose(mean / np.linalg.norm(mean), axis, atol=0.01)


def test_a_black_map_has_no_errors() -> None:
    environment = EnvironmentMap(np.zeros((8, 16, 3), np.float32))
    assert quality(environment, one([0, 1, 0], [0.0, 0, 0])) == {"irradiance_error": 0.0, "shadow_error": 0.0}
