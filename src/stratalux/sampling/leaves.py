"""Rectangles of exactly equal energy, cut anywhere between texels: the leaves of a median cut (Dr.Jit).

A direction drawn uniformly inside a random leaf has the density of the map, without any search, and leaves that follow
each other in the order of the tree of cuts are neighbours on the sphere: strata of any size are ranges of leaves.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..maps.energy_table import EnergyTable
from ..maps.envmap import EnvironmentMap
from .recording import recorded

FLOOR = 0.01
"""Luminance added everywhere, in units of the map's mean: no leaf is so large that a lone bright texel in it stands for
much more light than the leaf's share."""

_NODE = 8
"""Numbers that describe a rectangle: x0, y0, x1, y1; the energy before (x0, y0), (x1, y0), (x0, y1) and (x1, y1)."""
_PROFILE = 8
_WALK = 4
"""Levels that a lane walks through by itself while rectangles are few: a launch takes longer than the cuts."""
_FEW = 1 << 11


def equal_energy_leaves(environment: EnvironmentMap, depth: int) -> NDArray[np.float64]:
    """Cut the map ``depth`` times into halves of equal energy; (2^depth, 4): x, y, width, height of the leaves.

    The unit is a cell (see :mod:`.maps.geometry`): x in [0, W], y in [0, H − 1], the origin at the centre of texel
    (0, 0). Every rectangle is cut across its longer side, as in :func:`.maps.median_cut.median_cut`, at the exact
    position where the integral of the bilinear luminance (plus :data:`FLOOR`) is halved. Leaves are in the order of the
    tree. A black map is cut into equal solid angles. Raises :class:`InputError` for a depth that is not in 0 … 24.
    """
    leaves: NDArray[np.float64] = cut_regions(environment.energy_table, None, depth).numpy().reshape(-1, 4)
    leaves[:, 2:] -= leaves[:, :2]
    return leaves


