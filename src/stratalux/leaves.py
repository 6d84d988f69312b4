"""The map cut into many rectangles of exactly equal energy, anywhere between texels: the leaves of a median cut.

A direction drawn uniformly inside a random leaf has the density of the map, without any search, and leaves that follow
each other in the order of the tree of cuts are neighbours on the sphere: strata of any size are ranges of leaves.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .envmap import EnvironmentMap
from .errors import InputError
from .geometry import row_weights, texel_solid_angle

FLOOR = 0.01
"""Luminance added everywhere, in units of the map's mean: no leaf is so large that a lone bright texel in it stands for
much more light than the leaf's share."""

_Float = NDArray[np.float64]
_Weights = tuple[NDArray[np.int64], _Float, _Float, _Float]
"""A lattice index k and the parts of the entries k, k + 1 and k + 2 of the table."""


def equal_energy_leaves(environment: EnvironmentMap, depth: int) -> _Float:
    """Cut the map ``depth`` times into halves of equal energy; (2^depth, 4): x, y, width, height of the leaves.

    The unit is a cell (see :mod:`stratalux.geometry`): x in [0, W], y in [0, H − 1], the origin at the centre of texel
    (0, 0). Every rectangle is cut across its longer side, as in :func:`stratalux.median_cut.median_cut`, at the exact
    position where the integral of the bilinear luminance (plus :data:`FLOOR`) is halved. Leaves are in the order of the
    tree. A black map is cut into equal solid angles. Raises :class:`InputError` for a depth that is not in 0 … 24.
    """
    if not 0 <= depth <= 24:
        raise InputError(f"depth of the leaves: {depth} is out of range; give 0 to 24")
    energy = _Energy(environment)
    height, width = environment.height, environment.width
    leaves = np.array([[0.0, 0.0, width, height - 1]])  # left, top, right, bottom
    for _ in range(depth):
        left, top, right, bottom = leaves.T
        across = 2 * (right - left) / width * np.sin(np.pi * (top + bottom) / 2 / (height - 1))
        vertical = across >= (bottom - top) / (height - 1)  # the cut runs vertically, across the width
        leaves = np.repeat(leaves, 2, axis=0)
        pairs = leaves.reshape(-1, 2, 4)
        for lanes, near, far, halve in (
            (np.flatnonzero(vertical), 0, 2, energy.halve_width),
            (np.flatnonzero(~vertical), 1, 3, energy.halve_height),
        ):
            if len(lanes):
                cut = halve(*pairs[lanes, 0].T)
                pairs[lanes, 0, far] = pairs[lanes, 1, near] = cut
    leaves[:, 2:] -= leaves[:, :2]
    return leaves


