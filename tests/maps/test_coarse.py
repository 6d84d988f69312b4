"""The coarse density has light in reach wherever the map has."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from stratalux.maps import coarse
from stratalux.maps.coarse import coarse_density


@pytest.mark.parametrize("kind", [np.float32, np.float16])
@pytest.mark.parametrize("most", [4, 1 << 20])
def test_a_sun_is_in_the_density_around_it(monkeypatch: pytest.MonkeyPatch, most: int, kind: Any) -> None:
    monkeypatch.setattr(coarse, "_HEIGHT", most)
    monkeypatch.setattr(coarse, "_WIDTH", 2 * most)
    for row, column in ((5, 0), (11, 31), (20, 17)):
        texels = np.zeros((24, 32, 3), dtype=kind)
        texels[row, column] = 1000
        density = coarse_density(texels)
        rows, columns = density.shape
        assert density.dtype == np.float32 and rows - 1 <= min(most, 24) and columns - 1 <= min(2 * most, 32)
        np.testing.assert_array_equal(density[:, 0], density[:, -1])
        x, y = (column + 0.5) / 32 * (columns - 1), row / 23 * (rows - 1)
        cell = density[int(y) : int(y) + 2, int(x) : int(x) + 2]
        assert cell[cell > 0].min() > 10 * np.median(density) and (cell > 0).sum() >= 2  # 0 at a pole
    assert (density[1:-1] > 0).all() and (density[[0, -1]] < 1e-6).all()


def test_a_black_map_is_sampled_evenly() -> None:
    density = coarse_density(np.zeros((12, 24, 3), dtype=np.float32))
    np.testing.assert_allclose(density[:, 3], np.sin(np.linspace(0, np.pi, 13)), atol=1e-6)
