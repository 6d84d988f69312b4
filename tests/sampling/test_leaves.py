from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from stratalux import EnvironmentMap, InputError, median_cut
from stratalux.maps.geometry import row_weights
from stratalux.sampling.leaves import FLOOR, cut_regions, equal_energy_leaves
from tests.helpers import hall_map, sun_map


def energy_before(environment: EnvironmentMap, x: float, y: float) -> float:
    """∫ over [0, x] x [0, y] of the density that is cut, cell by cell: another way than the summed-area table's."""
    luminance = environment.luminance.astype(np.float64)
    upper, lower = row_weights(environment.height)
    rows = np.append(upper, 0) + np.append(0, lower)
    luminance = luminance + FLOOR * (rows @ luminance.mean(axis=1)) / 2
    right = np.roll(luminance, -1, axis=1)
    s = np.clip(x - np.arange(environment.width), 0, 1)  # part of each column of cells, and of each row
    t = np.clip(y - np.arange(environment.height - 1), 0, 1)
    across = luminance * (s - s * s / 2) + right * (s * s / 2)
    down = upper * (2 * t - t * t), lower * t * t
    return float((down[0][:, None] * across[:-1] + down[1][:, None] * across[1:]).sum())


def energies(environment: EnvironmentMap, leaves: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array(
        [
            energy_before(environment, x + w, y + h)
            - energy_before(environment, x, y + h)
            - energy_before(environment, x + w, y)
            + energy_before(environment, x, y)
            for x, y, w, h in leaves
        ]
    )


@pytest.mark.parametrize("texels", [hall_map(), sun_map()], ids=["hall", "sun"])
@pytest.mark.parametrize("depth", [0, 1, 6, 9])
def test_energies_are_equal(texels: NDArray[np.float32], depth: int) -> None:
    environment = EnvironmentMap(texels)
    found = energies(environment, equal_energy_leaves(environment, depth))
    np.testing.assert_allclose(found, found.mean(), rtol=1e-6)


@settings(max_examples=50)
@given(st.integers(3, 12), st.integers(2, 17), st.integers(0, 8), st.integers(0, 2**32 - 1), st.floats(0, 8))
def test_leaves_tile_the_map(height: int, width: int, depth: int, seed: int, contrast: float) -> None:
    random = np.random.default_rng(seed)
    texels = np.exp(contrast * random.normal(size=(height, width, 3))) * (random.random((height, width, 1)) < 0.6)
    leaves = equal_energy_leaves(EnvironmentMap(texels.astype(np.float32)), depth)
    assert leaves.shape == (1 << depth, 4) and np.isfinite(leaves).all() and (leaves[:, 2:] >= 0).all()
    x, y, w, h = leaves.T
    assert x.min() >= 0 and y.min() >= 0 and (x + w).max() <= width + 1e-9 and (y + h).max() <= height - 1 + 1e-9
    np.testing.assert_allclose((w * h).sum(), width * (height - 1), rtol=1e-9)
    for point in random.random((20, 2)) * [width, height - 1]:
        assert ((x <= point[0]) & (point[0] < x + w) & (y <= point[1]) & (point[1] < y + h)).sum() == 1


def test_leaves_are_in_the_order_of_the_tree() -> None:
    environment = EnvironmentMap(hall_map())
    coarse, fine = equal_energy_leaves(environment, 4), equal_energy_leaves(environment, 9)
    groups = fine.reshape(16, 32, 4)
    np.testing.assert_allclose(groups[..., :2].min(axis=1), coarse[:, :2], atol=1e-9)
    np.testing.assert_allclose(
        (groups[..., :2] + groups[..., 2:]).max(axis=1), coarse[:, :2] + coarse[:, 2:], atol=1e-9
    )
    for level in range(9):  # of each two halves, the one on the left or above comes first
        halves = fine.reshape(1 << level, 2, -1, 4)[..., :2].min(axis=2)
        assert (halves[:, 0] <= halves[:, 1] + 1e-9).all()


@pytest.mark.parametrize("texels", [hall_map(), sun_map()], ids=["hall", "sun"])
def test_cuts_run_across_the_longer_side(texels: NDArray[np.float32]) -> None:
    """On the sphere: widths count with the sine of the latitude in the middle."""
    environment = EnvironmentMap(texels)
    width, height = environment.width, environment.height - 1
    for depth in range(8):
        _, y, w, h = equal_energy_leaves(environment, depth).T
        halves = equal_energy_leaves(environment, depth + 1).reshape(-1, 2, 4)
        vertical = 2 * w / width * np.sin(np.pi * (y + h / 2) / height) >= h / height
        for half in halves.swapaxes(0, 1):
            np.testing.assert_allclose(np.where(vertical, half[:, 3], half[:, 2]), np.where(vertical, h, w), rtol=1e-9)


@pytest.mark.parametrize("n", [3, 37])
def test_energies_are_equal_within_each_region(n: int) -> None:
    environment = EnvironmentMap(hall_map())
    regions = median_cut(environment, n)
    nodes = cut_regions(environment.energy_table, regions.bounds, 5).numpy().reshape(-1, 4)[: n << 5]
    leaves = np.concatenate([nodes[:, :2], nodes[:, 2:] - nodes[:, :2]], axis=1)
    found = energies(environment, leaves).reshape(n, 32)
    np.testing.assert_allclose(found, np.broadcast_to(found.mean(axis=1, keepdims=True), found.shape), rtol=1e-6)
    y0, y1, x0, x1 = regions.bounds.T
    np.testing.assert_allclose(nodes.reshape(n, 32, 4)[..., :2].min(axis=1), np.stack([x0, y0], axis=1), atol=1e-9)
    np.testing.assert_allclose(nodes.reshape(n, 32, 4)[..., 2:].max(axis=1), np.stack([x1, y1], axis=1), atol=1e-9)


def test_a_black_map_is_cut_all_the_same() -> None:
    leaves = equal_energy_leaves(EnvironmentMap(np.zeros((8, 16, 3), np.float32)), 5)
    np.testing.assert_allclose((leaves[:, 2] * leaves[:, 3]).sum(), 7 * 16)


@pytest.mark.parametrize("depth", [-1, 25])
def test_depth_out_of_range(depth: int) -> None:
    with pytest.raises(InputError, match="depth of the leaves"):
        equal_energy_leaves(EnvironmentMap(hall_map()), depth)
