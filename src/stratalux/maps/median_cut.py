"""Median cut: equal-energy rectangles (Debevec 2005; the paper's section 3.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .envmap import EnvironmentMap
from .regions import Regions

_NOISE = 1e-12
"""Energies below this fraction of the whole map's are rounding noise of the summed-area table, hence zero."""


def median_cut(environment: EnvironmentMap, n: int) -> Regions:
    """Cut the map into ``n`` rectangles of nearly equal energy.

    Round by round, every region is cut in two along its longer side (a width counts times the sine of the polar angle
    of the region's centre), where the two energies differ least. If a full round would make more than ``n`` regions,
    only those with the most energy are cut. A region that cannot be cut into two parts with energy is left as it is,
    so the result may have fewer than ``n`` regions. Regions are in the order of the tree of cuts.

    Raises :class:`InputError` if ``n`` < 1.
    """
    if n < 1:
        raise InputError(f"number of regions: {n} is too few; give at least 1")
    cells = _Cells(environment.energy_table.whole_cells())
    height, width = environment.height, environment.width
    bounds = np.array([[0], [height - 1], [0], [width]], dtype=np.int64)
    closed: NDArray[np.bool_] = np.zeros(1, dtype=bool)  # regions known to be uncuttable
    while bounds.shape[1] < n and not closed.all():
        chosen = np.flatnonzero(~closed)
        if bounds.shape[1] + len(chosen) > n:
            energy = cells.energy(bounds[:, chosen])
            chosen = np.sort(chosen[np.argsort(-energy, kind="stable")[: n - bounds.shape[1]]])
        vertical, at, cuttable = cells.halve(bounds[:, chosen])
        closed[chosen[~cuttable]] = True
        chosen, vertical, at = chosen[cuttable], vertical[cuttable], at[cuttable]
        parts = np.ones(len(closed), dtype=np.int64)
        parts[chosen] = 2
        bounds, closed = np.repeat(bounds, parts, axis=1), np.repeat(closed, parts)
        first = np.cumsum(parts)[chosen] - 2
        bounds[np.where(vertical, 3, 1), first] = bounds[np.where(vertical, 2, 0), first + 1] = at
        y0, y1, x0, x1 = bounds
        closed |= (y1 - y0) * (x1 - x0) == 1
    energy = np.maximum(cells.energy(bounds), 0)
    return Regions(np.ascontiguousarray(bounds.T), energy, (height, width))


class _Cells:
    """Rectangles of whole cells, ``bounds`` (4, N): y0, y1, x0 and x1. ``table``: :meth:`EnergyTable.whole_cells`."""

    def __init__(self, table: NDArray[np.float64]) -> None:
        self.height, self.width = len(table), table.shape[1] - 1
        self._flat, self._row = table.ravel(), table.shape[1]
        self._noise = _NOISE * (table[-1, -1] - table[-1, 0])

    def energy(self, bounds: NDArray[np.int64]) -> NDArray[np.float64]:
        """∫ luminance dω over each, (N,)."""
        y0, y1, x0, x1 = bounds
        upper, lower = y0 * self._row, y1 * self._row
        take = self._flat.take
        return take(lower + x1) - take(upper + x1) - take(lower + x0) + take(upper + x0)

    def halve(self, bounds: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.int64], NDArray[np.bool_]]:
        """Whether to cut each across its width rather than its height, where, and whether it could be cut at all."""
        y0, y1, x0, x1 = bounds
        extent_y = (y1 - y0) / (self.height - 1)
        extent_x = 2 * (x1 - x0) / self.width * np.sin(np.pi * (y0 + y1) / 2 / (self.height - 1))
        vertical = extent_x >= extent_y
        at, cuttable = self._best_cut(bounds, vertical)
        retry = np.flatnonzero(~cuttable)
        if len(retry):
            vertical[retry] ^= True
            at[retry], cuttable[retry] = self._best_cut(bounds[:, retry], vertical[retry])
        return vertical, at, cuttable

    def _best_cut(
        self, bounds: NDArray[np.int64], vertical: NDArray[np.bool_]
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Where to cut along the given axis so that the energies of the halves differ least.

        All rectangles at once: a search for the last position at which less than half of the energy is reached. The
        best cut is there or one after, and both halves must have energy.
        """
        y0, y1, x0, x1 = bounds
        low = np.where(vertical, x0, y0)
        length = np.where(vertical, x1, y1) - low
        # What lies before a cut is what the table has on the far side of the rectangle (its lower row, or its right
        # column) less what it has on the near side. A cut is the number of its entry on the far side.
        step = np.where(vertical, 1, self._row)
        begin = np.where(vertical, y1 * self._row + x0, y0 * self._row + x1)
        end = begin + length * step
        near = np.where(vertical, (y0 - y1) * self._row, x0 - x1)

        def before(cut: NDArray[np.int64]) -> NDArray[np.float64]:
            return self._flat.take(cut) - self._flat.take(cut + near)

        outside = before(begin)
        total = before(end) - outside
        half = total / 2 + outside
        cut = begin.copy()
        for power in reversed(range(int(length.max() - 1).bit_length())):
            further = np.minimum(cut + (step << power), end)
            np.copyto(cut, further, where=before(further) < half)

        def imbalance(cut: NDArray[np.int64]) -> NDArray[np.float64]:
            energy = before(cut) - outside
            valid = (cut > begin) & (cut < end) & (energy > self._noise) & (total - energy > self._noise)
            return np.where(valid, np.abs(2 * energy - total), np.inf)

        following = np.minimum(cut + step, end)
        here, there = imbalance(cut), imbalance(following)
        best = np.where(here < there, cut, following)
        return low + (best - begin) // step, np.isfinite(np.minimum(here, there))
