"""Lights that are fitted, the sun, and the sky that is left."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from stratalux import EnvironmentMap, InputError
from stratalux.errors import RigWarning
from stratalux.images.colour import LUMINANCE
from stratalux.maps.geometry import direction, map_coordinates, texel_solid_angle
from stratalux.rigs import RIGS, light_rig
from stratalux.rigs.fitted import _Fit, fitted, sun_and_sky
from stratalux.rigs.harmonics import COSINE, harmonics
from stratalux.rigs.quality import irradiance, quality, sources, spread
from stratalux.rigs.sun import find_sun
from stratalux.rigs.voronoi import texel_directions
from tests.rigs.maps import MAPS, integral
from tests.rigs.test_rig import small_texels

AMBIENTS = ("none", "constant", "sh2")


def disk_map(u: float, v: float, degrees: float, height: int = 256) -> NDArray[np.float32]:
    """A grey sky of 1 with a disk of 1000, 800 and 600 more around (u, v)."""
    points = texel_directions(height, 2 * height).reshape(height, 2 * height, 3)
    inside = points @ direction(np.array(u), np.array(v)) >= np.cos(np.radians(degrees) / 2)
    return (1 + inside[..., None] * np.array([1000.0, 800, 600])).astype(np.float32)


def flux_of(texels: NDArray[np.float32]) -> NDArray[np.float64]:
    """Of the disk alone."""
    return np.einsum("ij,ijc->c", texel_solid_angle(*texels.shape[:2]), texels - 1.0)


# ------------------------------- The sun -------------------------------


@pytest.mark.parametrize(("u", "v"), [(0.3, 0.25), (0.0005, 0.4), (0.9995, 0.02), (0.5, 0.0), (0.5, 0.75)])
@pytest.mark.parametrize("degrees", [3.0, 4.5])
def test_the_sun_is_found_with_its_angle_and_colour(u: float, v: float, degrees: float) -> None:
    """At the seam and in the corner of the map, too."""
    texels = disk_map(u, v, degrees)
    sun = find_sun(EnvironmentMap(texels))
    assert sun.is_one
    assert np.degrees(np.arccos(sun.direction @ direction(np.array(u), np.array(v)))) < 0.35
    # As wide as the texels of the disk are together, which is the disk but for those on its rim.
    Ω = np.sum(texel_solid_angle(*texels.shape[:2])[texels[..., 0] > 1])
    assert 2 * np.pi * (1 - np.cos(sun.angle / 2)) == pytest.approx(Ω, rel=1e-5)
    assert np.degrees(sun.angle) == pytest.approx(degrees, rel=0.2)
    np.testing.assert_allclose(sun.colour, flux_of(texels), rtol=1e-5)


def test_a_sun_of_one_texel_is_as_wide_as_it() -> None:
    texels = np.ones((64, 128, 3), np.float32)
    texels[20, 40] = 1e5
    sun = find_sun(EnvironmentMap(texels))
    Ω = texel_solid_angle(64, 128)[20, 40]
    assert sun.is_one and 2 * np.pi * (1 - np.cos(sun.angle / 2)) == pytest.approx(Ω, rel=1e-6)
    np.testing.assert_allclose(sun.direction, texel_directions(64, 128)[20 * 128 + 40], atol=1e-4)


@pytest.mark.parametrize(
    ("height", "width", "radius"),
    [(91, 180, 5.0), (9, 36, 1.5 * 180 / 8), (41, 12, 1.5 * 360 / 12)],
    ids=["fine", "few rows", "few columns"],
)
def test_the_sun_is_what_is_brighter_than_what_is_around(height: int, width: int, radius: float) -> None:
    """Nothing within is taken away, and what is further off than twice the radius does not matter."""
    points, Ω = texel_directions(height, width), texel_solid_angle(height, width).ravel()
    peak = (height // 2) * width + width // 3
    distance = np.degrees(np.arccos(np.clip(points @ points[peak], -1, 1)))
    texels = np.where(distance > 2 * radius, 7.0, 2.0)[:, None] * np.array([1, 2, 3])
    within = np.flatnonzero(distance < radius - 1e-6)
    around = np.flatnonzero((distance > radius + 1e-6) & (distance < 2 * radius))
    texels[around[np.argsort(distance[around])[:2]]] = 100  # too far off, and too few to be the sky
    texels[within] += np.linspace(20, 30, len(within))[:, None]
    texels[peak] = 1000
    texels[within[0]] = 0
    sun = find_sun(EnvironmentMap(texels.reshape(height, width, 3).astype(np.float32)))
    excess = np.maximum(texels - 2.0 * np.array([1, 2, 3]), 0)
    colour = Ω[within] @ excess[within]
    np.testing.assert_allclose(sun.colour, colour, rtol=1e-5)
    whole = Ω @ texels
    assert sun.share == pytest.approx(float(colour @ LUMINANCE) / float(whole @ LUMINANCE), rel=1e-5)


def test_a_dim_sun_is_one() -> None:
    texels = disk_map(0.3, 0.25, 3, 64)
    bright, dim = find_sun(EnvironmentMap(texels)), find_sun(EnvironmentMap(1e-6 * texels))
    np.testing.assert_allclose(dim.colour, 1e-6 * bright.colour, rtol=1e-4)
    assert dim.is_one and dim.share == pytest.approx(bright.share, rel=1e-4)


@pytest.mark.parametrize("name", ["hall", "constant", "random"])
def test_what_is_wide_or_dim_is_no_sun(name: str) -> None:
    assert not find_sun(EnvironmentMap(MAPS[name])).is_one


def test_suns_are_five_degrees_wide_at_most() -> None:
    assert find_sun(EnvironmentMap(disk_map(0.3, 0.25, 4.8))).is_one
    assert not find_sun(EnvironmentMap(disk_map(0.3, 0.25, 5.4))).is_one


def test_the_sun_of_two_rows_has_no_sky_around() -> None:
    texels = np.full((2, 4, 3), [1, 2, 3], np.float32)
    sun = find_sun(EnvironmentMap(texels))
    np.testing.assert_allclose(sun.colour, 4 * np.pi * texels[0, 0], rtol=1e-5)
    assert sun.share == pytest.approx(1) and not sun.is_one


def test_sun_and_sky_are_the_whole_map() -> None:
    texels = disk_map(0.3, 0.25, 3)
    environment = EnvironmentMap(texels)
    lights = sun_and_sky(environment)
    assert len(lights) == 1 and lights.ambient is not None
    assert np.degrees(lights.angle[0]) == pytest.approx(3, rel=0.1)
    np.testing.assert_allclose(lights.ambient_radiance, 1, rtol=1e-3)
    np.testing.assert_allclose(lights.ambient[1:], 0, atol=0.05)
    assert quality(environment, lights)["irradiance_error"] < 0.01
    plain = sun_and_sky(environment, ambient="constant")
    assert not plain.varies
    assert sun_and_sky(environment, ambient="none").ambient is None


def test_a_map_without_a_sun_is_told() -> None:
    with pytest.warns(RigWarning, match="the map has no sun: its brightest spot"):
        sun_and_sky(EnvironmentMap(MAPS["constant"]))


# ------------------------------- The fit -------------------------------


@pytest.mark.parametrize("ambient", AMBIENTS)
def test_its_error_is_that_over_all_normals(ambient: str) -> None:
    """wᵀKw − 2 wᵀg differs by a constant from what is summed over many normals."""
    environment = EnvironmentMap(MAPS["random"])
    fit = _Fit(environment, AMBIENTS.index(ambient) + (ambient == "sh2"), None)
    normals = spread(4000)
    under_map = irradiance(*sources(environment), normals)

    def summed(d: NDArray[np.float64]) -> float:
        lights = fit.lights(d, "by hand", ambient)
        under = irradiance(lights.direction, lights.colour, normals)
        if lights.ambient is not None:
            under += harmonics(normals) @ (COSINE[:, None] * lights.ambient)
        return float(np.sum((under - under_map) ** 2) * 4 * np.pi / 4000)

    several = [spread(k) for k in (1, 3, 6)]
    errors, sums = [fit.error(d) for d in several], [summed(d) for d in several]
    np.testing.assert_allclose(np.diff(errors), np.diff(sums), rtol=0.02, atol=1e-3 * sums[0])


@pytest.mark.parametrize("ambient", AMBIENTS)
@pytest.mark.parametrize("name", ["hall", "random"])
def test_it_lights_better_than_what_represents_the_map(name: str, ambient: str) -> None:
    environment = EnvironmentMap(MAPS[name])
    lights = fitted(environment, 5, ambient=ambient)
    assert 1 <= len(lights) <= 5
    error = quality(environment, lights)["irradiance_error"]
    others = [quality(environment, light_rig(m, environment, 5).lights())["irradiance_error"] for m in RIGS]
    assert error < 0.8 * min(others)
    if ambient != "none":
        assert lights.ambient is not None
        total = lights.colour.sum(axis=0) + lights.ambient[0] * np.sqrt(4 * np.pi)
        np.testing.assert_allclose(total, integral(environment), rtol=1e-3)
        under = harmonics(spread(300)) @ (COSINE[:, None] * lights.ambient)
        assert under.min() > -0.02 * integral(environment).max() / 4


def lamps_map() -> NDArray[np.float32]:
    """Two lamps that have nearly all of the light, and not of the same colour."""
    texels = np.full((48, 96, 3), 0.001, np.float32)
    texels[10:13, 20:23], texels[30:33, 70:73] = [4, 2, 1], [1, 2, 4]
    return texels


@pytest.mark.parametrize("n", [1, 2, 4])
def test_ambient_light_is_not_negative(n: int) -> None:
    """Lights that have taken too much would be made good by it, where nothing is in its way."""
    environment = EnvironmentMap(lamps_map())
    lights = fitted(environment, n, ambient="sh2")
    assert lights.ambient is not None
    under = harmonics(spread(500)) @ (COSINE[:, None] * lights.ambient)
    most = irradiance(*sources(environment), spread(500)).max()
    assert under.min() > -0.02 * most
    assert fitted(environment, n, ambient="constant").ambient_radiance.min() >= 0


@pytest.mark.parametrize(("ambient", "degrees"), [("none", 0), ("constant", 1), ("sh2", 3)])
def test_the_slope_is_that_of_the_error(ambient: str, degrees: int) -> None:
    """By finite differences along the sphere, where conditions hold and where they do not matter."""
    for texels in (MAPS["random"], lamps_map(), disk_map(0.3, 0.25, 4, 64)):
        sun = find_sun(EnvironmentMap(texels))
        fit = _Fit(EnvironmentMap(texels), degrees, sun if sun.is_one else None)
        rng = np.random.default_rng(1)
        d = rng.normal(size=(3, 3))
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        _, slope = fit.slope(d)
        along = rng.normal(size=(3, 3))
        along -= np.sum(along * d, axis=1, keepdims=True) * d
        step = 1e-5
        ends = []
        for sign in (1, -1):
            moved = d + sign * step * along
            ends.append(fit.slope(moved / np.linalg.norm(moved, axis=1, keepdims=True))[0])
        scale = np.sum(np.abs(slope * along))
        assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(np.sum(slope * along), abs=1e-3 * scale + 1e-9)


def test_directions_are_refined() -> None:
    """Two lights are in the middles of two lamps, nine texels each, wherever one starts."""
    environment = EnvironmentMap(lamps_map())
    fit = _Fit(environment, 0, None)
    middles = texel_directions(48, 96)[[11 * 96 + 21, 31 * 96 + 71]]
    start = middles + 0.3 * np.array([[1, 0, -1], [0, 1, 1]])
    found = fit.descend(start / np.linalg.norm(start, axis=1, keepdims=True))
    assert np.degrees(np.arccos(np.clip(np.sum(found * middles, axis=1), -1, 1))).max() < 1
    assert fit.error(found) < fit.error(start / np.linalg.norm(start, axis=1, keepdims=True))


@pytest.mark.parametrize("ambient", AMBIENTS)
def test_the_sun_stays_where_it_is(ambient: str) -> None:
    texels = disk_map(0.3, 0.25, 3, 64)
    texels[40:50, 100:120] = 30
    environment = EnvironmentMap(texels)
    sun = find_sun(environment)
    lights = fitted(environment, 3, ambient=ambient)
    k = int(np.argmax(lights.direction @ sun.direction))
    np.testing.assert_allclose(lights.direction[k], sun.direction, atol=1e-12)
    assert (lights.colour[k] >= sun.colour * (1 - 1e-9)).all() and lights.angle[k] == sun.angle
    assert np.count_nonzero(lights.angle) == 1


def test_a_turned_map_has_turned_lights() -> None:
    texels = MAPS["blobs"]
    here = fitted(EnvironmentMap(texels), 3)
    there = fitted(EnvironmentMap(np.roll(texels, 32, axis=1)), 3)  # a quarter to the right
    u, v = map_coordinates(here.direction)
    wanted = direction((u + 0.25) % 1, v)
    closeness = there.direction @ wanted.T
    assert np.degrees(np.arccos(np.clip(closeness.max(axis=0), -1, 1))).max() < 3


@given(texels=small_texels)
@settings(max_examples=8, deadline=None)
def test_any_small_map(texels: NDArray[np.float32]) -> None:
    environment = EnvironmentMap(texels)
    for ambient in AMBIENTS:
        lights = fitted(environment, 3, ambient=ambient)
        assert 1 <= len(lights) <= 3 and np.isfinite(list(quality(environment, lights).values())).all()


def test_what_cannot_be_fitted() -> None:
    environment = EnvironmentMap(MAPS["constant"])
    for n, words in ((0, "too few"), (129, "more than 128, the most that are fitted"), (10**6, "texels")):
        with pytest.raises(InputError, match=words):
            fitted(environment, n)
    with pytest.raises(InputError, match="ambient: 'sh3' is unknown; use one of none, constant, sh2"):
        fitted(environment, 2, ambient="sh3")