class _Energy:
    """Integrals of the bilinear luminance over rectangles that begin and end anywhere.

    The integral over [0, x] x [0, y] is a sum over the texels, each with the part of its hat function that lies inside.
    Along one axis that part is 1 for all texels but the two around the end, so a summed-area table of the texels'
    energies and three of its entries along each axis give it exactly. The weights of rows are those of
    :func:`stratalux.geometry.row_weights`; inside a cell, the density is bilinear in x and y.
    """

    def __init__(self, environment: EnvironmentMap) -> None:
        height, width = environment.height, environment.width
        solid_angle = texel_solid_angle(height, width)[:, 0]
        luminance = environment.luminance
        mean = float(solid_angle @ luminance.sum(axis=1, dtype=np.float64)) / (4 * np.pi)
        upper, lower = row_weights(height)
        self._upper, self._lower = np.append(upper, 0), np.append(lower, 0)
        self._above = np.append(0, lower)  # of the cell above the texel
        self._row = self._upper + self._above
        self._height, self._width = height, width
        # Column W is column 0 again. One more row and column, empty, so that entry k + 2 exists.
        table = np.zeros((height + 2, width + 3))
        inner = table[1:-1, 1:-1]
        np.add(luminance, FLOOR * mean or 1.0, out=inner[:, :-1])
        inner[:, -1] = inner[:, 0]
        inner *= self._row[:, None]
        np.cumsum(inner, axis=1, out=inner)
        for i in range(1, height):
            inner[i] += inner[i - 1]
        table[1:-1, -1] = table[1:-1, -2]
        table[-1] = table[-2]
        self._table, self._stride = table.ravel(), table.shape[1]

    def halve_width(self, left: _Float, top: _Float, right: _Float, bottom: _Float) -> _Float:
        """The x at which vertical cuts halve the rectangles."""
        upper, lower = self._rows(top), self._rows(bottom)

        def before(x: _Float, lanes: slice | NDArray[np.int64]) -> _Float:
            columns = self._columns(x)
            return self._corner(_take(lower, lanes), columns) - self._corner(_take(upper, lanes), columns)

        return _halve(before, left, right)

    def halve_height(self, left: _Float, top: _Float, right: _Float, bottom: _Float) -> _Float:
        """The y at which horizontal cuts halve the rectangles."""
        near, far = self._columns(left), self._columns(right)

        def before(y: _Float, lanes: slice | NDArray[np.int64]) -> _Float:
            rows = self._rows(y)
            return self._corner(rows, _take(far, lanes)) - self._corner(rows, _take(near, lanes))

        return _halve(before, top, bottom)

    def _columns(self, x: _Float) -> _Weights:
        k = np.minimum(x.astype(np.int64), self._width - 1)
        t = x - k
        # Of the hat of texel k, its rising half and ∫ (1 − t) dt; of that of texel k + 1, ∫ t dt.
        first, second = (1 + 2 * t - t * t) / 2, t * t / 2
        return k, 1 - first, first - second, second

    def _rows(self, y: _Float) -> _Weights:
        k = np.minimum(y.astype(np.int64), self._height - 2)
        t = y - k
        first = (self._above[k] + self._upper[k] * (2 * t - t * t)) / self._row[k]
        second = self._lower[k] * t * t / self._row[k + 1]
        return k, 1 - first, first - second, second

    def _corner(self, rows: _Weights, columns: _Weights) -> _Float:
        """Energy of [0, x] x [0, y], up to a constant in x."""
        i, *row_parts = rows
        j, a, b, c = columns
        first = i * self._stride + j
        total: _Float = np.zeros(len(first))
        for part in row_parts:
            total += part * (a * self._table[first] + b * self._table[first + 1] + c * self._table[first + 2])
            first += self._stride
        return total


def _take(weights: _Weights, lanes: slice | NDArray[np.int64]) -> _Weights:
    k, a, b, c = weights
    return k[lanes], a[lanes], b[lanes], c[lanes]


def _halve(before: Callable[[_Float, slice | NDArray[np.int64]], _Float], start: _Float, end: _Float) -> _Float:
    """Where ``before``, non-decreasing and quadratic between integers, reaches the mean of its values at both ends."""
    everything = slice(None)
    low, high = start.copy(), end.copy()
    below, above = before(low, everything), before(high, everything)
    goal = (below + above) / 2
    # Bisect over the integers in between, as long as there are any.
    first, last = np.floor(low).astype(np.int64), np.ceil(high).astype(np.int64)
    lanes = np.flatnonzero(last - first > 1)
    while len(lanes):
        middle = (first[lanes] + last[lanes]) // 2
        value = before(middle.astype(np.float64), lanes)
        short = value <= goal[lanes]
        moved, value_moved = lanes[short], value[short]
        first[moved], low[moved], below[moved] = middle[short], middle[short], value_moved
        moved, value_moved = lanes[~short], value[~short]
        last[moved], high[moved], above[moved] = middle[~short], middle[~short], value_moved
        lanes = lanes[last[lanes] - first[lanes] > 1]
    # In between, the energy is g₀ s + (g₁ − g₀) s² / 2 for s in [0, 1], where g₀ + g₁ is twice its total.
    total = np.maximum(above - below, 0)
    wanted = np.clip(goal - below, 0, total)
    g0 = np.clip(4 * (before((low + high) / 2, everything) - below) - total, 0, 2 * total)
    g1 = 2 * total - g0
    divisor = g0 + np.sqrt(np.maximum(g0 * g0 + 2 * (g1 - g0) * wanted, 0))
    s = np.divide(2 * wanted, divisor, out=np.full_like(total, 0.5), where=divisor > 0)
    return low + np.clip(s, 0, 1) * (high - low)
