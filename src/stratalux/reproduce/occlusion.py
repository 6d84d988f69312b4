"""Where the bright lights of a map are hidden from a surface, found by tracing rays."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..maps.envmap import EnvironmentMap
from ..rigs.rig import energy
from ..rigs.voronoi import texel_directions
from .view import View

BRIGHTEST = 0.5
"""The part of the map's energy, in its brightest texels, that counts as the bright lights."""


def bright_directions(environment: EnvironmentMap, count: int, share: float = BRIGHTEST) -> NDArray[np.float64]:
    """``count`` unit directions (count, 3), map's frame, each for an equal part of the brightest texels' energy.

    The brightest texels are the fewest that together have ``share`` of the map's energy. A black map gives directions
    all over the sphere.
    """
    points = texel_directions(environment.height, environment.width)
    weight = energy(environment)
    if not weight.any():
        return points[np.linspace(0, len(points) - 1, count).astype(int)]
    order = np.argsort(-np.ravel(environment.luminance), kind="stable")
    reached = np.searchsorted(np.cumsum(weight[order]), share * weight.sum())
    bright = np.sort(order[: reached + 1])  # row by row: quantiles of the energy are then spread over the map
    cumulative = np.cumsum(weight[bright])
    at = np.searchsorted(cumulative, (np.arange(count) + 0.5) / count * cumulative[-1])
    return points[bright[at]]


def hidden_share(view: View, directions: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Which part of ``directions`` (world's frame) sends no light to the first hit of each pixel, (H, W), NaN if none.

    A direction is hidden if it lies below the surface or if something is in the way. Second: the part of the directions
    that lie above the surface, over all hits.
    """
    si = view.intersections()
    valid = si.is_valid()
    hidden, above = mi.Float(0), mi.Float(0)
    table = mi.Float(np.asarray(directions, dtype=np.float32).ravel())
    normal = dr.select(si.wi.z < 0, -si.sh_frame.n, si.sh_frame.n)  # the side that is seen
    for k in range(len(directions)):
        d = dr.gather(mi.Vector3f, table, dr.opaque(mi.UInt32, k))
        facing = valid & (dr.dot(normal, d) > 0)
        open_ = facing & ~view.scene.ray_test(si.spawn_ray(d), facing)
        above += dr.select(facing, mi.Float(1), 0)
        hidden += dr.select(open_, mi.Float(0), 1)
        dr.eval(hidden, above)
    share = view.per_pixel(dr.select(valid, hidden / len(directions), dr.nan)).astype(np.float64)
    hits = int(np.count_nonzero(np.array(valid)))
    return share.mean(axis=2), float(np.array(above)[np.array(valid)].sum() / max(1, hits * len(directions)))
