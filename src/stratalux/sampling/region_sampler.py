"""Sampling directions inside the regions of a partition, on the device (Dr.Jit).

The density of region Ω_i is proportional to the bilinear luminance of the map, per unit of solid angle up to the
variation of sin θ inside a single cell (the paper's equation (2) restricted to Ω_i). A proposal inverts the region's
CDF over its cells, taken row by row, and then picks a point inside the cell from the bilinear density of its corners.

The CDF is an array of integers in units of 2⁻³¹ in which every cell with energy owns at least one unit. What is sampled
is therefore exactly what the pdf states, in dim cells beside a sun too, and the density is positive wherever the
lookup is. A table of equal slots of the unit interval says where in the CDF each slot begins, so the inversion is one
lookup and, where cells are dim, a short search.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..maps.envmap import EnvironmentMap
from ..maps.geometry import row_weights
from ..maps.regions import Regions

_BITS = 31
"""The CDF's units are 2^-31: a sum of all of them still fits an unsigned 32-bit integer."""


@dataclass(frozen=True)
class RegionTables:
    """The CDFs of all N regions of an H x W map as NumPy arrays.

    ``cdf`` ((H − 1) W,) uint32: region after region, the cumulative units of its cells, row-major, own cell included.
    ``slots`` uint32: region after region, 2^k + 1 indices of the first cell that reaches into each of its 2^k slots.
    ``layout`` (N, 8) uint32: y0, x0, width of the region, its first entry in ``cdf``, its first entry in ``slots``,
    31 − k, height of the region, 0.
    ``corners`` (H, W + 1) float32: luminance of the texels, the first column repeated at the end.
    ``row_weight`` (H − 1, 2) float32: :func:`stratalux.maps.geometry.row_weights`, up to a factor for each row.
    """

    cdf: NDArray[np.uint32]
    slots: NDArray[np.uint32]
    layout: NDArray[np.uint32]
    corners: NDArray[np.float32]
    row_weight: NDArray[np.float32]

    @classmethod
    def build(cls, environment: EnvironmentMap, regions: Regions) -> RegionTables:
        energy = environment.cell_energy
        cdf = np.empty(energy.size, dtype=np.uint32)
        slots: list[NDArray[np.uint32]] = []
        layout = np.zeros((len(regions), 8), dtype=np.uint32)
        first_cell = first_slot = 0
        for i, (y0, y1, x0, x1) in enumerate(regions.bounds.tolist()):
            units = _integer_cdf(energy[y0:y1, x0:x1].ravel())
            last_cell = first_cell + units.size
            cdf[first_cell:last_cell] = units
            bits = (units.size - 1).bit_length()  # at least as many slots as cells
            begins = np.arange((1 << bits) + 1, dtype=np.uint32) << np.uint32(_BITS - bits)
            region_slots = np.minimum(units.searchsorted(begins, side="right"), units.size - 1).astype(np.uint32)
            slots.append(region_slots)
            layout[i, :7] = y0, x0, x1 - x0, first_cell, first_slot, _BITS - bits, y1 - y0
            first_cell, first_slot = last_cell, first_slot + region_slots.size
        corners = np.concatenate([environment.luminance, environment.luminance[:, :1]], axis=1)
        weight = np.stack(row_weights(environment.height), axis=1)
        weight /= weight.max(axis=1, keepdims=True)  # only the ratio of upper to lower matters inside a cell
        return cls(cdf, np.concatenate(slots), layout, corners, weight.astype(np.float32))


def _integer_cdf(weights: NDArray[np.float64]) -> NDArray[np.uint32]:
    """Cumulative units of 2⁻³¹, at least one for every positive weight; all zero if no weight is positive."""
    cdf = np.cumsum(weights)
    positive = np.cumsum(weights > 0)
    if cdf[-1] <= 0:
        return np.zeros(len(weights), dtype=np.uint32)
    cdf *= ((1 << _BITS) - positive[-1]) / cdf[-1]
    units = cdf.astype(np.int64) + positive
    # The rounding of the product must not leave the last unit out: all cells from the last positive one on reach 1.
    units[positive == positive[-1]] = 1 << _BITS
    return units.astype(np.uint32)


@dataclass
class DirectionSample:
    """``uv`` (Point2f): map coordinates. ``d`` (Vector3f): unit direction, map's frame. ``pdf``: per steradian."""

    uv: mi.Point2f
    d: mi.Vector3f
    pdf: mi.Float


