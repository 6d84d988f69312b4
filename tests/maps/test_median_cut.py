"""Properties of the partition."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from stratalux import EnvironmentMap, InputError, Regions, median_cut, region_content
from stratalux.images.colour import LUMINANCE
from tests.helpers import asset, hall_map, sun_map

texels = hnp.arrays(
    np.float32,
    st.tuples(st.integers(3, 12), st.integers(2, 17), st.just(3)),
    elements=st.one_of(st.just(0.0), st.floats(0.015625, 1e5, width=32)),
)


def owners(regions: Regions) -> NDArray[np.int64]:
    """How many regions own each cell."""
    count = np.zeros((regions.shape[0] - 1, regions.shape[1]), dtype=np.int64)
    for y0, y1, x0, x1 in regions.bounds.tolist():
        assert y0 < y1 and x0 < x1
        count[y0:y1, x0:x1] += 1
    return count


@given(texels, st.integers(1, 70))
@settings(max_examples=200)
def test_regions_tile_the_map(array: NDArray[np.float32], n: int) -> None:
    environment = EnvironmentMap(array)
    regions = median_cut(environment, n)
    assert 1 <= len(regions) <= n
    assert (owners(regions) == 1).all()
    assert regions.solid_angle.sum() == pytest.approx(4 * np.pi)
    assert regions.energy.sum() == pytest.approx(environment.cell_energy.sum(), rel=1e-9, abs=1e-30)
    if array.any():
        assert (regions.energy > 0).all()
    index = regions.index_map()
    for i, (y0, y1, x0, x1) in enumerate(regions.bounds.tolist()):
        assert (index[y0:y1, x0:x1] == i).all()


@given(texels, st.integers(1, 40), st.integers(-20, 20))
@settings(max_examples=100)
def test_scaling_changes_nothing(array: NDArray[np.float32], n: int, exponent: int) -> None:
    scaled = EnvironmentMap(np.ldexp(array, exponent))
    regions, others = median_cut(EnvironmentMap(array), n), median_cut(scaled, n)
    np.testing.assert_array_equal(regions.bounds, others.bounds)
    np.testing.assert_allclose(np.ldexp(regions.energy, exponent), others.energy)


@given(texels, st.integers(0, 16))
@settings(max_examples=100)
def test_rolling_rolls_the_cells_and_nothing_else(array: NDArray[np.float32], k: int) -> None:
    energy = EnvironmentMap(array).cell_energy
    rolled = EnvironmentMap(np.roll(array, k, axis=1))
    np.testing.assert_allclose(rolled.cell_energy, np.roll(energy, k, axis=1), rtol=1e-6)
    assert median_cut(rolled, 1).energy[0] == pytest.approx(energy.sum(), rel=1e-6)


@pytest.mark.parametrize("make", [hall_map, sun_map])
@pytest.mark.parametrize("n", [2, 4, 8, 16])
def test_every_cut_balances_as_well_as_cells_allow(make: object, n: int) -> None:
    """Siblings differ by no more than the row or column of cells at the cut; this bounds the spread of energies."""
    environment = EnvironmentMap(make())  # type: ignore[operator]
    energy = environment.cell_energy

    def total(b: tuple[int, int, int, int]) -> float:
        return float(energy[b[0] : b[1], b[2] : b[3]].sum())

    before = [tuple(b) for b in median_cut(environment, n // 2).bounds.tolist()]
    after = [tuple(b) for b in median_cut(environment, n).bounds.tolist()]
    checked = 0
    for y0, y1, x0, x1 in before:
        parts = [b for b in after if y0 <= b[0] and b[1] <= y1 and x0 <= b[2] and b[3] <= x1]
        if len(parts) != 2:
            assert parts == [(y0, y1, x0, x1)]
            continue
        a, b = parts
        if a[1] == b[0]:
            strips = energy[a[1] - 1, x0:x1].sum(), energy[a[1], x0:x1].sum()
        else:
            strips = energy[y0:y1, a[3] - 1].sum(), energy[y0:y1, a[3]].sum()
        assert abs(total(a) - total(b)) <= max(strips) * (1 + 1e-9)
        checked += 1
    assert checked


def test_a_smooth_map_is_cut_into_equal_energies() -> None:
    v = np.linspace(0, np.pi, 257)[:, None, None]
    smooth = np.broadcast_to(2 + np.cos(v), (257, 512, 3)).astype(np.float32)
    energy = median_cut(EnvironmentMap(smooth), 64).energy
    assert len(energy) == 64
    assert energy.max() / energy.min() < 1.05


@pytest.mark.parametrize("rows", [(0, 11, 16, 21, 32), (0, 1, 2, 3, 4)], ids=["fine", "coarse"])
def test_a_width_counts_times_the_sine_of_its_latitude(rows: tuple[int, ...]) -> None:
    """A uniform map: quarters of longitude, cut at the equator, and then across their height again.

    A half of longitude is as wide as high, and cut across its width. A quarter of a hemisphere is 90 degrees high, and
    90 sin 45 = 64 degrees wide. With 32 rows of cells, the energy above row k is as 1 − cos(π k / 32), so half of a
    hemisphere's is nearest at k = 11.
    """
    environment = EnvironmentMap(np.ones((rows[-1] + 1, 2 * rows[-1], 3), np.float32))
    columns = tuple(k * rows[-1] // 2 for k in range(5))
    for n, ys in ((4, rows[::4]), (8, rows[::2]), (16, rows)):
        expected = {(y0, y1, x0, x1) for y0, y1 in pairwise(ys) for x0, x1 in pairwise(columns)}
        assert {tuple(bounds) for bounds in median_cut(environment, n).bounds.tolist()} == expected


def test_any_number_of_regions() -> None:
    environment = EnvironmentMap(hall_map())
    for n in (1, 2, 3, 5, 16, 37, 64, 100):
        assert len(median_cut(environment, n)) == n


def test_what_cannot_be_cut_is_left() -> None:
    black = np.zeros((3, 2, 3), dtype=np.float32)
    assert len(median_cut(EnvironmentMap(black), 64)) == 1
    white = black + 1
    assert len(median_cut(EnvironmentMap(white), 64)) == 4  # 2 x 2 cells
    single = np.zeros((9, 18, 3), dtype=np.float32)
    single[4, 9] = 1
    assert len(median_cut(EnvironmentMap(single), 64)) == 4  # the four cells around the texel


@pytest.mark.parametrize("n", [0, -3])
def test_too_few_regions_are_refused(n: int) -> None:
    with pytest.raises(InputError, match=f"{n} is too few"):
        median_cut(EnvironmentMap(hall_map()), n)


def test_content_adds_up_and_points_at_the_light() -> None:
    environment = EnvironmentMap(hall_map())
    regions = median_cut(environment, 37)
    content = region_content(environment, regions)
    np.testing.assert_allclose(content.flux @ LUMINANCE, regions.energy, rtol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(content.direction, axis=1), 1)
    whole = median_cut(environment, 1)
    np.testing.assert_allclose(region_content(environment, whole).flux[0], content.flux.sum(axis=0))
    # One bright texel: the centroid of its surroundings is its own direction.
    single = np.zeros((65, 128, 3), dtype=np.float32)
    single[20, 40] = 1
    only = EnvironmentMap(single)
    theta, phi = np.pi * 20 / 64, 2 * np.pi * 40.5 / 128
    expected = [np.sin(phi) * np.sin(theta), np.cos(theta), -np.cos(phi) * np.sin(theta)]
    np.testing.assert_allclose(region_content(only, median_cut(only, 1)).direction[0], expected, atol=1e-9)


@pytest.mark.parametrize("name", ["grace_latlong.exr", "venice.hdr", "night.hdr"])
def test_real_maps(name: str) -> None:
    environment = EnvironmentMap.load(asset(f"envmaps/{name}"))
    regions = median_cut(environment, 64)
    assert len(regions) == 64
    assert (owners(regions) == 1).all()
    assert regions.energy.sum() == pytest.approx(environment.cell_energy.sum())
