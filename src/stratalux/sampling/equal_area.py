"""The light of a map as a quadtree over an equal-area square, on the device (Dr.Jit).

The square and its formulas are those of :mod:`..maps.layouts.equal_area`: a density per unit of the square is 4π times
the density per steradian. (θ, φ) are those of :mod:`stratalux.maps.geometry`, y up.

Nodes of the quadtree are numbered level by level, the four children of node i being 4i + 1 … 4i + 4: lower left,
lower right, upper left, upper right. Each level is in Z-order.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..maps.envmap import EnvironmentMap
from ..maps.layouts.equal_area import fold, to_direction, to_square

MAX_RESOLUTION = 2048
"""Texels along a side at most: 22 MB of nodes."""

_SURROUNDINGS = 0.05
"""The part of a texel's density that comes from the whole of its surroundings, so that none is missed."""

_FAINTEST = 1e-9
"""Density, over its mean, of a texel in which there is any light at all."""


_DRJIT = SimpleNamespace(
    abs=dr.abs,
    arctan2=dr.atan2,
    copysign=dr.copysign,
    ratio=lambda a, b: dr.select(b > 0, a / b, 0),
    rsqrt=dr.rsqrt,
    sincos=dr.sincos,
    sqrt=dr.sqrt,
    where=dr.select,
)


def square_to_map(s: mi.Point2f) -> mi.Point2f:
    """Map coordinates (u, v) = (φ / 2π, θ / π) of a point of the square."""
    p = 2 * s - 1
    t, r, upper = _fold(dr.abs(p))
    u = dr.select(p.y < 0, 1 - _quadrant(p.x, t), _quadrant(p.x, t))
    return mi.Point2f(u, _latitude(r, upper))


def square_to_direction(s: mi.Point2f) -> mi.Vector3f:
    """Unit direction, in the map's frame, of a point of the square."""
    p = 2 * s - 1
    return mi.Vector3f(*to_direction(p.x, p.y, _DRJIT))


def direction_to_square(d: mi.Vector3f) -> mi.Point2f:
    """The point of the square of a unit direction in the map's frame; the inverse of ``square_to_direction``."""
    return mi.Point2f(*to_square(d.x, d.y, d.z, _DRJIT))


def _fold(a: mi.Point2f) -> tuple[mi.Float, mi.Float, mi.Bool]:
    """(t, r, whether d ≥ 0) of ``a`` = |p|."""
    return fold(a.x, a.y, _DRJIT)


def _quadrant(x: mi.Float, t: mi.Float) -> mi.Float:
    """φ / 2π on the side y ≥ 0 of the square."""
    return dr.select(x < 0, 0.5 - 0.25 * t, 0.25 * t)


def _latitude(r: mi.Float, upper: mi.Bool) -> mi.Float:
    """θ / π: sin(θ / 2) = r / √2 keeps its digits at the pole, where the arc cosine loses them."""
    v = 2 * dr.inv_pi * dr.asin(dr.sqrt(0.5) * r)
    return dr.select(upper, v, 1 - v)


def texel_of_index(i: mi.UInt32) -> mi.Point2u:
    """Column and row of the ``i``-th texel of a level in Z-order: the even and the odd bits of ``i``."""
    return mi.Point2u(_even_bits(i), _even_bits(i >> 1))


def index_of_texel(texel: mi.Point2u) -> mi.UInt32:
    """The inverse of ``texel_of_index``."""
    return _spread_bits(texel.x) | (_spread_bits(texel.y) << 1)


def _even_bits(i: mi.UInt32) -> mi.UInt32:
    i = i & 0x55555555
    for shift, mask in ((1, 0x33333333), (2, 0x0F0F0F0F), (4, 0x00FF00FF), (8, 0x0000FFFF)):
        i = (i | (i >> shift)) & mask
    return i


def _spread_bits(i: mi.UInt32) -> mi.UInt32:
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        i = (i | (i << shift)) & mask
    return i


