"""Median cut: equal-energy rectangles (Debevec 2005; the paper's section 3.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .envmap import EnvironmentMap
from .errors import InputError
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
    table = environment.energy_table.whole_cells()
    height, width = environment.height, environment.width
    bounds = np.array([[0, height - 1, 0, width]], dtype=np.int64)
    closed = np.zeros(1, dtype=bool)  # regions known to be uncuttable
    while len(bounds) < n and not closed.all():
        chosen = np.flatnonzero(~closed)
        if len(bounds) + len(chosen) > n:
            energy = _energy(table, bounds[chosen])
            chosen = np.sort(chosen[np.argsort(-energy, kind="stable")[: n - len(bounds)]])
        first, second, cuttable = _cut(table, bounds[chosen], (height, width))
        closed[chosen[~cuttable]] = True
        chosen = chosen[cuttable]
        parts = np.ones(len(bounds), dtype=np.int64)
        parts[chosen] = 2
        bounds, closed = np.repeat(bounds, parts, axis=0), np.repeat(closed, parts)
        place = np.cumsum(parts)[chosen] - 2
        bounds[place], bounds[place + 1] = first[cuttable], second[cuttable]
    return Regions(bounds, np.maximum(_energy(table, bounds), 0), (height, width))


def _energy(table: NDArray[np.float64], bounds: NDArray[np.int64]) -> NDArray[np.float64]:
    y0, y1, x0, x1 = bounds.T
    return table[y1, x1] - table[y0, x1] - table[y1, x0] + table[y0, x0]


def _cut(
    table: NDArray[np.float64], bounds: NDArray[np.int64], shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Both halves of each region, and whether it could be cut at all."""
    y0, y1, x0, x1 = bounds.T
    height, width = shape
    extent_y = (y1 - y0) / (height - 1)
    extent_x = 2 * (x1 - x0) / width * np.sin(np.pi * (y0 + y1) / 2 / (height - 1))
    vertical = extent_x >= extent_y  # the cut runs vertically, across the width
    at, cuttable = _best_cut(table, bounds, vertical)
    retry = np.flatnonzero(~cuttable)
    if len(retry):
        vertical = vertical.copy()
        vertical[retry] ^= True
        at[retry], cuttable[retry] = _best_cut(table, bounds[retry], vertical[retry])
    first, second = bounds.copy(), bounds.copy()
    first[vertical, 3] = second[vertical, 2] = at[vertical]
    first[~vertical, 1] = second[~vertical, 0] = at[~vertical]
    return first, second, cuttable


def _best_cut(
    table: NDArray[np.float64], bounds: NDArray[np.int64], vertical: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Where to cut each region along the given axis so that the energies of the halves differ least.

    All regions at once: a bisection for the first position at which half of the energy is reached. The best cut is
    there or one before, and both halves must have energy.
    """
    y0, y1, x0, x1 = bounds.T
    low, high = np.where(vertical, x0, y0), np.where(vertical, x1, y1)
    noise = _NOISE * (table[-1, -1] - table[-1, 0])
    total = _energy(table, bounds)

    # The energy before a cut needs two entries of the table that move with it and a constant: the far side of the
    # rectangle (its lower row, or its right column), the near one, and their difference at the beginning.
    flat, row = table.ravel(), table.shape[1]
    step = np.where(vertical, 1, row)
    far, near = np.where(vertical, y1 * row, x1), np.where(vertical, y0 * row, x0)
    outside = flat.take(far + low * step) - flat.take(near + low * step)

    def before(at: NDArray[np.int64]) -> NDArray[np.float64]:
        moved = at * step
        return flat.take(far + moved) - flat.take(near + moved)

    below, reached, half = low, high, total / 2 + outside
    for _ in range(int((high - low).max() - 1).bit_length()):
        middle = (below + reached) >> 1
        enough = before(middle) >= half
        reached, below = np.where(enough, middle, reached), np.where(enough, below, middle)

    candidates = np.stack([reached, reached - 1])
    energy = before(candidates) - outside
    valid = (candidates > low) & (candidates < high) & (energy > noise) & (total - energy > noise)
    imbalance = np.where(valid, np.abs(2 * energy - total), np.inf)
    best = imbalance.argmin(axis=0)
    lanes = np.arange(len(bounds))
    return candidates[best, lanes], valid[best, lanes]
