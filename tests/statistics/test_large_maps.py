"""Tables in single precision hold for a map of 16384x8192 whose sun is one texel."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from stratalux import EnvironmentMap
from stratalux.images.reading import default_memory
from stratalux.maps.median_cut import median_cut
from tests.helpers import ALPHA
from tests.variants import RGB

HEIGHT, WIDTH = 8192, 16384
ROWS, COLUMNS = 8, 16
"""Of blocks that samples are counted in, beside the cells around the sun."""
SUN = HEIGHT // 4 + 37, WIDTH // 3 + 11
COUNT = 1 << 22


@pytest.fixture(scope="module")
def environment() -> EnvironmentMap:
    """A sky with noise, and a sun that is a fifth of all light."""
    if default_memory() < 8 << 30:
        pytest.skip("takes 8 GB of memory")
    mi.set_variant(RGB)
    rng = np.random.default_rng(1)
    texels = np.empty((HEIGHT, WIDTH, 3), dtype=np.float32)
    for row in range(HEIGHT):
        texels[row] = (0.1 + (1 - row / HEIGHT) ** 4) * rng.uniform(0.5, 1.5, (WIDTH, 1)).astype(np.float32)
    texels[SUN] = 0.05 * HEIGHT * WIDTH
    return EnvironmentMap(texels)


def counted(uv: mi.Point2f) -> np.ndarray:
    """How many are in each block, and how many of all within two cells of the sun."""
    x, y = np.array(uv.x).astype(np.float64) % 1 * WIDTH - 0.5, np.array(uv.y).astype(np.float64) * (HEIGHT - 1)
    x %= WIDTH
    near = (np.abs(x - SUN[1]) < 2) & (np.abs(y - SUN[0]) < 2)
    edges = np.linspace(0, HEIGHT - 1, ROWS + 1), np.linspace(0, WIDTH, COLUMNS + 1)
    blocks, *_ = np.histogram2d(y[~near], x[~near], edges)
    return np.append(blocks.ravel(), near.sum())


def overlaps(first: np.ndarray, length: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """The part of each interval that lies between neighbouring edges, (N, K)."""
    ends = np.clip(edges, first[:, None], (first + length)[:, None])
    return np.diff(ends, axis=1) / length[:, None]


@pytest.mark.slow
def test_leaves(environment: EnvironmentMap) -> None:
    """Those in single precision tile the map, and samples are where those in double precision say."""
    from stratalux.sampling.leaf_sampler import DEPTH, LeafSampler
    from stratalux.sampling.leaves import equal_energy_leaves

    sampler = LeafSampler(environment)
    _, _, width, height = sampler._leaves.numpy().reshape(-1, 4).astype(np.float64).T
    assert (width * height).sum() == pytest.approx(1, abs=1e-5) and (width > 0).all() and (height > 0).all()
    rng = mi.PCG32(size=COUNT)
    leaf = dr.arange(mi.UInt32, COUNT) & ((1 << DEPTH) - 1)
    found = counted(sampler.sample(leaf, mi.Point2f(rng.next_float32(), rng.next_float32())).uv)

    x, y, width, height = equal_energy_leaves(environment, DEPTH).T
    down = overlaps(y, height, np.linspace(0, HEIGHT - 1, ROWS + 1))
    across = overlaps(x, width, np.linspace(0, WIDTH, COLUMNS + 1))
    near = (
        overlaps(x, width, np.array([SUN[1] - 2.0, SUN[1] + 2.0]))
        * overlaps(y, height, np.array([SUN[0] - 2.0, SUN[0] + 2.0]))
    )[:, 0]
    blocks = down.T @ across
    row, column = (
        int(place * parts / size) for place, parts, size in zip(SUN, (ROWS, COLUMNS), (HEIGHT - 1, WIDTH), strict=True)
    )
    blocks[row, column] -= near.sum()
    expected = np.append(blocks.ravel(), near.sum()) / len(x)
    assert expected[-1] > 0.1  # the sun
    assert expected.sum() == pytest.approx(1, abs=1e-5)
    # Each leaf has as many samples as any other, so that they vary less than independent ones.
    statistic = np.sum((found - COUNT * expected) ** 2 / (COUNT * expected))
    assert stats.chi2.sf(statistic, len(expected) - 1) > ALPHA


@pytest.mark.slow
def test_cells(environment: EnvironmentMap) -> None:
    """The probabilities of all cells add up to one, and samples are where the energy is."""
    from stratalux.sampling.region_sampler import RegionSampler

    sampler = RegionSampler(environment, median_cut(environment, 1))
    units = np.diff(sampler._cdf.numpy().astype(np.int64), prepend=0)
    assert (units > 0).all() and units.sum() / (1 << 31) == pytest.approx(1, abs=1e-5)
    rng = mi.PCG32(size=COUNT)
    u, inside = (mi.Point2f(rng.next_float32(), rng.next_float32()) for _ in range(2))
    found = counted(sampler.sample(mi.UInt32(0), u, inside).uv)
    cells = units.reshape(HEIGHT - 1, WIDTH) / (1 << 31)
    near = cells[SUN[0] - 2 : SUN[0] + 2, SUN[1] - 2 : SUN[1] + 2]
    total = near.sum()
    near[:] = 0
    rows = np.linspace(0, HEIGHT - 1, ROWS + 1)
    by_column = np.add.reduceat(cells, np.arange(0, WIDTH, WIDTH // COLUMNS), axis=1)
    before = np.concatenate([np.zeros((1, COLUMNS)), np.cumsum(by_column, axis=0)])
    whole = np.minimum(rows.astype(int), HEIGHT - 2)
    part = before[whole] + (rows - whole)[:, None] * by_column[whole]
    expected = np.append(np.diff(part, axis=0).ravel(), total)
    assert expected[-1] > 0.1 and expected.sum() == pytest.approx(1, abs=1e-5)
    assert stats.chisquare(found, expected * COUNT / expected.sum()).pvalue > ALPHA
