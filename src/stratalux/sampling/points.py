"""Low-discrepancy points in which every prefix, and every aligned block, is stratified (Dr.Jit).

Points are addressed by their index, so nothing is stored and any lane can make any of them. Randomisation is Owen's
(1995) nested uniform scrambling by the hash of Laine and Karras (2011), in the form of Burley (2020): the points of
different seeds are independent, each of them is uniform, and the strata stay. Indices are shuffled the same way, which
decorrelates sequences that use the same dimensions.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

_POLYNOMIALS = ((2, 1, (1, 3)), (3, 1, (1, 3, 1)), (3, 2, (1, 1, 1)))
"""Degree, inner coefficients and first direction numbers of Sobol's third dimension and the next ones: Joe and Kuo
2008, new-joe-kuo-6.21201."""
_PASCAL = ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0x0000FFFF))
"""Sobol's second generator matrix is Pascal's triangle modulo 2: the product of these five sparse ones, each of which
adds bits, masked, to those above."""
DIMENSIONS = 2 + len(_POLYNOMIALS)
"""Of :func:`sobol`."""


def mix(value: mi.UInt32) -> mi.UInt32:
    """A hash of 32 bits onto 32 bits, one to one (the constants are those of Wellons' lowbias32)."""
    value = value ^ (value >> 16)
    value = value * mi.UInt32(0x7FEB352D)
    value = value ^ (value >> 15)
    value = value * mi.UInt32(0x846CA68B)
    return value ^ (value >> 16)


def shuffle(index: mi.UInt32, seed: mi.UInt32) -> mi.UInt32:
    """A permutation of all indices that maps every aligned block of 2^k of them to such a block."""
    return dr.brev(_scramble_reversed(dr.brev(index), seed))


def van_der_corput(index: mi.UInt32, seed: mi.UInt32) -> mi.UInt32:
    """Point ``index`` of the scrambled radical inverse in base 2, in units of 2⁻³²."""
    return dr.brev(_scramble_reversed(index, seed))


def sobol_2d(index: mi.UInt32, seed: mi.UInt32) -> mi.Point2f:
    """Point ``index`` of the scrambled (0, 2)-sequence of Sobol's first two dimensions, in [0, 1)²."""
    x = van_der_corput(index, seed)
    y = dr.brev(index)
    for shift, bits in _PASCAL:
        y = y ^ ((y & mi.UInt32(bits)) << shift)
    y = dr.brev(_scramble_reversed(dr.brev(y), mix(seed)))
    return mi.Point2f(unit_float(x), unit_float(y))


def sobol_cells(bits: int) -> NDArray[np.uint32]:
    """The first 4^bits indices of :func:`sobol_2d` in Morton's order of where its points are.

    They have one in each cell of a grid of 2^bits by 2^bits, and so has every aligned block of as many: in the same
    order, but for reflections of the grid and its parts, as scrambling makes them, too. So neighbours stay neighbours.
    """
    index = np.arange(4**bits, dtype=np.uint32)
    x = np.zeros_like(index)
    for k in range(2 * bits):
        x |= (index >> k & 1) << (31 - k)
    y = x
    for shift, mask in _PASCAL:
        y = y ^ (y & np.uint32(mask)) << np.uint32(shift)
    place = np.zeros_like(index)
    for k in range(bits):
        place |= (x >> (31 - k) & 1) << (2 * (bits - k) - 1) | (y >> (31 - k) & 1) << (2 * (bits - k) - 2)
    return np.argsort(place).astype(np.uint32)


def sobol(index: mi.UInt32, dimension: int, seed: mi.UInt32) -> mi.Float:
    """Coordinate 2 to :data:`DIMENSIONS` − 1 of point ``index`` of Sobol's sequence, whose first two are those of
    :func:`sobol_2d`, scrambled by a ``seed`` of its own."""
    bits = mi.UInt32(0)
    for k, column in enumerate(_columns(*_POLYNOMIALS[dimension - 2])):
        bits = bits ^ dr.select((index >> k) & 1 != 0, mi.UInt32(column), mi.UInt32(0))
    return unit_float(dr.brev(_scramble_reversed(dr.brev(bits), seed)))


def _columns(degree: int, inner: int, first: tuple[int, ...]) -> list[int]:
    """Of a generator matrix, most significant bit first: v_k = m_k 2^(31 − k), by the recurrence of the polynomial."""
    m = list(first)
    for k in range(degree, 32):
        m.append(m[k - degree] ^ m[k - degree] << degree)
        for i in range(1, degree):
            m[k] ^= (inner >> (degree - 1 - i) & 1) * m[k - i] << i
    return [value << (31 - k) for k, value in enumerate(m)]


def unit_float(bits: mi.UInt32) -> mi.Float:
    """[0, 1) from units of 2⁻³², rounded down to 24 bits."""
    return mi.Float(bits >> 8) * 2.0**-24


def _scramble_reversed(bits: mi.UInt32, seed: mi.UInt32) -> mi.UInt32:
    """Laine and Karras' hash, in which a bit depends on lower bits only: a nested scrambling of reversed bits."""
    bits = bits + seed
    for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
        bits = bits ^ (bits * mi.UInt32(factor))
    return bits
