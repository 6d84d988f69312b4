"""What a leaf sampler draws against what it states."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from stratalux import EnvironmentMap, median_cut
from stratalux.images.colour import LUMINANCE
from stratalux.maps.geometry import map_coordinates
from stratalux.sampling.leaf_sampler import BrightLeafSampler, LeafSampler, RegionLeafSampler
from stratalux.sampling.leaves import cut_regions, equal_energy_leaves
from tests.helpers import ALPHA, hall_map, sun_map

SAMPLES = 1 << 20
MAPS = {"hall": hall_map(), "sun": sun_map(), "black": np.zeros((8, 16, 3), np.float32)}


def draw(sampler: LeafSampler) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    random = mi.load_dict({"type": "independent"})
    random.seed(3, SAMPLES)
    where = (mi.UInt32(random.next_1d() * 65536) << 16) | mi.UInt32(random.next_1d() * 65536)
    x = sampler.sample(where >> (32 - sampler.depth), random.next_2d())
    return tuple(np.asarray(value, dtype=np.float64) for value in (x.uv.numpy(), x.d.numpy(), x.pdf.numpy()))  # type: ignore[return-value]


@pytest.mark.parametrize("name", MAPS)
def test_chi_square_against_the_areas_of_the_leaves(name: str) -> None:
    environment = EnvironmentMap(MAPS[name])
    depth, columns, rows = 10, 24, 12
    uv, _, _ = draw(LeafSampler(environment, depth))
    x = np.mod(uv[0] - 0.5 / environment.width, 1)
    counts, _, _ = np.histogram2d(x, uv[1], bins=(columns, rows), range=[[0, 1], [0, 1]])

    leaves = equal_energy_leaves(environment, depth) / np.array([environment.width, environment.height - 1] * 2)

    def parts(start: NDArray[np.float64], size: NDArray[np.float64], bins: int) -> NDArray[np.float64]:
        edges = np.clip((np.arange(bins + 1) / bins - start[:, None]) / size[:, None], 0, 1)
        return np.diff(edges, axis=1)

    expected = (
        SAMPLES / len(leaves) * parts(leaves[:, 0], leaves[:, 2], columns).T @ parts(leaves[:, 1], leaves[:, 3], rows)
    )
    usual = expected > 20
    observed = np.append(counts[usual], counts[~usual].sum() + 1)
    wanted = np.append(expected[usual], expected[~usual].sum() + 1)
    assert stats.chisquare(observed, wanted * observed.sum() / wanted.sum()).pvalue > ALPHA


@pytest.mark.parametrize("name", MAPS)
def test_the_pdf_is_per_steradian_and_covers_the_sphere(name: str) -> None:
    """E[1 / pdf] over a part of the sphere is its solid angle."""
    _, d, pdf = draw(LeafSampler(EnvironmentMap(MAPS[name]), 10))
    assert (pdf > 0).all()
    for axis in range(3):
        for sign in (-1, 1):
            values = np.where(sign * d[axis] > 0.3, 1 / pdf, 0)
            error = values.std() / np.sqrt(SAMPLES)
            assert abs(values.mean() - 2 * np.pi * 0.7) < 4.5 * error  # six parts of three maps at 1e-3 together


@pytest.mark.parametrize("glossy", [False, True])
@pytest.mark.parametrize("name", MAPS)
def test_what_is_brighter_than_a_share_of_the_mean(name: str, glossy: bool) -> None:
    """Its density is that of leaves of such a map; it covers the sphere, and brings the map's whole light."""
    environment = EnvironmentMap(MAPS[name])
    luminance = environment.texels @ LUMINANCE
    mean = environment.energy_table.total / (4 * np.pi)
    sampler = BrightLeafSampler(environment, glossy)
    assert float(sampler.mean[0]) == pytest.approx(mean, rel=1e-6)
    assert sampler.sunny == (name == "sun")
    spared = mean * {"hall": 0.25, "sun": 1.0 if glossy else 0.5, "black": 1.0}[name]
    assert float(sampler.spared[0]) == pytest.approx(spared, rel=1e-4)
    bright = EnvironmentMap(np.repeat(np.maximum(luminance - spared, 0)[..., None], 3, axis=2).astype(np.float32))
    assert sampler.energy == pytest.approx(bright.energy_table.total, rel=1e-3)
    for drawn, wanted in zip(draw(sampler), draw(LeafSampler(bright)), strict=True):
        np.testing.assert_allclose(drawn, wanted, rtol=0.02, atol=0.02)
    _, _, pdf = draw(sampler)
    error = (1 / pdf).std() / np.sqrt(SAMPLES)
    assert (pdf > 0).all() and abs((1 / pdf).mean() - 4 * np.pi) < 4 * error


