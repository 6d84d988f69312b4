"""Which light gets through to where: learned from the rays of a pilot, made use of by those that follow (Dr.Jit)."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

TILE = 8
"""Side in pixels of the squares that learn together: a few hundred rays for each sample per pixel."""
_SIDE = 8
_PARTS = _SIDE * _SIDE
"""Of the sphere, about alike: the squares of an octahedral map."""
_LEAST_DOUBT = 0.1


class Visibility:
    """V̂, the share of rays that got through, for each tile of the image and each part of the sphere.

    ``tile``: number of the one that each lane is in. ``counts``: rays so far and those that got through, which lanes
    add to; None if nothing is to be learned. ``learned``: V̂; None while there is nothing to be made use of.
    """

    def __init__(
        self, tile: mi.UInt32, counts: tuple[mi.UInt32, mi.UInt32] | None, learned: mi.Float | None = None
    ) -> None:
        self._first, self._counts, self._learned = tile * _PARTS, counts, learned

    @staticmethod
    def tile(x: mi.UInt32, y: mi.UInt32, width: mi.UInt32) -> mi.UInt32:
        """Number of the tile of pixel (x, y) of a film of that ``width``."""
        return y // TILE * ((width + (TILE - 1)) // TILE) + x // TILE

    @staticmethod
    def nothing(width: int, height: int) -> tuple[mi.UInt32, mi.UInt32]:
        """Counts to begin with, for a film of that size."""
        size = -(-width // TILE) * -(-height // TILE) * _PARTS
        counts = dr.zeros(mi.UInt32, size), dr.zeros(mi.UInt32, size)
        dr.make_opaque(counts)
        return counts

    @staticmethod
    def learn(counts: tuple[mi.UInt32 | mi.Float, mi.UInt32 | mi.Float]) -> mi.Float:
        """V̂: a half where there were no rays, and never quite 0 or 1."""
        rays, free = counts
        learned = (mi.Float(free) + 0.5) / (mi.Float(rays) + 1)
        dr.eval(learned)
        return learned

    def expected(self, d: mi.Vector3f, active: mi.Bool) -> tuple[mi.Float, mi.Float]:
        """V̂ towards ``d``, and the standard deviation of V in units of the largest one, a half."""
        if self._learned is None:
            return mi.Float(0), mi.Float(1)
        V = dr.gather(mi.Float, self._learned, self._first + _part(d), active)
        return V, dr.maximum(2 * dr.sqrt(V * (1 - V)), _LEAST_DOUBT)

    def note(self, d: mi.Vector3f, hit: mi.Bool, active: mi.Bool) -> None:
        """What a ray towards ``d`` has found."""
        if self._counts is not None:
            rays, free = self._counts
            place = self._first + _part(d)
            dr.scatter_add(rays, mi.UInt32(1), place, active)
            dr.scatter_add(free, mi.UInt32(1), place, active & ~hit)


def _part(d: mi.Vector3f) -> mi.UInt32:
    """Number of the square of an octahedral map that ``d`` points to."""
    d = d / (dr.abs(d.x) + dr.abs(d.y) + dr.abs(d.z))  # another array: the caller keeps its own
    upper = d.y >= 0
    x = dr.select(upper, d.x, dr.mulsign(1 - dr.abs(d.z), d.x))
    z = dr.select(upper, d.z, dr.mulsign(1 - dr.abs(d.x), d.z))
    i, j = (dr.minimum(mi.UInt32(_SIDE / 2 * (t + 1)), _SIDE - 1) for t in (x, z))
    return i * _SIDE + j
