"""Integrals of the bilinear luminance over rectangles of the map, from one summed-area table of its texels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..images.colour import LUMINANCE
from ..images.half import single
from .geometry import row_weights, texel_solid_angle

_ROWS = 64
"""Of a block that stays in the cache."""
_MANY = 1 << 23
"""Texels from which on sums are whole numbers: half of the memory, and most of the time goes into taking it."""
_MOST = (1 << 31) - 2
"""The sum of all texels then; that with a column twice may be twice as large."""


@dataclass(frozen=True)
class EnergyTable:
    """Sums over texels, and what it takes to make integrals over parts of cells of them.

    The integral over [0, x] x [0, y] (in cells, see :mod:`.maps.geometry`) is a sum over the texels, each with the
    part of its hat function that lies inside. Along one axis that part is 1 for all texels but the two around the end,
    so three entries of the table along each axis give it exactly, and two if the end is an integer.

    ``sums`` (H + 2, W + 3) float64: entry (i, j) is the sum of luminance x steradians over the texels above row i and
    left of column j. Column W of the texels is column 0 again; the last row and column are repeated once. Of large maps
    it is uint32, in a ``unit`` of 2⁻³¹ of all: exact to a ten-thousandth of a leaf, of which there are 65,536.
    ``row`` (H,): steradians that a texel of each row stands for. ``above`` (H,): the part of them that lies in the
    cells above the texel.
    """

    sums: NDArray[np.float64 | np.uint32]
    row: NDArray[np.float64]
    above: NDArray[np.float64]
    unit: float = 1.0

    @classmethod
    def build(cls, texels: NDArray[Any], less: float = 0.0) -> EnergyTable:
        """Of RGB ``texels`` (H, W, 3), float32 or float16, in one pass over them.

        ``less``: luminance that is taken away everywhere, as far as there is any.
        """
        height, width = texels.shape[:2]
        row = texel_solid_angle(height, width)[:, 0].copy()
        above = 2 * np.pi / width * np.append(0, row_weights(height)[1]) / row
        if height * width >= _MANY:
            return cls._of_many(texels, less, row, above)
        sums = np.empty((height + 2, width + 3))
        sums[0] = sums[:, 0] = 0
        luminance = np.empty((min(_ROWS, height), width), dtype=np.float32)
        for first in range(0, height, _ROWS):
            last = min(first + _ROWS, height)
            block, inner = luminance[: last - first], sums[first + 1 : last + 1, 1 : width + 1]
            _luminance(texels[first:last], less, block)
            np.multiply(block, row[first:last, None], out=inner)
            np.cumsum(inner, axis=1, out=inner)
            sums[first + 1 : last + 1, width + 1] = inner[:, -1] + inner[:, 0]
            before = sums[first, 1:-1]
            for line in sums[first + 1 : last + 1, 1:-1]:
                np.add(line, before, out=line)
                before = line
        sums[:-1, -1] = sums[:-1, -2]
        sums[-1] = sums[-2]
        return cls(sums, row, above)

    @classmethod
    def _of_many(
        cls, texels: NDArray[Any], less: float, row: NDArray[np.float64], above: NDArray[np.float64]
    ) -> EnergyTable:
        """The same in whole numbers. They replace the luminances, which are in their place at first."""
        height, width = texels.shape[:2]
        sums = np.empty((height + 2, width + 3), dtype=np.uint32)
        sums[0] = sums[:, 0] = 0
        luminance, total = sums.view(np.float32)[1 : height + 1, 1 : width + 1], 0.0
        for first in range(0, height, _ROWS):
            some = luminance[first : first + _ROWS]
            _luminance(texels[first : first + _ROWS], less, some)
            total += float(row[first : first + _ROWS] @ some.sum(axis=1, dtype=np.float64))
        unit = total / _MOST or 1.0
        weight = row[:, None] / unit
        before, lines = np.zeros(width + 1), np.empty((_ROWS, width + 1))
        for first in range(0, height, _ROWS):
            block = lines[: min(_ROWS, height - first)]
            inner = block[:, :-1]
            np.multiply(luminance[first : first + _ROWS], weight[first : first + _ROWS], out=inner)
            np.cumsum(inner, axis=1, out=inner)
            np.add(inner[:, -1], inner[:, 0], out=block[:, -1])
            for line in block:
                np.add(line, before, out=line)
                before = line
            before = before.copy()
            sums[first + 1 : first + 1 + len(block), 1:-1] = block
        sums[:-1, -1] = sums[:-1, -2]
        sums[-1] = sums[-2]
        return cls(sums, row, above, unit)

    @property
    def height(self) -> int:
        return len(self.row)

    @property
    def width(self) -> int:
        return self.sums.shape[1] - 3

    @property
    def total(self) -> float:
        """∫ luminance dω over the sphere."""
        return float(self.sums[-1, self.width]) * self.unit

    def whole_cells(self) -> NDArray[np.float64]:
        """∫ luminance dω over [0, x] x [0, y] for whole x and y, (H, W + 1) by y and x, up to a function of y alone."""
        height, width = self.height, self.width
        before = np.empty((height, width + 1))
        for first in range(0, height, _ROWS):
            last = min(first + _ROWS, height)
            # Half of the hat of column x lies before it, and the part ``above`` of that of row y.
            pairs = np.add(self.sums[first : last + 1, :-2], self.sums[first : last + 1, 1:-1], dtype=np.float64)
            rows = before[first:last]
            np.subtract(pairs[1:], pairs[:-1], out=rows)
            rows *= self.above[first:last, None]
            rows += pairs[:-1]
            rows *= 0.5 * self.unit
        return before

    def corners(self, bounds: NDArray[np.int64]) -> NDArray[np.float64]:
        """The same at the corners of the rectangles ``bounds`` (N, 4; y0, y1, x0, x1): (N, 2, 2), by y and x."""
        y, row, sums = bounds[:, :2, None], self.sums.shape[1], self.sums.ravel()

        def take(at: NDArray[np.int64]) -> NDArray[np.float64]:
            return sums.take(at).astype(np.float64, copy=False)

        at = y * row + bounds[:, None, 2:]
        upper, lower = take(at) + take(at + 1), take(at + row) + take(at + row + 1)
        corners: NDArray[np.float64] = (upper + self.above[y] * (lower - upper)) * (0.5 * self.unit)
        return corners


def _luminance(texels: NDArray[Any], less: float, out: NDArray[np.float32]) -> None:
    np.matmul(single(texels), LUMINANCE, out=out)
    if less:
        np.subtract(out, np.float32(less), out=out)
        np.maximum(out, 0, out=out)