def test_directions_are_those_of_the_map() -> None:
    uv, d, _ = draw(LeafSampler(EnvironmentMap(hall_map()), 10))
    u, v = map_coordinates(d.T)
    np.testing.assert_allclose(np.mod(uv[0] - u + 0.5, 1), 0.5, atol=1e-4)
    np.testing.assert_allclose(uv[1], v, atol=1e-4)


@pytest.mark.parametrize("n", [1, 5, 37])
@pytest.mark.parametrize("name", MAPS)
def test_regions_have_leaves_of_their_own(name: str, n: int) -> None:
    """Samples lie in the region that they are asked for, and E[1 / pdf] is its solid angle."""
    environment = EnvironmentMap(MAPS[name])
    regions = median_cut(environment, n)
    sampler = RegionLeafSampler(environment, regions, 9)
    assert sampler.count == 512 * len(regions)
    energy = environment.energy_table.total
    assert sampler.region_energy.numpy().sum() == pytest.approx(1.01 * energy if energy else 4 * np.pi, rel=1e-5)
    random = mi.load_dict({"type": "independent"})
    random.seed(4, SAMPLES)
    leaf = mi.UInt32(np.arange(SAMPLES) % sampler.count)
    x = sampler.sample(leaf, random.next_2d())
    region = np.arange(SAMPLES) % sampler.count // 512
    same = sampler.region(x.d).numpy() == region
    assert same.mean() > 0.999  # close to a border, a direction may round into the neighbour
    inverse = 1 / x.pdf.numpy().astype(np.float64)
    for i in range(len(regions)):
        values = inverse[region == i]
        error = values.std() / np.sqrt(len(values)) + 1e-4 * regions.solid_angle[i]
        assert abs(values.mean() - regions.solid_angle[i]) < 4.5 * error


def test_leaves_of_regions_are_cut_where_those_of_the_map_are() -> None:
    environment = EnvironmentMap(hall_map())
    whole = median_cut(environment, 1)
    np.testing.assert_array_equal(
        cut_regions(environment.energy_table, whole.bounds, 7).numpy(),
        cut_regions(environment.energy_table, None, 7).numpy(),
    )


def test_regions_share_the_leaves_out() -> None:
    environment = EnvironmentMap(hall_map())
    # Half as many where there are many of them
    for n, each in ((1, 1 << 16), (3, 1 << 14), (64, 1 << 10), (65, 1 << 9), (256, 1 << 8), (257, 1 << 6)):
        sampler = RegionLeafSampler(environment, median_cut(environment, n))
        assert (len(sampler.regions), sampler.count, 1 << sampler.depth) == (n, n * each, each)
        assert sampler.bytes >= 16 * sampler.count
    assert LeafSampler(environment).bytes == 16 << 16
    fine = EnvironmentMap(np.ones((192, 384, 3), np.float32))
    assert RegionLeafSampler(fine, median_cut(fine, 40_000)).count == 40_000  # one each, at least


def test_poles_have_no_density() -> None:
    """A point right at a pole has a direction, and a pdf that is no division by 0."""
    x = LeafSampler(EnvironmentMap(hall_map()), 0).sample(mi.UInt32(0), mi.Point2f(0.5, [0.0, 1e-3]))
    assert x.pdf.numpy()[0] == 0 and 0 < x.pdf.numpy()[1] < np.inf
    np.testing.assert_allclose(x.d.numpy()[:, 0], [0, 1, 0], atol=1e-6)


def test_how_concentrated_light_is() -> None:
    """Mean square over squared mean: 1 where light is even, much more where all comes from a few texels."""
    even = np.ones((64, 128, 3), dtype=np.float32)
    assert LeafSampler(EnvironmentMap(even)).concentration == pytest.approx(1, rel=0.02)
    lamp = np.full_like(even, 1e-6)
    lamp[24:40, 32:64] = 1
    texels, θ = np.square(lamp[..., 0]), np.pi * np.arange(64) / 63
    weights = np.sin(θ)[:, None] * np.ones(128) / (128 * np.sin(θ).sum())
    expected = (texels * weights).sum() / (lamp[..., 0] * weights).sum() ** 2
    assert LeafSampler(EnvironmentMap(lamp)).concentration == pytest.approx(expected, rel=0.1)