class RegionSampler:
    """Draws directions from the density of each region of a partition, and evaluates it.

    The tables are uploaded once, to the variant that is active at construction.
    """

    def __init__(self, environment: EnvironmentMap, regions: Regions) -> None:
        tables = RegionTables.build(environment, regions)
        self.count = len(regions)
        self.height, self.width = regions.shape
        self.regions = regions
        self._cdf = mi.UInt32(tables.cdf)
        self._slots = mi.UInt32(tables.slots)
        self._layout = mi.UInt32(tables.layout.ravel())
        self._corners = mi.Float(tables.corners.ravel())
        self._row_weight = mi.Float(tables.row_weight.ravel())
        self._index_map: mi.UInt32 | None = None

    def sample(
        self, region: mi.UInt32, u_cell: mi.Point2f, u_inside: mi.Point2f, active: mi.Bool | bool = True
    ) -> DirectionSample:
        """Draw one direction inside ``region``.

        Of the uniform random numbers ``u_cell.x`` chooses the cell, refined by ``u_cell.y`` below the resolution of
        single precision; ``u_inside`` chooses the point in the cell. The pdf is 0 if the region has no energy.
        """
        return self._invert(region, _units(u_cell.x, u_cell.y), u_inside, active)

    def sample_2d(
        self,
        region: mi.UInt32,
        u: mi.Point2f,
        u_fine: mi.Point2f,
        u_inside: mi.Point2f,
        active: mi.Bool | bool = True,
    ) -> DirectionSample:
        """Draw from the same density, the row of cells by ``u.y`` and the cell in it by ``u.x``.

        This keeps the two-dimensional stratification of low-discrepancy points, for the price of a search for the row.
        ``u_fine`` refines ``u`` below the resolution of single precision.
        """
        _, _, width, first_cell = dr.gather(mi.Vector4u, self._layout, 2 * region, active)
        rows = dr.gather(mi.UInt32, self._layout, 8 * region + 6, active)
        target = _units(u.y, u_fine.y)

        def below(row: mi.UInt32) -> mi.UInt32:
            """Units of all rows before ``row``."""
            return dr.gather(mi.UInt32, self._cdf, first_cell + row * width - 1, (row > 0) & active)

        row = dr.binary_search(0, self.height - 2, lambda r: (r + 1 < rows) & (below(r + 1) <= target))
        start = below(row)
        span = mi.UInt64(below(row + 1) - start)
        u_x = start + mi.UInt32((span * mi.UInt64(_units(u.x, u_fine.x))) >> _BITS)
        return self._invert(region, u_x, u_inside, active)

    @dr.syntax
    def _invert(
        self, region: mi.UInt32, u: mi.UInt32, u_inside: mi.Point2f, active: mi.Bool | bool = True
    ) -> DirectionSample:
        """The direction at ``u`` units of the region's CDF."""
        y0, x0, width, first_cell = dr.gather(mi.Vector4u, self._layout, 2 * region, active)
        first_slot, shift, _, _ = dr.gather(mi.Vector4u, self._layout, 2 * region + 1, active)

        # ----- The first cell whose cumulative units exceed u -----
        slot = first_slot + (u >> shift)
        cell = dr.gather(mi.UInt32, self._slots, slot, active)
        last = dr.gather(mi.UInt32, self._slots, slot + 1, active)
        while cell < last:
            middle = (cell + last) >> 1
            exceeds = dr.gather(mi.UInt32, self._cdf, first_cell + middle) > u
            last = dr.select(exceeds, middle, last)
            cell = dr.select(exceeds, cell, middle + 1)

        row = mi.UInt32((mi.Float(cell) + 0.5) / mi.Float(width))
        if dr.hint(self.width * self.height >= 1 << 22, mode="scalar"):
            # With so many cells the quotient can be off by one in single precision.
            row = dr.select(row * width > cell, row - 1, dr.select((row + 1) * width <= cell, row + 1, row))
        x, y = x0 + (cell - row * width), y0 + row
        corners = self._cell_corners(x, y, active)
        inside, pdf_inside = mi.warp.square_to_bilinear(*corners, u_inside)
        return self._direction_sample(
            (mi.Float(x) + inside.x + 0.5) / self.width,
            (mi.Float(y) + inside.y) / (self.height - 1),
            self._pmf(first_cell, cell, active) * pdf_inside * _rcp_mean(corners),
        )

    def pdf(self, d: mi.Vector3f, active: mi.Bool | bool = True) -> tuple[mi.Float, mi.UInt32]:
        """Density at the unit direction ``d`` (map's frame) of the region that contains it, and that region's index."""
        if self._index_map is None:
            self._index_map = mi.UInt32(self.regions.index_map().astype(np.uint32).ravel())
        (u, v), x, y = lattice_position(d, self.height, self.width)
        region = dr.gather(mi.UInt32, self._index_map, y * self.width + x, active)
        y0, x0, width, first_cell = dr.gather(mi.Vector4u, self._layout, 2 * region, active)
        corners = self._cell_corners(x, y, active)
        pdf_inside = mi.warp.square_to_bilinear_pdf(*corners, mi.Point2f(u - mi.Float(x), v - mi.Float(y)))
        sample = self._direction_sample(
            (u + 0.5) / self.width,
            v / (self.height - 1),
            self._pmf(first_cell, (y - y0) * width + (x - x0), active) * pdf_inside * _rcp_mean(corners),
        )
        return sample.pdf, region

    def _pmf(self, first_cell: mi.UInt32, cell: mi.UInt32, active: mi.Bool | bool) -> mi.Float:
        """Probability of a cell of the region whose CDF begins at ``first_cell``."""
        below = dr.gather(mi.UInt32, self._cdf, first_cell + cell - 1, (cell > 0) & active)
        return mi.Float(dr.gather(mi.UInt32, self._cdf, first_cell + cell, active) - below) * 2.0**-_BITS

    def _cell_corners(
        self, x: mi.UInt32, y: mi.UInt32, active: mi.Bool | bool
    ) -> tuple[mi.Float, mi.Float, mi.Float, mi.Float]:
        """Values of the density at the corners of a cell: luminance times the weight of the row, over the largest."""
        at = y * (self.width + 1) + x
        upper = dr.gather(mi.Float, self._row_weight, 2 * y, active)
        lower = dr.gather(mi.Float, self._row_weight, 2 * y + 1, active)
        v00 = upper * dr.gather(mi.Float, self._corners, at, active)
        v10 = upper * dr.gather(mi.Float, self._corners, at + 1, active)
        v01 = lower * dr.gather(mi.Float, self._corners, at + self.width + 1, active)
        v11 = lower * dr.gather(mi.Float, self._corners, at + self.width + 2, active)
        largest = dr.maximum(dr.maximum(v00, v10), dr.maximum(v01, v11))
        scale = dr.select(largest > 0, dr.rcp(largest), 0)  # or their squares could over- or underflow in the warp
        return v00 * scale, v10 * scale, v01 * scale, v11 * scale

    def _direction_sample(self, u: mi.Float, v: mi.Float, pdf_cell: mi.Float) -> DirectionSample:
        """Direction of the map coordinates (u, v), and its pdf per steradian from the density per cell."""
        sin_theta, cos_theta = dr.sincos(dr.pi * v)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * u)
        cells = self.width * (self.height - 1)
        # Equation (2): dω = 2π² sin θ du dv
        pdf = pdf_cell * cells / (2 * dr.pi**2 * sin_theta)
        return DirectionSample(
            uv=mi.Point2f(u, v),
            d=mi.Vector3f(sin_phi * sin_theta, cos_theta, -cos_phi * sin_theta),
            pdf=dr.select((pdf_cell > 0) & (sin_theta > 0), pdf, 0),
        )