def warp(children: mi.Vector4f, u: mi.Point2d) -> tuple[mi.UInt32, mi.Float, mi.Point2d]:
    """One step of hierarchical sample warping: the child that ``u`` falls into, its value, and ``u`` within that child.

    Clarberg et al. 2005: choose the row in proportion to its sum and rescale ``u.y``, then the column in it and
    rescale ``u.x``. Uniform points stay uniform within each child, and neighbours stay neighbours. Every step uses up
    bits of ``u``, so it is in double precision. A child of value 0 is never chosen.
    """
    v = mi.Vector4d(children)
    lower, upper = v.x + v.y, v.z + v.w
    p_y = lower / (lower + upper)
    up = u.y >= p_y
    p_x = dr.select(up, v.z, v.x) / dr.select(up, upper, lower)
    right = u.x >= p_x
    u = mi.Point2d(
        dr.select(right, (u.x - p_x) / (1 - p_x), u.x / p_x), dr.select(up, (u.y - p_y) / (1 - p_y), u.y / p_y)
    )
    value = dr.select(up, dr.select(right, children.w, children.z), dr.select(right, children.y, children.x))
    return dr.select(right, mi.UInt32(1), 0) + dr.select(up, mi.UInt32(2), 0), value, u


class LightPyramid:
    """Means of a map's luminance over the nodes of the quadtree, in units of the mean of all, which is the root's.

    ``levels``: number of the finest level, which has ``resolution``² = 4^levels texels, at least as many as the map
    unless that exceeds ``MAX_RESOLUTION``. ``cells``: number of the level whose centroids of light are kept as well.
    ``black``: whether the map is, and with it every node.

    A texel's value is the mean of the bilinear luminance inside, from a grid of points about half a texel of the map
    apart, and for a small part the mean over all of the map's texels that the lookup can reach from inside. The value
    is therefore positive wherever the lookup is, in slivers that the grid misses too.
    """

    def __init__(self, environment: EnvironmentMap, cells: int = 0) -> None:
        side = np.sqrt(environment.height * environment.width)
        self.cells = cells
        self.levels = int(np.ceil(np.log2(np.clip(side, 1 << cells, MAX_RESOLUTION))))
        self.resolution = 1 << self.levels
        texels = _texel_values(environment, self.resolution, points=max(2, int(np.ceil(2 * side / self.resolution))))
        levels = [texels]
        while len(levels[0]) > 1:
            levels.insert(0, levels[0].reshape(-1, 4).mean(axis=1))
        self.black = levels[0][0] == 0
        # Without the root, so that four children are one aligned packet.
        self._nodes = mi.Float(np.concatenate(levels[1:]).astype(np.float32) if self.levels else np.zeros(4))
        self._centroids = _centroids(texels, self.resolution, 4**cells)

    def children(self, node: mi.UInt32, active: mi.Bool | bool = True) -> mi.Vector4f:
        """Values of the four children of ``node``."""
        return dr.gather(mi.Vector4f, self._nodes, node, active)

    def value(self, node: mi.UInt32, active: mi.Bool | bool = True) -> mi.Float:
        """Value of ``node``, which is not the root."""
        return dr.gather(mi.Float, self._nodes, node - 1, active)

    def centroid(self, cell: mi.UInt32, active: mi.Bool | bool = True) -> mi.Vector3f:
        """Mean direction, in the map's frame, of the light in the ``cell``-th node of the level ``cells``."""
        return dr.gather(mi.Vector3f, self._centroids, cell, active)


def first_node(level: int) -> int:
    """Number of the first node of a level."""
    return (4**level - 1) // 3


