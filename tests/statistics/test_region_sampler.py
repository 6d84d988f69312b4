"""Chi-square tests of the region sampler against its own density."""

from __future__ import annotations

import warnings

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from stratalux import EnvironmentMap, median_cut
from stratalux.sampling.region_sampler import RegionSampler, RegionTables, _integer_cdf
from tests.helpers import hall_map, sidak, sun_map

SAMPLES = 400_000
SUB = 2
"""Bins per cell and axis. Inside a bin u, v the density is bilinear, so its value in the middle is its mean."""


def black_half() -> NDArray[np.float32]:
    texels = hall_map(17, 34)
    texels[:, 17:] = 0
    return texels


def single_texel() -> NDArray[np.float32]:
    texels = np.zeros((9, 18, 3), dtype=np.float32)
    texels[3, 7] = [5, 0, 0]
    return texels


def polar() -> NDArray[np.float32]:
    texels = np.zeros((9, 18, 3), dtype=np.float32)
    texels[0] = texels[-1] = 1
    return texels


MAPS = {
    "sun": lambda: sun_map(16, 32),
    "hall, odd size": lambda: hall_map(25, 47),
    "black half": black_half,
    "single texel": single_texel,
    "only the poles": polar,
    "1x1": lambda: np.full((1, 1, 3), 2, dtype=np.float32),
    "2x1": lambda: np.array([[[1, 0, 0], [0, 0, 9]]], dtype=np.float32),
    "constant": lambda: np.ones((5, 9, 3), dtype=np.float32),
}


def environment(name: str) -> EnvironmentMap:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return EnvironmentMap.from_array(MAPS[name]())


