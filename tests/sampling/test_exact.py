"""Sums that do not depend on the order of their terms."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from tests.variants import RGB

mi.set_variant(RGB)
LANES, PLACES = 200_000, 7


def exact(order: np.ndarray, values: np.ndarray, place: np.ndarray, most: int = LANES) -> np.ndarray:
    from stratalux.sampling.exact import ExactSums  # of the active variant

    sums = ExactSums(PLACES, most)
    parts = [mi.Float(v[order]) for v in values]
    sums.begin(parts[:2], parts[2:])
    sums.add(parts, mi.UInt32(place[order]))
    return np.stack(list(sums))


def test_in_any_order_bit_for_bit_and_right() -> None:
    rng = np.random.default_rng(1)
    values = (rng.standard_normal((3, LANES)) * 10.0 ** rng.integers(-6, 7, (3, LANES))).astype(np.float32)
    place = rng.integers(0, PLACES, LANES).astype(np.uint32)
    first = exact(np.arange(LANES), values, place)
    for _ in range(3):
        np.testing.assert_array_equal(exact(rng.permutation(LANES), values, place), first)
    expected = [np.bincount(place, v.astype(np.float64), PLACES) for v in values]
    np.testing.assert_allclose(first, expected, rtol=1e-9)


def test_a_bright_place_takes_nothing_from_a_dim_one() -> None:
    values = np.full((3, 2), 1e-3, dtype=np.float32)
    values[:, 1] = 1e6
    found = exact(np.arange(2), values, np.array([0, 1], dtype=np.uint32), most=1 << 12)
    np.testing.assert_allclose(found[:, 0], values[:, 0], rtol=1e-5)
    np.testing.assert_allclose(found[:, 1], values[:, 1], rtol=1e-7)


def test_what_is_no_number_makes_none_of_its_place_alone() -> None:
    values = np.ones((3, 4), dtype=np.float32)
    values[1, 2] = np.nan
    values[0, 3] = np.inf
    found = exact(np.arange(4), values, np.array([0, 1, 2, 3], dtype=np.uint32))
    assert np.isnan(found[:, 2:4]).all()
    np.testing.assert_allclose(found[:, :2], 1)
    np.testing.assert_array_equal(found[:, 4:], 0)


def test_several_terms_of_a_lane_and_masked_ones() -> None:
    from stratalux.sampling.exact import ExactSums

    value, place = mi.Float([1, 2, 4]), mi.UInt32([0, 1, 2])
    sums = ExactSums(3, 6)
    sums.begin([value])
    sums.add([value], place)
    sums.add([value], 2 - place, mi.Bool([True, False, True]))
    dr.eval()
    np.testing.assert_array_equal(list(sums), [[5, 2, 5]])