def _centroids(texels: NDArray[np.float64], resolution: int, cells: int) -> mi.Float:
    """Unit vectors, one after another, of the mean direction of each of ``cells`` equal stretches of ``texels``."""
    index = dr.arange(mi.UInt32, texels.size)
    weight = mi.Float(texels.astype(np.float32))
    d = square_to_direction((mi.Point2f(texel_of_index(index)) + 0.5) / resolution)
    total = mi.Vector3f(*(dr.block_reduce(dr.ReduceOp.Add, weight * x, texels.size // cells) for x in d))
    # The centroid of no light is never used, but must be a number.
    return dr.ravel(dr.select(dr.squared_norm(total) > 0, dr.normalize(total), mi.Vector3f(0, 1, 0)))


def _texel_values(environment: EnvironmentMap, resolution: int, points: int) -> NDArray[np.float64]:
    """Values of the finest level, in Z-order, (resolution²,), with a mean of 1."""
    texel = texel_of_index(dr.arange(mi.UInt32, resolution * resolution))
    values = (1 - _SURROUNDINGS) * _mean_inside(environment, texel, resolution, points)
    around, lit = _mean_around(environment, texel, resolution)
    values += _SURROUNDINGS * around
    mean = values.mean()
    if mean == 0:
        return values
    values /= mean
    values[lit] = np.maximum(values[lit], _FAINTEST)
    values[~lit] = 0
    return values


@dr.syntax
def _mean_inside(environment: EnvironmentMap, texel: mi.Point2u, resolution: int, points: int) -> NDArray[np.float64]:
    """Mean of the bilinear luminance at ``points``² points of each ``texel``."""
    height, width = environment.height, environment.width
    corners = mi.Float(np.concatenate([environment.luminance, environment.luminance[:, :1]], axis=1).ravel())
    n = dr.opaque(mi.UInt32, points)
    total, k = mi.Float(0), dr.zeros(mi.UInt32, dr.width(texel))
    while k < n * n:
        inside = (mi.Point2f(mi.Float(k % n), mi.Float(k // n)) + 0.5) / mi.Float(n)
        uv = square_to_map((mi.Point2f(texel) + inside) / resolution)
        x = uv.x * width - 0.5
        x = dr.select(x < 0, x + width, x)
        y = uv.y * (height - 1)
        column, row = dr.minimum(mi.UInt32(x), width - 1), dr.minimum(mi.UInt32(y), height - 2)
        at = row * (width + 1) + column
        x, y = x - mi.Float(column), y - mi.Float(row)
        upper = dr.lerp(dr.gather(mi.Float, corners, at), dr.gather(mi.Float, corners, at + 1), x)
        at += width + 1
        lower = dr.lerp(dr.gather(mi.Float, corners, at), dr.gather(mi.Float, corners, at + 1), x)
        total += dr.lerp(upper, lower, y)
        k += 1
    return (total / mi.Float(n * n)).numpy().astype(np.float64)


def _mean_around(
    environment: EnvironmentMap, texel: mi.Point2u, resolution: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Mean luminance of the texels of the map that the lookup can reach from inside each ``texel``, and if any is lit.

    Within a quadrant and a hemisphere r is linear in p and t is a ratio of linear functions, so both take their
    extremes at the corners. A texel that the fold halves is two triangles, of which that holds too.
    """
    step = 2 / resolution
    low = mi.Point2f(texel) * step - 1
    left, below = low.x < 0, low.y < 0
    # In |p| a texel on the negative side begins where it ends in p.
    x = dr.select(left, -low.x - step, low.x)
    y = dr.select(below, -low.y - step, low.y)
    t_low, t_high, v_low, v_high = mi.Float(1), mi.Float(0), mi.Float(1), mi.Float(0)
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        t, r, upper = _fold(mi.Point2f(x + i * step, y + j * step))
        v = _latitude(r, upper)
        # At a pole t is undefined, and the corners beside it already span the quadrant.
        t_low, t_high = dr.select(r > 0, dr.minimum(t_low, t), t_low), dr.select(r > 0, dr.maximum(t_high, t), t_high)
        v_low, v_high = dr.minimum(v_low, v), dr.maximum(v_high, v)
    u_a, u_b = (_quadrant(dr.select(left, -1, 1), t) for t in (t_low, t_high))
    u_a, u_b = dr.select(below, 1 - u_a, u_a), dr.select(below, 1 - u_b, u_b)

    # A hundredth of a cell covers the rounding of single precision.
    height, width = environment.height, environment.width
    u0, u1, v0, v1 = (a.numpy().astype(np.float64) for a in (dr.minimum(u_a, u_b), dr.maximum(u_a, u_b), v_low, v_high))
    x0 = np.floor(u0 * width - 0.51).astype(np.int64) + 1  # one column is repeated on each side
    x1 = np.floor(u1 * width - 0.49).astype(np.int64) + 3
    y0 = np.maximum(np.floor(v0 * (height - 1) - 0.01), 0).astype(np.int64)
    y1 = np.minimum(np.floor(v1 * (height - 1) + 0.01) + 2, height).astype(np.int64)
    luminance = np.pad(environment.luminance, ((0, 0), (1, 1)), mode="wrap")

    def over_boxes(values: NDArray[Any], kind: type[np.generic]) -> NDArray[Any]:
        table = np.zeros((height + 1, width + 3), dtype=kind)
        np.cumsum(values, axis=0, dtype=kind, out=table[1:, 1:])
        np.cumsum(table, axis=1, out=table)
        return table[y1, x1] - table[y0, x1] - table[y1, x0] + table[y0, x0]

    lit = over_boxes(luminance > 0, np.int64) > 0  # counted, for beside a sun a difference of sums loses what is dim
    return np.maximum(over_boxes(luminance, np.float64), 0) / ((x1 - x0) * (y1 - y0)), lit
