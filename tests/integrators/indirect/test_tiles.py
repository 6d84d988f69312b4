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
    for start, stop in sorted(set(zip(begin, end, strict=True))):
        assert (begin[start:stop] == start).all() and (end[start:stop] == stop).all()
        y, x = np.divmod(place[start:stop], width)
        if np.ptp(y) < ROWS and height % ROWS == 0 and sample % ROWS == 0:  # of one whole strip
            assert np.ptp(x) < COLUMNS
    # The first and the last one may be smaller, and those at the end of a strip that is.
    assert len(set(begin)) <= count // TILE + 2


def test_edges_move() -> None:
    from stratalux.integrators.indirect.tiles import Tiles

    width, height = 16, 12
    together = np.zeros((192, 192))
    for sample in range(32):
        pixel, _, (first, _) = Tiles(width, height).pixels(sample * 192, 192)
        tile = np.empty(192, dtype=int)
        tile[pixel.numpy()] = first.numpy()
        together += tile[:, None] == tile
    beside = together[np.arange(191), np.arange(1, 192)].reshape(-1)
    inner = [beside[y * width + x] for y in range(1, 11) for x in range(2, 13)]
    assert (
        min(inner) > 16 and max(inner) < 32
    )  # two pixels beside each other are together in most samples, and no two in all


@pytest.mark.parametrize(("width", "height", "first", "spp"), [(5, 7, 0, 3), (16, 8, 2, 5), (3, 2, 33, 14)])
def test_launches_go_over_all_samples_once(
    width: int, height: int, first: int, spp: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    from stratalux.integrators.indirect.tiles import TiledView

    monkeypatch.setattr("stratalux.integrators.indirect.tiles.ROOM", 40)
    film = mi.load_dict({"type": "hdrfilm", "width": width, "height": height})
    view = TiledView(SimpleNamespace(sensor=SimpleNamespace(film=lambda: film)), None)
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
