"""The points of one shading point, which can be drawn again."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from stratalux import EnvironmentMap, median_cut
from tests.helpers import hall_map

LANES = 64


@pytest.mark.parametrize("sequence", ["independent", "sobol"])
def test_points_are_the_same_from_the_start(sequence: str) -> None:
    """And others at each shading point; with low discrepancy, those of a point are stratified over the map."""
    from stratalux.integrators.direct_importance import Points  # of the active variant
    from stratalux.sampling.region_sampler import RegionSampler

    environment = EnvironmentMap(hall_map())
    tables = RegionSampler(environment, median_cut(environment, 1))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, LANES)
    points = Points(sampler, sequence, mi.Bool(True))
    drawn = []
    for _ in range(2):
        rng = points.start()
        drawn.append([tables_of(points, tables, i, rng) for i in range(16)])
    first, again = np.array(drawn)
    np.testing.assert_array_equal(first, again)
    assert len(np.unique(first[:, 0].round(6))) > 0.95 * 16 * LANES
    offset = points.offset.numpy()
    assert offset.min() >= 0 and offset.max() < 1 and len(np.unique(offset)) == LANES

    # The rank of a row among all cells, by energy, is what the second coordinate was.
    energy = np.cumsum(environment.cell_energy.sum(axis=1))
    row = np.minimum((first[:, 1] * (environment.height - 1)).astype(int), environment.height - 2)
    rank = (energy[row] - 0.5 * environment.cell_energy.sum(axis=1)[row]) / energy[-1]
    spread = np.sort(rank, axis=0) - (np.arange(16)[:, None] + 0.5) / 16
    assert (np.abs(spread).mean() < 0.05) == (sequence == "sobol")


def tables_of(points: object, tables: object, i: int, rng: mi.PCG32) -> np.ndarray:
    dr.eval(rng)  # or each point would be a larger kernel
    uv = points.draw(tables, dr.opaque(mi.UInt32, i), rng, mi.Bool(True)).uv  # type: ignore[attr-defined]
    return np.stack([np.broadcast_to(x.numpy(), LANES) for x in (uv.x, uv.y)])


def test_seeds_differ_where_floats_do() -> None:
    from stratalux.integrators.direct_importance import _bits

    bits = _bits(mi.Float(np.arange(1 << 12, dtype=np.float32) * 2.0**-23)).numpy()
    assert len(np.unique(bits)) == 1 << 12 and 0.45 < (bits >> 31).mean() < 0.55
