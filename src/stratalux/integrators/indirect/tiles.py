"""Tiles of neighbouring pixels whose samples share what their paths find (Dr.Jit)."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np

from ...sampling.points import mix
from ..automatic.launch import Group, Launcher
from ..automatic.view import Division, Range, View

TILE = 32
"""Pixels that share."""
ROWS, COLUMNS = 8, 16
"""Of the areas that tiles are drawn from: as most pixels share nothing with the next one, noise looks as usual."""
_AREA = ROWS * COLUMNS
ROOM = 1 << 18
"""Camera samples of one launch, about, each of which keeps what it has to do with all others of its tile."""
_HEAVY = 4
"""Memory of a sample, where that of others is 1."""


class Tiles:
    """An order of the pixels of a film for each sample, in which those of a tile follow each other.

    The film is cut into strips of :data:`ROWS` rows, and each of these, column by column, into areas of
    :data:`COLUMNS`, whose pixels are shuffled and dealt out to tiles of :data:`TILE`. From sample to sample, strips
    begin at another row and areas at another column. Tiles at the edges of the film are smaller.
    """

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height

    def pixels(self, first: int, lanes: int) -> tuple[mi.UInt32, mi.UInt32, Group]:
        """For ``lanes`` from place number ``first`` on, where every sample has all pixels: the pixel of each, the index
        of its sample, and its tile as the first lane and the one after the last, as far as they are there."""
        W, H, count, begin = (dr.opaque(mi.UInt32, n) for n in (self.width, self.height, lanes, first % self._all))
        lane = dr.arange(mi.UInt32, lanes)
        place = lane + begin
        later = place // (W * H)
        sample = later + dr.opaque(mi.UInt32, first // self._all & 0xFFFFFFFF)
        place -= later * W * H

        seed = mix(sample)
        top, shift = seed % ROWS, (seed >> 8) % COLUMNS * ROWS
        top = dr.minimum(top, H)
        area = (place + (_AREA - shift)) // _AREA  # the first one has as many pixels as areas are shifted by
        start = mi.Int32(area * _AREA) - mi.Int32(_AREA - shift)
        whole = (start >= 0) & (start + _AREA <= mi.Int32(W * H))
        start = mi.UInt32(dr.maximum(start, 0))
        at = dr.select(whole, start + _shuffled(place - start, mix(seed + area)), place)
        above = at < top * W
        inside = at - top * W
        strip = inside // (ROWS * W)
        y0 = dr.select(above, 0, top + strip * ROWS)
        rows = dr.select(above, top, dr.minimum(ROWS, H - y0))
        inside = dr.select(above, at, inside - strip * (ROWS * W))
        column = inside // rows
        pixel = (y0 + inside - column * rows) * W + column

        before = (place - start) % TILE
        after = dr.minimum(place - before + TILE, dr.minimum(area * _AREA + shift, W * H)) - place
        return pixel, sample, (lane - dr.minimum(before, lane), dr.minimum(lane + after, count))

    def until(self, place: int) -> Range:
        """How many samples of each pixel (H W) come before place number ``place``."""
        sample, rest = divmod(place, self._all)
        before = np.full(self._all, sample)
        if rest:
            before[self.pixels(sample * self._all, rest)[0].numpy()] += 1
        return before

    @property
    def _all(self) -> int:
        return self.width * self.height


def _shuffled(place: mi.UInt32, seed: mi.UInt32) -> mi.UInt32:
    """A permutation of the places of an area, whose number is a power of two: each step is one."""
    for k in range(3):
        place = (place * (2 * (seed >> (8 * k)) + 1) + (seed >> (4 * k + 3))) & (_AREA - 1)
        place ^= place >> 3
    return place


class TiledDivision(Division):
    """As many samples of each pixel, after the ``first`` ones, in the order of the tiles."""

    def __init__(self, counts: Range, tiles: Tiles, room: int, first: int) -> None:
        super().__init__(counts, tiles.width, tiles.height, room)
        self._tiles, self._first = tiles, first

    def until(self, k: int) -> Range:
        done = round(self._total * self._share(k))
        return self._tiles.until(self._first * self._counts.size + done) - self._first


class TiledView(View):
    """A film whose pixels are rendered tile by tile, all with as many samples."""

    def __init__(self, launcher: Launcher, most: int = 1 << 40) -> None:
        super().__init__(launcher, None, max(most // _HEAVY, 1))
        self._tiles = Tiles(self.width, self.height)

    @property
    def room(self) -> int:
        return ROOM

    def launches(self, counts: Range, first: int = 0) -> Division:
        return TiledDivision(counts, self._tiles, self.room, first)

    def pieces(self, start: Range, end: Range, count: int) -> Iterator[tuple[Range, Range]]:
        first, last = int(start.sum()), int(end.sum())
        cuts = [self._tiles.until(first + (last - first) * i // count) for i in range(count + 1)]
        yield from pairwise(cuts)

    def lanes(self, first: Range, number: Range) -> tuple[mi.UInt32, mi.UInt32, Group]:
        return self._tiles.pixels(int(first.sum()), int(number.sum()))