def expected(sampler: RegionSampler, height: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Probability of every bin of the map within its region, from ``pdf``, and the index of that region."""
    rows, columns = SUB * (height - 1), SUB * width
    i, j = (k.ravel() for k in np.mgrid[0:rows, 0:columns])
    u = mi.Float(((j + 0.5) / columns + 0.5 / width).astype(np.float32))
    v = mi.Float(((i + 0.5) / rows).astype(np.float32))
    sin_theta = dr.sin(dr.pi * v)
    phi = dr.two_pi * u
    pdf, region = sampler.pdf(mi.Vector3f(dr.sin(phi) * sin_theta, dr.cos(dr.pi * v), -dr.cos(phi) * sin_theta))
    mass = pdf.numpy().astype(np.float64) * 2 * np.pi**2 * sin_theta.numpy() / (rows * columns)
    return mass, region.numpy().astype(np.int64)


def histogram(
    sampler: RegionSampler, region: int, height: int, width: int, two_dimensional: bool = False
) -> NDArray[np.int64]:
    generator = mi.load_dict({"type": "independent"})
    generator.seed(region + 1, SAMPLES)
    if two_dimensional:
        u, fine, inside = (generator.next_2d() for _ in range(3))
        sample = sampler.sample_2d(mi.UInt32(region), u, fine, inside)
    else:
        sample = sampler.sample(mi.UInt32(region), generator.next_2d(), generator.next_2d())
    # Only a point that rounds to a pole or to a black corner may have no density.
    assert (sample.pdf.numpy() == 0).mean() < 1e-5
    rows, columns = SUB * (height - 1), SUB * width
    u = np.mod(sample.uv.x.numpy().astype(np.float64) - 0.5 / width, 1)
    i = np.minimum((sample.uv.y.numpy().astype(np.float64) * rows).astype(np.int64), rows - 1)
    j = np.minimum((u * columns).astype(np.int64), columns - 1)
    return np.bincount(i * columns + j, minlength=rows * columns)


def chi_square(observed: NDArray[np.int64], mass: NDArray[np.float64]) -> float:
    """p-value, bins of less than five expected samples pooled into one."""
    frequency = mass * SAMPLES
    impossible = mass == 0
    assert observed[impossible].sum() <= 2e-5 * SAMPLES  # single precision rounds some points across a border
    frequency, observed = frequency[~impossible], observed[~impossible]
    small = frequency < 5
    expected = np.append(frequency[~small], frequency[small].sum())
    counted = np.append(observed[~small], observed[small].sum())
    if expected[-1] < 5:
        assert counted[-1] < 30
        expected, counted = expected[:-1], counted[:-1]
    statistic = ((counted - expected) ** 2 / expected).sum()
    return float(stats.chi2.sf(statistic, max(len(expected) - 1, 1)))


@pytest.mark.parametrize("n", [1, 5, 64])
@pytest.mark.parametrize("name", list(MAPS))
def test_samples_follow_the_pdf(name: str, n: int) -> None:
    env = environment(name)
    regions = median_cut(env, n)
    sampler = RegionSampler(env, regions)
    mass, owner = expected(sampler, env.height, env.width)
    tested = np.unique(np.linspace(0, len(regions) - 1, 6).astype(int)).tolist()
    for region in tested:
        inside = np.where(owner == region, mass, 0)
        assert inside.sum() == pytest.approx(1, rel=1e-4)
        p = chi_square(histogram(sampler, region, env.height, env.width), inside)
        assert p > sidak(len(MAPS) * 3 * len(tested)), f"region {region}: p = {p:.2g}"


def test_the_test_has_teeth() -> None:
    """A density that is wrong by 5 % in half of the map is rejected."""
    env = environment("hall, odd size")
    sampler = RegionSampler(env, median_cut(env, 1))
    mass, _ = expected(sampler, env.height, env.width)
    wrong = mass * np.where(np.arange(mass.size) % 2, 1.05, 0.95)
    assert chi_square(histogram(sampler, 0, env.height, env.width), wrong / wrong.sum()) < 1e-6


@pytest.mark.parametrize("n", [1, 37])
@pytest.mark.parametrize("name", list(MAPS))
def test_sample_and_pdf_agree(name: str, n: int) -> None:
    env = environment(name)
    regions = median_cut(env, n)
    sampler = RegionSampler(env, regions)
    generator = mi.load_dict({"type": "independent"})
    generator.seed(3, 20000)
    region = mi.UInt32(np.arange(20000) % len(regions))
    sample = sampler.sample(region, generator.next_2d(), generator.next_2d())
    pdf, index = sampler.pdf(sample.d)
    # Close to a border the direction may round into the neighbour.
    same = index.numpy() == region.numpy()
    assert same.mean() > 0.99
    error = np.abs(pdf.numpy()[same] / sample.pdf.numpy()[same] - 1)
    assert np.median(error) < 1e-4 and (error < 0.01).mean() > 0.998


@pytest.mark.parametrize("name", list(MAPS))
def test_density_is_positive_wherever_the_lookup_is(name: str) -> None:
    env = environment(name)
    sampler = RegionSampler(env, median_cut(env, 16))
    emitter = mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(env.texels)})
    generator = mi.load_dict({"type": "independent"})
    generator.seed(5, 200000)
    d = mi.warp.square_to_uniform_sphere(generator.next_2d())
    si = dr.zeros(mi.SurfaceInteraction3f, 200000)
    si.wi = -d
    radiance = dr.max(emitter.eval(si)).numpy()
    pdf = sampler.pdf(d)[0].numpy()
    # Lookup and density round a direction to a cell independently: allow for what lies on a border of black.
    assert (pdf[radiance > 1e-4 * radiance.max()] > 0).all()
    assert np.isfinite(pdf).all()


@pytest.mark.parametrize("name", list(MAPS))
def test_every_cell_with_energy_can_be_drawn(name: str) -> None:
    env = environment(name)
    regions = median_cut(env, 8)
    tables = RegionTables.build(env, regions)
    for (y0, x0, width, first, *_), (b0, b1, _, _) in zip(tables.layout.tolist(), regions.bounds.tolist(), strict=True):
        cells = (b1 - b0) * width
        units = np.diff(tables.cdf[first : first + cells].astype(np.int64), prepend=0)
        energy = env.cell_energy[y0 : y0 + b1 - b0, x0 : x0 + width].ravel()
        assert (units[energy > 0] >= 1).all() and (units[energy == 0] == 0).all()
        assert units.sum() == 1 << 31
        np.testing.assert_allclose(units / 2**31, energy / energy.sum(), atol=2 * cells / 2**31)


@settings(max_examples=50)
@given(st.integers(1, 200), st.integers(0, 2**32 - 1), st.floats(0, 30))
def test_units_are_shared_out_in_proportion(count: int, seed: int, contrast: float) -> None:
    random = np.random.default_rng(seed)
    weights = np.exp(-contrast * random.random(count)) * (random.random(count) < 0.7)
    units = np.diff(_integer_cdf(weights).astype(np.int64), prepend=0)
    if weights.any():
        assert (units[weights > 0] >= 1).all() and (units[weights == 0] == 0).all() and units.sum() == 1 << 31
        np.testing.assert_allclose(units, 2**31 * weights / weights.sum(), atol=count + 1)
    else:
        assert (units == 0).all()


def test_dim_cells_at_the_end_have_units_too() -> None:
    units = np.diff(_integer_cdf(np.array([1.0, *[1e-15] * 9, 0.0])).astype(np.int64), prepend=0)
    np.testing.assert_allclose(units, [(1 << 31) - 9, *[1] * 9, 0], rtol=0, atol=1)
    assert units[:10].min() == 1 and units.sum() == 1 << 31 and units[10] == 0


def test_a_black_region_has_no_density() -> None:
    env = EnvironmentMap(np.zeros((5, 8, 3), dtype=np.float32))
    sampler = RegionSampler(env, median_cut(env, 4))
    sample = sampler.sample(mi.UInt32([0, 0]), mi.Point2f(0.3, 0.9), mi.Point2f(0.5, 0.1))
    assert (sample.pdf.numpy() == 0).all()
    assert np.isfinite(sample.d.numpy()).all()


def test_rolling_the_map_rolls_the_density() -> None:
    texels, k = hall_map(24, 48), 7
    generator = mi.load_dict({"type": "independent"})
    generator.seed(9, 20000)
    d = mi.warp.square_to_uniform_sphere(generator.next_2d())
    angle = 2 * np.pi * k / 48
    turned = mi.Vector3f(d.x * np.cos(angle) - d.z * np.sin(angle), d.y, d.x * np.sin(angle) + d.z * np.cos(angle))
    env, rolled = EnvironmentMap(texels), EnvironmentMap(np.roll(texels, k, axis=1))
    before = RegionSampler(env, median_cut(env, 1)).pdf(d)[0].numpy()
    after = RegionSampler(rolled, median_cut(rolled, 1)).pdf(turned)[0].numpy()
    close = np.isclose(before, after, rtol=1e-2)
    assert close.mean() > 0.99  # all but points that round across a border of cells


@pytest.mark.parametrize("n", [1, 5])
@pytest.mark.parametrize("name", list(MAPS))
def test_two_dimensional_inversion_follows_the_pdf(name: str, n: int) -> None:
    env = environment(name)
    sampler = RegionSampler(env, median_cut(env, n))
    mass, owner = expected(sampler, env.height, env.width)
    region = sampler.count - 1
    observed = histogram(sampler, region, env.height, env.width, two_dimensional=True)
    assert chi_square(observed, np.where(owner == region, mass, 0)) > sidak(2 * len(MAPS))
