"""The points of a pixel: stratified in every aligned block, uniform and independent over seeds."""

from __future__ import annotations

from math import comb

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from stratalux.sampling.points import DIMENSIONS, mix, shuffle, sobol, sobol_2d, van_der_corput
from tests.helpers import ALPHA, sidak


def seeds(count: int) -> mi.UInt32:
    return mix(dr.arange(mi.UInt32, count) + 77)


@pytest.mark.parametrize("seed", [0, 1, 0xDEADBEEF])
@pytest.mark.parametrize("block", [0, 3, 1000])
def test_aligned_blocks_are_stratified(seed: int, block: int) -> None:
    bits = 8
    index = mi.UInt32(block << bits) + dr.arange(mi.UInt32, 1 << bits)
    one = van_der_corput(index, mi.UInt32(seed)).numpy() >> (32 - bits)
    assert sorted(one) == list(range(1 << bits))
    points = sobol_2d(index, mi.UInt32(seed)).numpy().T
    assert points.min() >= 0 and points.max() < 1
    for k in range(bits + 1):  # elementary intervals of every shape hold one point each
        cell = np.floor(points * [1 << k, 1 << (bits - k)]).astype(int)
        assert len({tuple(c) for c in cell}) == 1 << bits


@pytest.mark.parametrize("k", range(24, 32))
def test_high_bits_of_the_index_count(k: int) -> None:
    """Bit r of the second coordinate, from the highest down, is Σ C(k, r) i_k modulo 2 before it is scrambled.

    Pascal's triangle is its own inverse there, so each bit k can be undone in the upper 24 bits by lower ones. What is
    equal stays so when it is scrambled.
    """
    flips = 1 << k
    for r in range(24):
        if comb(k, r) % 2:
            flips ^= sum(comb(r, j) % 2 << j for j in range(r + 1))
    y = sobol_2d(mi.UInt32([5, 5 ^ flips]), mi.UInt32(9)).y.numpy()
    assert y[0] == y[1]
    assert y[0] != sobol_2d(mi.UInt32(5 ^ flips ^ 1 << 23), mi.UInt32(9)).y.numpy()[0]


def test_shuffling_keeps_blocks() -> None:
    index = dr.arange(mi.UInt32, 256)
    for bits in range(9):
        shuffled = shuffle(index, mi.UInt32(5)).numpy().reshape(-1, 1 << bits)
        assert len(np.unique(shuffled >> bits)) == len(shuffled)
        assert np.all(shuffled >> bits == (shuffled >> bits)[:, :1])


def test_every_point_is_uniform_and_independent_of_those_of_other_seeds() -> None:
    n, cells = 1 << 16, 16
    seed = seeds(n)
    indices = (0, 1, 6, 255, 4096)
    for index in indices:
        points = sobol_2d(mi.UInt32(index), seed).numpy().T
        counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=cells, range=[[0, 1], [0, 1]])
        assert stats.chisquare(counts.ravel()).pvalue > sidak(3 * len(indices))
        u = van_der_corput(mi.UInt32(index), seed).numpy() / 2.0**32
        assert stats.chisquare(np.histogram(u, 256, (0, 1))[0]).pvalue > sidak(3 * len(indices))
        # Neighbouring seeds, as neighbouring pixels have them
        counts, _, _ = np.histogram2d(u[:-1:2], u[1::2], bins=cells, range=[[0, 1], [0, 1]])
        assert stats.chisquare(counts.ravel()).pvalue > sidak(3 * len(indices))


def test_hashes_are_those_that_are_cited() -> None:
    """Once more, in Python's integers: a constant or a shift that is off by one would still spread, but less well."""
    most = (1 << 32) - 1

    def lowbias32(x: int) -> int:
        x = (x ^ x >> 16) * 0x7FEB352D & most
        x = (x ^ x >> 15) * 0x846CA68B & most
        return x ^ x >> 16

    def laine_karras(x: int, seed: int) -> int:
        x = x + seed & most
        for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
            x ^= x * factor & most
        return x

    def reverse(x: int) -> int:
        return int(f"{x:032b}"[::-1], 2)

    values = [0, 1, 2, 0x12345678, 0xDEADBEEF, most]
    x, seed = mi.UInt32(values), mi.UInt32(values[::-1])
    assert mix(x).numpy().tolist() == [lowbias32(v) for v in values]
    assert van_der_corput(x, seed).numpy().tolist() == [
        reverse(laine_karras(v, s)) for v, s in zip(values, values[::-1], strict=True)
    ]
    points = sobol_2d(mi.UInt32(0), seed).numpy().T.tolist()
    assert points == [[(reverse(laine_karras(0, k)) >> 8) / 2**24 for k in (s, lowbias32(s))] for s in values[::-1]]


def test_mix_is_one_to_one_and_spreads() -> None:
    values = mix(dr.arange(mi.UInt32, 1 << 18)).numpy()
    assert len(np.unique(values)) == 1 << 18
    assert stats.chisquare(np.histogram(values, 256, (0, 2**32))[0]).pvalue > ALPHA


def test_later_coordinates_are_those_of_the_same_sequence() -> None:
    """Before they are scrambled, they are SciPy's, which takes the points in the order of a Gray code."""
    from stratalux.sampling.points import _POLYNOMIALS, _columns

    theirs = stats.qmc.Sobol(DIMENSIONS, scramble=False, bits=32).random(1 << 10)
    number = np.arange(1 << 10)
    gray = number ^ number >> 1
    for dimension, polynomial in enumerate(_POLYNOMIALS, start=2):
        bits = np.zeros(len(gray), dtype=np.int64)
        for k, column in enumerate(_columns(*polynomial)):
            bits ^= np.where(gray >> k & 1, column, 0)
        np.testing.assert_array_equal(bits / 2.0**32, theirs[:, dimension])


@pytest.mark.parametrize("dimension", range(2, DIMENSIONS))
def test_later_coordinates_are_stratified_and_uniform(dimension: int) -> None:
    for block in (0, 3, 1 << 20):
        index = mi.UInt32(block << 8) + dr.arange(mi.UInt32, 256)
        values = sobol(index, dimension, mi.UInt32(7)).numpy()
        assert sorted(np.floor(values * 256)) == list(range(256))
    values = sobol(mi.UInt32(6), dimension, seeds(1 << 16)).numpy()
    assert values.max() < 1
    assert stats.chisquare(np.histogram(values, 256, (0, 1))[0]).pvalue > sidak(DIMENSIONS)


@pytest.mark.parametrize("bits", [1, 3, 6])
def test_points_in_the_order_of_where_they_are(bits: int) -> None:
    """Every block of 4^bits has one in each cell, and neighbours lie in cells that touch, for the most part."""
    from stratalux.sampling.points import sobol_cells

    order = sobol_cells(bits)
    assert sorted(order) == list(range(4**bits))
    for seed, block in ((1, 0), (77, 5)):
        points = np.array(sobol_2d(mi.UInt32(order) + block * 4**bits, mi.UInt32(seed)))
        cells = np.floor(points * 2**bits).astype(int)
        assert len(set(zip(*cells, strict=True))) == 4**bits
        steps = np.abs(np.diff(cells, axis=1)).max(axis=0)
        assert (steps <= 1).mean() >= 0.6
