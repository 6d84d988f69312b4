"""Maps from one layout to another, with all of their light.

Both are taken for the bilinear radiance between their texels. A texel of the result is the mean of the radiance under
its hat function, weighted by solid angle: a triangle filter as wide as its own texels, of many points where it is
coarser than the source. Such means are what keeps the light of each direction: the hat functions add up to 1
everywhere. What the points do not tell of the total, a part in a thousand or so, is made up for by one factor.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .layouts import LATLONG, Layout
from .layouts.layout import Floats, add_hats, around, solid_angles

_SPACING = 2.0
"""Half the number of points along a texel of the source."""
_LOOKUPS = 1 << 16
"""At a time: they stay in the cache."""
_THREADS = 8
_ROWS = 16


@dataclass(frozen=True)
class Sheet:
    """A map in a layout: ``texels`` (F, H, W, 3), linear radiance, float32, of all its faces."""

    layout: Layout
    texels: NDArray[np.float32]

    @property
    def height(self) -> int:
        """Rows of a face."""
        return self.texels.shape[1]

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) of a face."""
        return self.texels.shape[1], self.texels.shape[2]

    @property
    def equivalent(self) -> float:
        """Rows of a latitude-longitude map that is as fine."""
        return self.height * self.layout.rows

    @property
    def flux(self) -> Floats:
        """∫ L dω over the sphere, (3,)."""
        weight = solid_angles(self.layout, self.shape)
        total = np.zeros(3)
        for face, weights in zip(self.texels, weight, strict=True):
            for first in range(0, self.height, _ROWS):  # blocks that stay in the cache
                rows = slice(first, first + _ROWS)
                total += np.tensordot(weights[rows], face[rows].astype(np.float64), axes=2)
        return total

    def radiance(self, d: Floats) -> NDArray[np.float32]:
        """Bilinear radiance (K, 3) from the directions ``d`` (K, 3)."""
        return _Lookup(self).radiance(d)


class _Lookup:
    """A sheet with a row and a column of its neighbours around each face."""

    def __init__(self, sheet: Sheet) -> None:
        self._layout, self._shape = sheet.layout, sheet.shape
        index = around(sheet.layout, sheet.shape)
        self._rows, self._columns = index.shape[1:]
        self._texels = np.take(sheet.texels.reshape(-1, 3), index.ravel(), axis=0)

    def radiance(self, d: Floats) -> NDArray[np.float32]:
        face, s_there, t_there = self._layout.position(d)
        x, y = self._layout.to_texels(s_there, t_there, self._shape)
        column = np.clip(np.floor(x).astype(np.int64), -1, self._columns - 3)
        row = np.clip(np.floor(y).astype(np.int64), -1, self._rows - 3)
        s, t = ((a - b).astype(np.float32)[:, None] for a, b in ((x, column), (y, row)))
        first = (face * self._rows + row + 1) * self._columns + column + 1
        upper, lower = (self._between(first + step, s) for step in (0, self._columns))
        upper += t * (lower - upper)
        return upper

    def _between(self, index: NDArray[np.int64], s: NDArray[np.float32]) -> NDArray[np.float32]:
        left, right = self._texels.take(index, axis=0), self._texels.take(index + 1, axis=0)
        right -= left
        right *= s
        left += right
        return left


def resample(sheet: Sheet, layout: Layout, height: int) -> Sheet:
    """The map in another ``layout``, in faces of ``height`` rows. Its light is the same, in each of the channels."""
    shape = height, height * layout.wide
    if layout is sheet.layout and shape == sheet.shape:
        return sheet
    wanted, width = sheet.flux, shape[1]
    coarse = height * layout.rows
    sheet = _reduced(sheet, coarse)
    lookup = _Lookup(sheet)
    points = max(2, 2 * int(np.ceil(_SPACING * sheet.equivalent / coarse)))
    offsets = [(k + 0.5) / points for k in range(points)]
    columns, step = np.arange(-1.0, width), max(1, _LOOKUPS // (width + 1))

    def part(task: tuple[int, int]) -> Floats:
        """What the points of some rows of a face give to the texels around them, and the weight of that."""
        face, first = task
        rows = np.arange(float(first), min(first + step, height))[:, None]
        sums = np.zeros((len(rows) + 1, width + 2, 4))
        for ty in offsets:
            for tx in offsets:
                s, t = np.broadcast_arrays(*layout.of_texels(columns + tx, rows + ty, shape))
                values = np.ones((*s.shape, 4))
                values[..., :3] = lookup.radiance(layout.direction(face, s, t).reshape(-1, 3)).reshape(*s.shape, 3)
                values *= layout.density(face, s, t)[..., None]
                add_hats(sums, values, tx, ty)
        return sums

    sums = np.zeros((layout.faces, height + 2, width + 2, 4))
    tasks = [(face, first) for face in range(layout.faces) for first in range(-1, height, step)]
    with ThreadPoolExecutor(min(_THREADS, os.cpu_count() or 1)) as pool:
        for (face, first), done in zip(tasks, pool.map(part, tasks), strict=True):
            sums[face, first + 1 : first + 1 + len(done)] += done
    index = around(layout, shape).ravel()
    count = layout.faces * height * width
    total = np.stack([np.bincount(index, sums[..., c].ravel(), count) for c in range(4)], axis=-1)
    texels = np.divide(total[:, :3], total[:, 3:], out=np.zeros((count, 3)), where=total[:, 3:] > 0)
    made = Sheet(layout, texels.reshape(layout.faces, height, width, 3).astype(np.float32))
    there = made.flux
    factor = np.divide(wanted, there, out=np.ones(3), where=there > 0)
    return Sheet(layout, made.texels * factor.astype(np.float32))


def _reduced(sheet: Sheet, rows: float) -> Sheet:
    """A map of latitude and longitude that is many times as fine as ``rows``, with two to four rows for one of those.

    Along each axis, so that it takes a few operations for each of its texels, and not many points.
    """
    from scipy.sparse import coo_matrix, diags_array

    height, width = sheet.shape
    block = 1
    while width % (2 * block) == 0 and 4 * block * rows <= sheet.equivalent and height > 4 * block:
        block *= 2
    if sheet.layout is not LATLONG or block == 1:
        return sheet
    fewer = (height - 1) // block + 1
    nodes, weights = np.polynomial.legendre.leggauss(2)
    v = ((np.arange(height - 1)[:, None] + (nodes + 1) / 2) / (height - 1)).ravel()

    def hats(count: int) -> coo_matrix:
        """The hat functions of ``count`` rows at v, (points, count)."""
        first = np.minimum((v * (count - 1)).astype(np.int64), count - 2)
        share, number = v * (count - 1) - first, np.arange(len(v))
        entries = np.concatenate([1 - share, share]), (np.tile(number, 2), np.concatenate([first, first + 1]))
        return coo_matrix(entries, (len(v), count)).tocsr()

    mean = hats(fewer).T @ diags_array(np.sin(np.pi * v) * np.tile(weights, height - 1)) @ hats(height)
    mean = (diags_array(1 / np.asarray(mean.sum(axis=1)).ravel()) @ mean).astype(np.float32)
    columns = sheet.texels[0].reshape(height, width // block, block, 3).mean(axis=2)
    return Sheet(LATLONG, (mean @ columns.reshape(height, -1)).reshape(1, fewer, width // block, 3))


def in_latlong(sheet: Sheet) -> Sheet:
    """The map in latitude and longitude, as fine as it is; the same if it is so already."""
    return sheet if sheet.layout is LATLONG else resample(sheet, LATLONG, max(4, round(sheet.equivalent)))
