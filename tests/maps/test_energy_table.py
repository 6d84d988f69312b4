from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import EnvironmentMap
from stratalux.maps import energy_table
from stratalux.maps.energy_table import EnergyTable
from tests.helpers import hall_map, sun_map


@pytest.mark.parametrize("texels", [hall_map(), sun_map(), hall_map(150, 9)], ids=["hall", "sun", "tall"])
def test_energy_of_whole_cells(texels: NDArray[np.float32]) -> None:
    """Against sums of the energies of cells, which are integrated one by one."""
    environment = EnvironmentMap(texels)
    table, cells = environment.energy_table, environment.cell_energy
    assert (table.height - 1, table.width) == cells.shape
    expected = np.zeros((environment.height, environment.width + 1))
    expected[1:, 1:] = cells.cumsum(axis=0).cumsum(axis=1)
    before = table.whole_cells()
    np.testing.assert_allclose(before - before[:, :1], expected, rtol=1e-9, atol=1e-12 * cells.sum())
    bounds = np.array([[0, 3, 0, 5], [2, environment.height - 1, 1, environment.width]])
    corners = [[[before[y, x] for x in b[2:]] for y in b[:2]] for b in bounds]
    np.testing.assert_allclose(table.corners(bounds), corners)
    assert table.total == pytest.approx(cells.sum())


def test_views_of_larger_arrays_give_the_same() -> None:
    """The emitter's texels have a column more on either side."""
    texels = hall_map()
    padded = np.pad(texels, ((0, 0), (1, 1), (0, 0)), mode="wrap")
    np.testing.assert_array_equal(EnergyTable.build(padded[:, 1:-1]).sums, EnergyTable.build(texels).sums)


@pytest.mark.parametrize("kind", [np.float32, np.float16])
def test_of_many_texels_it_is_in_whole_numbers(monkeypatch: pytest.MonkeyPatch, kind: Any) -> None:
    texels = sun_map(70, 100)
    texels[:, 0] *= 3  # the column that counts twice
    texels = np.minimum(texels, 6e4).astype(kind)
    expected = EnergyTable.build(texels.astype(np.float32), less=0.5)
    monkeypatch.setattr(energy_table, "_MANY", 1)
    table = EnergyTable.build(texels, less=0.5)
    assert table.sums.dtype == np.uint32 and table.total == pytest.approx(expected.total, rel=1e-9)
    np.testing.assert_allclose(table.sums * table.unit, expected.sums, atol=1e-9 * expected.total)
    np.testing.assert_allclose(table.whole_cells(), expected.whole_cells(), atol=1e-9 * expected.total)
    bounds = np.array([[0, 69, 0, 100], [3, 40, 7, 99]])
    np.testing.assert_allclose(table.corners(bounds), expected.corners(bounds), atol=1e-9 * expected.total)


def test_a_black_map_of_many_texels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(energy_table, "_MANY", 1)
    table = EnergyTable.build(np.zeros((5, 8, 3), dtype=np.float16))
    assert table.total == 0 and not table.sums.any() and table.unit > 0
