"""The equal-area square and the quadtree of light over it."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from stratalux import EnvironmentMap
from stratalux.maps.geometry import direction, map_coordinates
from stratalux.sampling.equal_area import (
    LightPyramid,
    _mean_around,
    _mean_inside,
    direction_to_square,
    first_node,
    index_of_texel,
    square_to_direction,
    square_to_map,
    texel_of_index,
    warp,
)
from tests.helpers import ALPHA, hall_map, sun_map


def uniform(count: int, seed: int = 0) -> NDArray[np.float32]:
    return np.random.default_rng(seed).random((2, count), dtype=np.float32)


def special_points() -> NDArray[np.float32]:
    """Poles, borders of quadrants, the fold, edges and corners of the square."""
    grid = np.stack(np.meshgrid(*2 * [np.linspace(0, 1, 9)]), axis=0).reshape(2, -1)
    return grid.astype(np.float32)


def test_the_mapping_inverts() -> None:
    s = uniform(200_000)
    d = square_to_direction(mi.Point2f(s))
    np.testing.assert_allclose(dr.norm(d).numpy(), 1, atol=1e-6)
    np.testing.assert_allclose(direction_to_square(d).numpy(), s, atol=1e-6)


@pytest.mark.parametrize("points", [uniform(100_000), special_points()], ids=["random", "special"])
def test_directions_are_those_of_the_map_coordinates(points: NDArray[np.float32]) -> None:
    s = mi.Point2f(points)
    d, uv = square_to_direction(s).numpy(), square_to_map(s).numpy().astype(np.float64)
    assert (uv >= 0).all() and (uv <= 1).all()
    np.testing.assert_allclose(direction(*uv).T, d, atol=2e-6)


def test_special_directions_return() -> None:
    d = square_to_direction(mi.Point2f(special_points()))
    np.testing.assert_allclose(square_to_direction(direction_to_square(d)).numpy(), d.numpy(), atol=1e-6)


def test_latitude_keeps_its_digits_at_the_poles() -> None:
    tiny = np.float32(1e-5)
    s = mi.Point2f(0.5 + np.array([[tiny, 0.5 - tiny / 2], [0, 0.5]], dtype=np.float32))
    d, v = square_to_direction(s).numpy(), square_to_map(s).numpy()[1].astype(np.float64)
    sin_theta = np.hypot(d[0].astype(np.float64), d[2])
    assert (sin_theta > 0).all()
    np.testing.assert_allclose(np.pi * np.array([v[0]]), sin_theta[:1], rtol=1e-3)
    np.testing.assert_allclose(np.pi * (1 - v[1]), sin_theta[1], atol=1e-6)


def test_areas_are_equal() -> None:
    """Directions of uniform points of the square are uniform: χ² over bins of equal solid angle."""
    count, rows, columns = 500_000, 24, 36
    d = square_to_direction(mi.Point2f(uniform(count, 1))).numpy().astype(np.float64)
    u, _ = map_coordinates(d.T)
    i = np.minimum((0.5 * (1 - d[1]) * rows).astype(int), rows - 1)
    j = np.minimum((u * columns).astype(int), columns - 1)
    observed = np.bincount(i * columns + j, minlength=rows * columns)
    assert stats.chisquare(observed).pvalue > ALPHA


def test_z_order() -> None:
    texels = texel_of_index(mi.UInt32([0, 1, 2, 3, 4, 12])).numpy()
    np.testing.assert_array_equal(texels, [[0, 1, 0, 1, 2, 2], [0, 0, 1, 1, 0, 2]])
    index = dr.arange(mi.UInt32, 1 << 16)
    np.testing.assert_array_equal(index_of_texel(texel_of_index(index)).numpy(), index.numpy())


def test_warping_follows_the_values() -> None:
    values = np.array([1.0, 3.0, 0.0, 4.0])
    count = 200_000
    u = mi.Point2d(np.random.default_rng(3).random((2, count)))
    child, value, rest = warp(mi.Vector4f(*values.tolist()), u)
    np.testing.assert_array_equal(value.numpy(), values[child.numpy()])
    observed = np.bincount(child.numpy(), minlength=4)
    assert observed[2] == 0
    assert stats.chisquare(observed[[0, 1, 3]], count * values[[0, 1, 3]] / 8).pvalue > ALPHA
    for chosen in (0, 1, 3):
        for x in rest.numpy():
            assert stats.kstest(x[child.numpy() == chosen], "uniform").pvalue > ALPHA


MAPS = {
    "hall, odd size": lambda: hall_map(25, 47),
    "sun": lambda: sun_map(16, 32),
    "fine": lambda: hall_map(181, 360),
    "single texel": lambda: lone_texel(3, 7),
    "beside a pole": lambda: lone_texel(1, 5),
    "at a pole": lambda: lone_texel(8, 0),
}


def lone_texel(row: int, column: int) -> NDArray[np.float32]:
    texels = np.zeros((9, 18, 3), dtype=np.float32)
    texels[row, column] = [5, 1, 0]
    return texels


@pytest.mark.parametrize("name", list(MAPS))
def test_values_are_those_of_the_map(name: str) -> None:
    """The mean is 1, every node is the mean of its children, and light is where the map has it."""
    environment = EnvironmentMap(MAPS[name]())
    pyramid = LightPyramid(environment, cells=3)
    finest = pyramid.value(first_node(pyramid.levels) + dr.arange(mi.UInt32, pyramid.resolution**2)).numpy()
    assert finest.mean() == pytest.approx(1, rel=1e-5)
    nodes = dr.arange(mi.UInt32, first_node(pyramid.levels - 1)) + 1
    mean = 0.25 * dr.sum(pyramid.children(nodes)).numpy()
    np.testing.assert_allclose(pyramid.value(nodes).numpy(), mean, rtol=1e-5)

    u, v = np.meshgrid((np.arange(1440) + 0.5) / 1440, (np.arange(720) + 0.5) / 720)
    cells = mi.Point2u(direction_to_square(mi.Vector3f(direction(u, v).reshape(-1, 3).T.astype(np.float32))) * 4)
    light = (bilinear(environment, u, v) * np.sin(np.pi * v)).ravel()
    share = np.bincount(index_of_texel(cells).numpy(), light, minlength=16) / light.sum()
    held = pyramid.value(first_node(2) + dr.arange(mi.UInt32, 16)).numpy() / 16
    # What comes from the surroundings blurs by a texel of the map, and most where all light is in one.
    assert np.abs(held - share).sum() / 2 < (0.1 if environment.height == 9 else 0.01)


def bilinear(environment: EnvironmentMap, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mitsuba's lookup of the luminance."""
    x, y = u * environment.width - 0.5, v * (environment.height - 1)
    j, i = np.floor(x).astype(int), np.minimum(np.floor(y).astype(int), environment.height - 2)
    x, y = x - j, y - i
    upper, lower = (
        (1 - x) * environment.luminance[row, j % environment.width]
        + x * environment.luminance[row, (j + 1) % environment.width]
        for row in (i, i + 1)
    )
    return (1 - y) * upper + y * lower