def lattice_position(d: mi.Vector3f, height: int, width: int) -> tuple[mi.Point2f, mi.UInt32, mi.UInt32]:
    """Position of the unit direction ``d`` in cells of an H x W map, and the column and the row of its cell."""
    u = dr.atan2(d.x, -d.z) * dr.inv_two_pi * width - 0.5
    u = dr.select(u < 0, u + width, u)
    # The arc cosine would lose most of its digits near the poles.
    v = dr.atan2(dr.sqrt(d.x * d.x + d.z * d.z), d.y) * dr.inv_pi * (height - 1)
    return mi.Point2f(u, v), dr.minimum(mi.UInt32(u), width - 1), dr.minimum(mi.UInt32(v), height - 2)


def _units(u: mi.Float, u_fine: mi.Float) -> mi.UInt32:
    """A uniform integer below 2³¹ from a uniform float, which has 23 random bits, and another for the rest."""
    return (mi.UInt32(u * (1 << 23)) << (_BITS - 23)) | mi.UInt32(u_fine * (1 << (_BITS - 23)))


def _rcp_mean(corners: tuple[mi.Float, mi.Float, mi.Float, mi.Float]) -> mi.Float:
    mean = 0.25 * (corners[0] + corners[1] + corners[2] + corners[3])
    return dr.select(mean > 0, dr.rcp(mean), 0)
