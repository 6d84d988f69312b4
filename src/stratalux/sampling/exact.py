"""Sums that are the same in whatever order threads add to them (Dr.Jit)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

_BITS = 61
"""Of a sum, besides its sign."""
_ROOM = 2.0**-60
"""Numbers below it have no say in how fine a sum is: its scale stays finite."""


class ExactSums:
    """Sums of numbers in single precision, by their place.

    Sums of floating-point numbers depend on the order, and threads have none. So numbers are added up as integers, in
    units so small that the largest sum has 61 bits: about 18 digits. So what is 10^12 times dimmer than the brightest
    number of all is lost. Where a number is infinite or none, all sums of
    its place are none. ``size``: places there are; ``most``: numbers for one place, at most.
    """

    def __init__(self, size: int, most: int) -> None:
        self._size, self._most = size, most
        self._sums: list[mi.UInt64] = []
        self._scales: list[mi.Float64] = []
        self._bad = dr.zeros(mi.UInt32, size)

    def begin(self, *groups: Sequence[mi.Float]) -> None:
        """Numbers to come: each group shares a unit, by the largest of its numbers as they are here."""
        dr.eval(groups)  # or what they come from would be computed again for each maximum, and for the sums
        for group in groups:
            largest = [dr.max(dr.select(dr.isfinite(value), dr.abs(value), 0)) for value in group]
            m = largest[0]
            for other in largest[1:]:
                m = dr.maximum(m, other)
            exponent = dr.ceil(dr.log2(dr.maximum(mi.Float64(m), _ROOM)) + np.log2(max(self._most, 1)))
            scale = dr.exp2(_BITS - exponent)
            dr.eval(scale)
            for _ in group:
                self._sums.append(dr.zeros(mi.UInt64, self._size))
                self._scales.append(scale)

    def add(self, values: Sequence[mi.Float], place: mi.UInt32, active: mi.Bool | bool = True) -> None:
        """One value for each sum, at the same place."""
        finite = mi.Bool(True)
        for value in values:
            finite &= dr.isfinite(value)
        for sums, scale, value in zip(self._sums, self._scales, values, strict=True):
            whole = mi.Int64(dr.round(mi.Float64(value) * scale))
            dr.scatter_add(sums, dr.reinterpret_array(mi.UInt64, whole), place, active & finite)
        dr.scatter_add(self._bad, mi.UInt32(1), place, active & ~finite)

    def __iter__(self) -> Iterator[NDArray[np.float64]]:
        """The sums, one after the other; each is let go of, as there is one for every pixel of a large film."""
        dr.eval(self._sums, self._bad)
        bad = self._bad.numpy() != 0
        for scale in self._scales:
            found = self._sums.pop(0).numpy().view(np.int64) / scale.numpy()[0]
            found[bad] = np.nan
            yield found