def cut_regions(table: EnergyTable, bounds: NDArray[np.int64] | None, depth: int) -> mi.Float64:
    """The same for each of N rectangles of whole cells, or for the map if ``bounds`` is None.

    ``bounds`` (N, 4): y0, y1, x0, x1, as in :class:`.maps.regions.Regions`. Returned are, for each of the N 2^depth
    leaves, region after region, x0, y0, x1 and y1. What follows after the last leaf means nothing.
    """
    if not 0 <= depth <= 24:
        raise InputError(f"depth of the leaves: {depth} is out of range; give 0 to 24")
    if bounds is None:
        bounds = np.array([[0, table.height - 1, 0, table.width]])
    roots = _roots(table, bounds)
    if depth == 0:
        return mi.Float64(roots[:, :4].ravel())
    count = len(roots)
    nodes = mi.Float64(roots.ravel())
    kind = mi.UInt32 if table.sums.dtype == np.uint32 else mi.Float64
    sums, profile = kind(table.sums.ravel()), mi.Float64(_profile(table).ravel())
    floor, height, width = mi.Float64(added_luminance(table)), mi.UInt32(table.height), mi.UInt32(table.width)
    unit = mi.Float64(table.unit)
    dr.make_opaque(nodes, floor, height, width, unit)
    while depth:
        levels = min(_WALK if count << _WALK <= _FEW else 1, depth)
        count <<= levels
        depth -= levels
        lane = dr.arange(mi.UInt32, 1 << (count // 2 - 1).bit_length())  # few sizes, as each is recorded anew
        halves = dr.empty(mi.Float64, 2 * (_NODE if depth else 4) * len(lane))
        used, steps = mi.UInt32(count // 2), mi.UInt32(levels)
        dr.make_opaque(lane, used, steps)
        _cut(sums, unit, profile, floor, height, width, nodes, halves, lane, used, steps, depth == 0)
        nodes = halves
    return nodes


def added_luminance(table: EnergyTable) -> float:
    """What :data:`FLOOR` stands for."""
    return FLOOR * table.total / (4 * np.pi) or 1.0


def _roots(table: EnergyTable, bounds: NDArray[np.int64]) -> NDArray[np.float64]:
    rows = np.append(0, np.cumsum(table.row[:-1])) + table.above * table.row  # steradians before y, of a column
    energy = table.corners(bounds) + added_luminance(table) * rows[bounds[:, :2, None]] * (bounds[:, None, 2:] + 0.5)
    return np.concatenate([bounds[:, [2, 0, 3, 1]], energy.reshape(-1, 4)], axis=1)


def _profile(table: EnergyTable) -> NDArray[np.float64]:
    """How energy grows along the axes, (H + 3, 8), for rows of texels k and, in the last entry, for columns.

    A position t in [0, 1] after texel k has passed the part a + b t (2 − t) of this texel's hat and c t² of the next
    one's: a, b, c, the steradians of all texels before k, those of texel k and of the next one.
    """
    height, row = table.height, table.row
    profile = np.zeros((height + 3, _PROFILE))
    profile[:height, 0] = table.above
    profile[:height, 1] = 1 - table.above
    profile[: height - 1, 2] = table.above[1:]
    profile[: height + 2, 3] = [0, *np.cumsum(row), row.sum()]
    profile[:height, 4] = row
    profile[: height - 1, 5] = row[1:]
    profile[-1, :6] = 0.5, 0.5, 0.5, 0, 1, 1
    return profile


class _Axes:
    """The axis along which each lane cuts, and the other one. Positions are in cells, entries in those of the table."""

    def __init__(
        self,
        sums: mi.Float64 | mi.UInt32,
        unit: mi.Float64,
        profile: mi.Float64,
        height: mi.UInt32,
        width: mi.UInt32,
        vertical: mi.Bool,
    ) -> None:
        stride = width + 3
        self.sums, self.unit, self.profile, self.columns, self.vertical = sums, unit, profile, height + 2, vertical
        self.step, self.across = dr.select(vertical, 1, stride), dr.select(vertical, stride, 1)
        self.last = dr.select(vertical, width - 1, height - 2)
        self._last_across = dr.select(vertical, height - 2, width - 1)

    def hat(self, k: mi.UInt32) -> tuple[mi.Float64, mi.Float64, mi.Float64]:
        """a, b and c of :func:`_profile` along the axis of the cut."""
        a, b, c, _ = dr.gather(mi.Vector4d, self.profile, 2 * dr.select(self.vertical, self.columns, k))
        return a, b, c

    def end(self, position: mi.Float64, floor: mi.Float64) -> tuple[Any, ...]:
        """For an end across the cut: where its three entries begin, their parts, and the floor before it."""
        k = dr.minimum(mi.UInt32(position), self._last_across)
        at = 2 * dr.select(self.vertical, k, self.columns)
        a, b, c, before = dr.gather(mi.Vector4d, self.profile, at)
        this, following, _, _ = dr.gather(mi.Vector4d, self.profile, at + 1)
        first, second = passed(a, b, c, position - mi.Float64(k))
        before = dr.select(self.vertical, before, mi.Float64(k)) + this * first + following * second
        return k * self.across, 1 - first, first - second, second, floor * before

    def energy(self, end: tuple[Any, ...], k: mi.UInt32) -> mi.Float64:
        """Energy between the origin, an ``end`` and all texels before number ``k`` along the axis of the cut."""
        begin, p0, p1, p2, floor = end
        at = begin + k * self.step
        before = dr.select(
            self.vertical, mi.Float64(k), dr.gather(mi.Float64, self.profile, _PROFILE * k + 3, ~self.vertical)
        )
        energy = dr.fma(p2, self.sum(at + 2 * self.across), floor * before)
        energy = dr.fma(p1, self.sum(at + self.across), energy)
        return dr.fma(p0, self.sum(at), energy)

    def sum(self, at: mi.UInt32) -> mi.Float64:
        """An entry of the table."""
        found = dr.gather(type(self.sums), self.sums, at)
        return found if dr.is_float_v(found) else mi.Float64(found) * self.unit


def passed(a: mi.Float64, b: mi.Float64, c: mi.Float64, t: mi.Float64) -> tuple[mi.Float64, mi.Float64]:
    """The parts of two neighbouring texels' hats before the position ``t`` between them."""
    return dr.fma(b, t * (2 - t), a), c * t * t


@recorded
@dr.syntax
def _cut(
    sums: mi.Float64 | mi.UInt32,
    unit: mi.Float64,
    profile: mi.Float64,
    floor: mi.Float64,
    height: mi.UInt32,
    width: mi.UInt32,
    nodes: mi.Float64,
    halves: mi.Float64,
    lane: mi.UInt32,
    used: mi.UInt32,
    levels: mi.UInt32,
    last: bool,
) -> None:
    """The last of ``levels`` generations of cuts below ``nodes``: there, both halves of rectangle number ``lane``.

    Of the ``last`` generation of all, just the bounds.
    """
    active = lane < used
    parent = lane >> (levels - 1)
    x0, y0, x1, y1 = dr.gather(mi.Vector4d, nodes, 2 * parent, active)
    e00, e10, e01, e11 = dr.gather(mi.Vector4d, nodes, 2 * parent + 1, active)
    vertical = mi.Bool(True)  # The cut runs vertically, across the width
    cut = mi.Float64(0)
    near, far = mi.Float64(0), mi.Float64(0)  # Energy before the ends of the cut
    todo = dr.select(active, levels, 0)
    while todo > 0:
        todo -= 1
        across = 2 * (x1 - x0) / mi.Float64(width) * dr.sin(dr.pi * (y0 + y1) / (2 * (mi.Float64(height) - 1)))
        vertical = across >= (y1 - y0) / (mi.Float64(height) - 1)
        axes = _Axes(sums, unit, profile, height, width, vertical)
        start, stop = dr.select(vertical, x0, y0), dr.select(vertical, x1, y1)
        upper = axes.end(dr.select(vertical, y0, x0), floor)
        lower = axes.end(dr.select(vertical, y1, x1), floor)
        goal = 0.5 * (dr.select(vertical, e01 - e00, e10 - e00) + dr.select(vertical, e11 - e10, e11 - e01))

        # -------- The texel up to which it takes less than half of the energy --------
        low, high = dr.minimum(mi.UInt32(start), axes.last), dr.minimum(mi.UInt32(stop), axes.last) + 1
        while high - low > 1:
            k = (low + high) >> 1
            short = axes.energy(lower, k) - axes.energy(upper, k) <= goal
            low, high = dr.select(short, k, low), dr.select(short, high, k)

        # ----- The cut lies within a cell of it: there the energy is quadratic -----
        n0, n1 = axes.energy(upper, low), axes.energy(upper, low + 1)
        f0, f1 = axes.energy(lower, low), axes.energy(lower, low + 1)
        a, b, c = axes.hat(low)
        earlier = (low > 0) & (goal < dr.fma(a, f1 - f0 - n1 + n0, f0 - n0))
        k = dr.minimum(dr.select(earlier, low - 1, low), axes.last)
        earlier = k < low
        third = dr.select(earlier, k, k + 2)
        n2, f2 = axes.energy(upper, third), axes.energy(lower, third)
        n0, n1, n2 = dr.select(earlier, n2, n0), dr.select(earlier, n0, n1), dr.select(earlier, n1, n2)
        f0, f1, f2 = dr.select(earlier, f2, f0), dr.select(earlier, f0, f1), dr.select(earlier, f1, f2)
        a, b, c = axes.hat(k)
        h0, h1 = dr.maximum(f1 - f0 - n1 + n0, 0), dr.maximum(f2 - f1 - n2 + n1, 0)
        missing = dr.maximum(goal - dr.fma(a, h0, f0 - n0), 0)  # = b h0 t (2 − t) + c h1 t²
        divisor = b * h0 + dr.sqrt(dr.maximum(dr.fma(b * h0, b * h0, (c * h1 - b * h0) * missing), 0))
        t = dr.select(divisor > 0, missing / divisor, 0.5)
        cut = dr.clip(mi.Float64(k) + dr.clip(t, 0, 1), start, stop)
        first, second = passed(a, b, c, cut - mi.Float64(k))
        near = n0 + first * (n1 - n0) + second * (n2 - n1)
        far = f0 + first * (f1 - f0) + second * (f2 - f1)

        # ------------------- Go on in the half that the lane leads to -------------------
        more = todo > 0
        into = mi.Bool(((lane >> (todo - 1)) & 1) == 1)
        lowers, uppers = more & ~into, more & into
        x1, y1 = dr.select(lowers & vertical, cut, x1), dr.select(lowers & ~vertical, cut, y1)
        x0, y0 = dr.select(uppers & vertical, cut, x0), dr.select(uppers & ~vertical, cut, y0)
        e00, e11 = dr.select(uppers, near, e00), dr.select(lowers, far, e11)
        e10 = dr.select(lowers & vertical, near, dr.select(uppers & ~vertical, far, e10))
        e01 = dr.select(lowers & ~vertical, near, dr.select(uppers & vertical, far, e01))

    flat = ~vertical
    quadruples = (
        (x0, y0, dr.select(vertical, cut, x1), dr.select(flat, cut, y1)),
        (e00, dr.select(vertical, near, e10), dr.select(flat, near, e01), far),
        (dr.select(vertical, cut, x0), dr.select(flat, cut, y0), x1, y1),
        (near, dr.select(flat, far, e10), dr.select(vertical, far, e01), e11),
    )
    written = quadruples[::2] if last else quadruples
    for i, values in enumerate(written):
        # With any other mode, each of them would be a kernel of its own.
        dr.scatter(halves, mi.Vector4d(*values), len(written) * lane + i, active, mode=dr.ReduceMode.NoConflicts)