@pytest.mark.parametrize("name", list(MAPS))
def test_density_is_positive_wherever_the_lookup_is(name: str) -> None:
    """For points in the cells around every lit texel, however narrow they are."""
    environment = EnvironmentMap(MAPS[name]())
    pyramid = LightPyramid(environment)
    rng = np.random.default_rng(4)
    lit = np.argwhere(environment.luminance > 0)
    chosen = lit[rng.integers(0, len(lit), 300_000)]
    near = chosen + rng.uniform(-1, 1, chosen.shape)
    v = np.clip(near[:, 0] / (environment.height - 1), 0, 1)
    u = np.mod((near[:, 1] + 0.5) / environment.width, 1)
    d = mi.Vector3f(direction(u, v).T.astype(np.float32))
    # Texel and lookup are of the same point of the square, as they are in a sample.
    s = direction_to_square(d)
    texel = dr.minimum(mi.Point2u(s * pyramid.resolution), pyramid.resolution - 1)
    value = pyramid.value(first_node(pyramid.levels) + index_of_texel(texel)).numpy()
    uv = square_to_map(s).numpy().astype(np.float64)
    radiance = bilinear(environment, *uv)
    assert (value[radiance > 0] > 0).all()


@pytest.mark.parametrize("name", ["hall, odd size", "single texel"])
def test_values_are_those_inside_and_a_twentieth_of_those_around(name: str) -> None:
    environment = EnvironmentMap(MAPS[name]())
    pyramid = LightPyramid(environment)
    texel = texel_of_index(dr.arange(mi.UInt32, pyramid.resolution**2))
    side = np.sqrt(environment.height * environment.width)
    points = max(2, int(np.ceil(2 * side / pyramid.resolution)))
    around, lit = _mean_around(environment, texel, pyramid.resolution)
    expected = 0.95 * _mean_inside(environment, texel, pyramid.resolution, points) + 0.05 * around
    finest = pyramid.value(first_node(pyramid.levels) + dr.arange(mi.UInt32, pyramid.resolution**2)).numpy()
    np.testing.assert_allclose(finest, np.where(lit, np.maximum(expected / expected.mean(), 1e-9), 0), rtol=1e-5)


def test_means_inside_are_those_of_the_lookup() -> None:
    environment, resolution, points = EnvironmentMap(hall_map(25, 47)), 16, 5
    index = dr.arange(mi.UInt32, resolution**2)
    found = _mean_inside(environment, texel_of_index(index), resolution, points)
    at = (np.arange(resolution * points) + 0.5) / (resolution * points)
    uv = square_to_map(mi.Point2f(*(a.ravel().astype(np.float32) for a in np.meshgrid(at, at)))).numpy()
    fine = bilinear(environment, *uv.astype(np.float64)).reshape(resolution, points, resolution, points)
    x, y = texel_of_index(index).numpy()
    np.testing.assert_allclose(found, fine.mean(axis=(1, 3))[y, x], rtol=1e-3, atol=1e-4)


def test_a_black_map() -> None:
    pyramid = LightPyramid(EnvironmentMap(np.zeros((9, 18, 3), dtype=np.float32)), cells=3)
    assert pyramid.black
    assert (pyramid.children(mi.UInt32([0, 1, 5])).numpy() == 0).all()
    assert np.isfinite(pyramid.centroid(dr.arange(mi.UInt32, 64)).numpy()).all()


def test_centroids_point_at_the_light() -> None:
    pyramid = LightPyramid(EnvironmentMap(sun_map()), cells=3)
    cell = int(np.argmax(pyramid.value(first_node(3) + dr.arange(mi.UInt32, 64)).numpy()))
    towards = direction(np.array((12 + 0.5) / 48), np.array(8 / 23))
    assert pyramid.centroid(mi.UInt32(cell)).numpy().ravel() @ towards > np.cos(np.radians(5))


def test_large_maps_are_reduced() -> None:
    texels = np.full((1024, 2048, 3), 0.5, dtype=np.float32)
    texels[300, 700] = 0
    pyramid = LightPyramid(EnvironmentMap(texels))
    assert pyramid.resolution == 2048
    assert pyramid.levels == 11
