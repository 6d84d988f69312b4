"""Pixels that share belong to one tile, whose place changes from sample to sample."""

from __future__ import annotations

from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.variants import RGB

mi.set_variant(RGB)

SIDES = st.integers(1, 40)


@given(SIDES, SIDES, st.integers(0, 100))
def test_every_pixel_is_in_one_tile(width: int, height: int, sample: int) -> None:
    from stratalux.integrators.indirect.tiles import COLUMNS, ROWS, TILE, Tiles  # of the active variant

    count = width * height
    pixel, index, (first, last) = Tiles(width, height).pixels(sample * count, count)
    place, begin, end = pixel.numpy(), first.numpy(), last.numpy()
    assert sorted(place) == list(range(count)) and (index.numpy() == sample).all()
    lane = np.arange(count)
    assert ((begin <= lane) & (lane < end) & (end - begin <= TILE)).all()
    for start, stop in set(zip(begin, end, strict=True)):
        assert (begin[start:stop] == start).all() and (end[start:stop] == stop).all()
        y, x = np.divmod(place[start:stop], width)
        if np.ptp(y) < ROWS and height >= 2 * ROWS:
            assert np.ptp(x) <= 2 * COLUMNS * ROWS  # of one strip, whose first and last may have fewer rows
    # Of smaller ones there are two at each end of the film, and those that areas do not fill.
    assert len(set(begin)) <= count // TILE + 6


def test_neighbours_change() -> None:
    """Two pixels beside each other share as often as chance has it, and no two of them always or never."""
    from stratalux.integrators.indirect.tiles import COLUMNS, ROWS, TILE, Tiles

    width, height, samples = 32, 24, 256
    count = width * height
    beside = np.zeros(count - 1)
    for sample in range(samples):
        pixel, _, (first, _) = Tiles(width, height).pixels(sample * count, count)
        tile = np.empty(count, dtype=int)
        tile[pixel.numpy()] = first.numpy()
        beside += tile[1:] == tile[:-1]
    inner = np.array([beside[y * width + x] for y in range(4, 20) for x in range(4, 26)])
    assert 0.1 * samples < inner.min() and inner.max() < 0.9 * samples
    assert inner.mean() == pytest.approx(samples * (TILE - 1) / (ROWS * COLUMNS - 1), rel=0.2)


@pytest.mark.parametrize(("width", "height", "first", "spp"), [(5, 7, 0, 3), (16, 8, 2, 5), (3, 2, 33, 14)])
def test_launches_go_over_all_samples_once(
    width: int, height: int, first: int, spp: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    from stratalux.integrators.indirect.tiles import TiledView

    monkeypatch.setattr("stratalux.integrators.indirect.tiles.ROOM", 40)
    film = mi.load_dict({"type": "hdrfilm", "width": width, "height": height})
    view = TiledView(SimpleNamespace(sensor=SimpleNamespace(film=lambda: film)))
    seen = []
    launches = view.launches(np.full((height, width), spp), first)
    assert len(launches) == len(list(launches)) > 1
    for start, end in launches:
        pixel, index, (begin, stop) = view.lanes(first + start, end - start)
        lanes = len(pixel.numpy())
        assert 0 < lanes <= 45 and begin.numpy().min() == 0 and stop.numpy().max() == lanes
        pairs = list(zip(pixel.numpy().tolist(), index.numpy().tolist(), strict=True))
        number = np.bincount(pixel.numpy(), minlength=width * height)
        np.testing.assert_array_equal(number, end - start)
        for place, sample in pairs:
            assert first + start[place] <= sample < first + end[place]
        seen += pairs
    assert sorted(seen) == [(p, s) for p in range(width * height) for s in range(first, first + spp)]
