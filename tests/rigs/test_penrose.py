"""The Penrose tiling, its density, its correction table, its lights."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from stratalux import EnvironmentMap
from stratalux.rigs.penrose import BINS, DENSITY, correction_frame, correction_table, penrose, root_scale, tiling_points
from stratalux.rigs.voronoi import texel_directions
from tests.rigs.maps import MAPS


def uniform(shape: tuple[int, int], points: float) -> NDArray[np.float64]:
    """Density of so many points in the plane [0, W) x [0, H − 1]."""
    return np.full(shape, points / ((shape[0] - 1) * shape[1]))


def test_points_are_distinct_and_nest() -> None:
    density = uniform((65, 128), 1.0)
    few, many = (tiling_points(density, limit) for limit in (300.0, 900.0))
    places = {tuple(place) for place in np.round(many.origin, 6).tolist()}
    assert len(places) == len(many)
    assert {tuple(place) for place in np.round(few.origin, 6).tolist()} <= places
    assert few.appears.max() <= 300 < many.appears.max() <= 900


@given(st.floats(200, 4000))
@settings(max_examples=25)
def test_count_follows_importance(points: float) -> None:
    density = uniform((65, 128), points)
    assert len(tiling_points(density, 1.0)) == pytest.approx(points, rel=0.1)
    assert len(tiling_points(2 * density, 1.0)) == pytest.approx(2 * len(tiling_points(density, 1.0)), rel=0.1)


def test_density_is_local() -> None:
    density = np.concatenate([uniform((129, 128), 400), uniform((129, 128), 1600)], axis=1)
    x = tiling_points(density, 1.0).origin[:, 0]
    assert np.count_nonzero(x < 128) == pytest.approx(400, rel=0.1)
    assert np.count_nonzero(x >= 128) == pytest.approx(1600, rel=0.1)


def test_no_bright_texel_is_missed() -> None:
    bright = {(7, 99), (40, 3), (64, 50)}
    density = np.full((65, 128), 1e-9)
    for place in bright:
        density[place] = 1.0
    x, y = tiling_points(density, 3.0).origin.T
    assert bright <= set(zip(np.floor(y + 0.5).astype(int).tolist(), x.astype(int).tolist(), strict=True))


def low_frequency_power(points: NDArray[np.float64], side: float) -> float:
    """Power of a point set in a square at frequencies well below its own, 1 for white noise."""
    window = np.prod(np.sin(np.pi * points / side) ** 2, axis=1)
    k = np.stack(np.mgrid[-20:21, -20:21], axis=-1).reshape(-1, 2)
    k = k[(np.linalg.norm(k, axis=1) >= 6) & (np.linalg.norm(k, axis=1) <= 20)]
    waves = np.exp(2j * np.pi / side * (points @ k.T))
    return float(np.mean(np.abs(window @ waves) ** 2) / np.sum(window**2))


def spacing(points: NDArray[np.float64], side: float) -> float:
    """Mean distance to the nearest neighbour, 1 for a hexagonal lattice of as many points."""
    inner = np.all(np.abs(points - side / 2) < 0.4 * side, axis=1)
    hexagonal = np.sqrt(2 / np.sqrt(3) * side**2 / len(points))
    return float(cKDTree(points).query(points, 2)[0][inner, 1].mean() / hexagonal)


@pytest.mark.parametrize("points", [2000, 2700, 3600])
def test_correction_makes_noise_bluer(points: int) -> None:
    shape = (257, 256)
    tiling = tiling_points(uniform(shape, points), 1.0)
    root = root_scale(shape)
    rank = np.full(len(tiling), root**2 / DENSITY * points / 256**2)
    structure, phase, frame = correction_frame(tiling, rank, root)
    assert structure.min() >= 0
    assert structure.max() < BINS
    corrected = tiling.origin + np.einsum("pk,pkc->pc", correction_table()[structure, phase], frame)
    assert low_frequency_power(corrected, 256) < min(0.05, low_frequency_power(tiling.origin, 256) / 2)
    assert spacing(corrected, 256) > max(0.85, spacing(tiling.origin, 256))


def test_correction_table_is_complete() -> None:
    table = correction_table()
    assert table.shape == (BINS, BINS, 2)
    assert np.isfinite(table).all()
    assert 0 < np.abs(table).max() < 2


@pytest.mark.parametrize("correction", [True, False])
@pytest.mark.parametrize("n", [1, 2, 13, 100, 400])
@pytest.mark.parametrize("name", ["blobs", "hall", "random", "constant"])
def test_exact_number_of_lights(name: str, n: int, correction: bool) -> None:
    assert len(penrose(EnvironmentMap(MAPS[name]), n, correction=correction)) == n


def test_every_texel_can_have_a_light() -> None:
    rig = penrose(EnvironmentMap(MAPS["constant"]), 16 * 32, correction=False)
    assert len(rig) == 14 * 32 + 2  # a polar row is one place


def test_strata_are_voronoi_cells() -> None:
    rig = penrose(EnvironmentMap(MAPS["blobs"]), 80)
    points = texel_directions(64, 128)
    closeness = points @ rig.direction.T
    own = closeness[np.arange(len(points)), rig.label.ravel()]
    excess = np.arccos(np.clip(own, -1, 1)) - np.arccos(np.clip(closeness.max(axis=1), -1, 1))
    assert excess.max() <= 2 * np.pi / 64  # the cells are those of the texels that the lights are in
    assert np.mean(excess < 1e-6) > 0.95


def test_density_of_lights_follows_energy() -> None:
    texels = np.full((64, 128, 3), 1.0, np.float32)
    texels[:, 64:] = 3
    rig = penrose(EnvironmentMap(texels), 400)
    assert np.mean(rig.direction[:, 0] < 0) == pytest.approx(0.75, abs=0.03)
    # A uniform sphere has as many points in each band of equal height.
    y = rig.direction[rig.direction[:, 0] < 0, 1]
    assert np.mean(np.abs(y) < 0.5) == pytest.approx(0.5, abs=0.05)
