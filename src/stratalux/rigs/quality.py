"""How well lights stand for a map: on matte surfaces of all orientations, and in the shadow of a ball.

Both errors are relative and quadratic: the root of Σ |E' − E|² over the root of Σ |E|², E being the irradiance under
the map, E' under the lights, and the sums over places and the three channels together.

- ``irradiance_error``: without anything in the way, over all normals (:data:`NORMALS` of them, evenly spread).
- ``shadow_error``: on a floor under a ball of radius 1 that lies on it, over a square of side 6 around it. Light of the
  map and of the lights is blocked by the ball; ambient light is not, as real-time engines have it. A light with an
  angle is a disk.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..maps.envmap import EnvironmentMap
from .harmonics import COSINE, harmonics
from .kmeans import blocks
from .lights import Lights, frame_towards
from .rig import colours

_Float = NDArray[np.float64]

NORMALS = 1024
_RESOLUTION = (64, 128)
_SIDE = 24
"""Points along a side of the floor."""
_POINTS_OF_A_DISK = 16
_AT_A_TIME = 64


def quality(environment: EnvironmentMap, lights: Lights) -> dict[str, float]:
    """``irradiance_error`` and ``shadow_error``, 0 on a black map."""
    points, flux = sources(environment)
    normals = spread(NORMALS)
    under_map = irradiance(points, flux, normals)
    under_rig = irradiance(lights.direction, lights.colour, normals)
    floor = np.zeros(3)
    if lights.ambient is not None:
        under_rig += harmonics(normals) @ (COSINE[:, None] * lights.ambient)
        floor = harmonics(np.array([0.0, 1.0, 0.0])) @ (COSINE[:, None] * lights.ambient)
    return {
        "irradiance_error": _relative(under_rig, under_map),
        "shadow_error": _relative(_on_the_floor(*disks(lights)) + floor, _on_the_floor(points, flux)),
    }


def sources(environment: EnvironmentMap) -> tuple[_Float, _Float]:
    """The map as at most 64 x 128 points: directions (P, 3) and ∫ L dω of what each stands for (P, 3).

    Each is at the energy centroid of its texels; black ones are left out, unless all are.
    """
    points, label = blocks(environment, _RESOLUTION)
    return points, colours(environment, label, len(points))


def irradiance(points: _Float, flux: _Float, normals: _Float) -> _Float:
    """Σ flux max(0, n · point) for each of the ``normals`` (K, 3): (K, 3)."""
    result = np.empty((len(normals), 3))
    for first in range(0, len(normals), _AT_A_TIME):
        result[first : first + _AT_A_TIME] = np.maximum(normals[first : first + _AT_A_TIME] @ points.T, 0) @ flux
    return result


def spread(count: int) -> _Float:
    """Directions (count, 3), evenly over the sphere: a Fibonacci lattice."""
    k = np.arange(count) + 0.5
    z, φ = 1 - 2 * k / count, k * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(φ), r * np.sin(φ), z], axis=-1)


def _on_the_floor(points: _Float, flux: _Float) -> _Float:
    """Irradiance at the points of the floor, (K, 3)."""
    above = points[:, 1] > 0
    ω, arriving = points[above], flux[above] * points[above, 1:2]
    t = 6 * (np.arange(_SIDE) + 0.5) / _SIDE - 3
    x, z = (grid.ravel() for grid in np.meshgrid(t, t))
    centre = np.stack([-x, np.ones_like(x), -z], axis=-1)  # of the ball, seen from the point
    result = np.empty((len(x), 3))
    for first in range(0, len(x), _AT_A_TIME):
        c = centre[first : first + _AT_A_TIME]
        along = c @ ω.T
        # The squared distance at which a ray passes the centre.
        free = (along <= 0) | (np.sum(c * c, axis=1)[:, None] - along * along >= 1)
        result[first : first + _AT_A_TIME] = free @ arriving
    return result


def disks(lights: Lights) -> tuple[_Float, _Float]:
    """Directions and colours of the lights, those with an angle as :data:`_POINTS_OF_A_DISK` without."""
    direction, colour = [lights.direction], [lights.colour]
    for k in np.flatnonzero(lights.angle):
        j = np.arange(_POINTS_OF_A_DISK) + 0.5
        z = 1 - (1 - np.cos(lights.angle[k] / 2)) * j / _POINTS_OF_A_DISK
        φ, r = j * np.pi * (3 - np.sqrt(5)), np.sqrt(1 - z * z)
        disk = np.stack([r * np.cos(φ), r * np.sin(φ), z], axis=-1)
        direction.append(disk @ frame_towards(lights.direction[k]).T)
        colour.append(np.broadcast_to(lights.colour[k] / _POINTS_OF_A_DISK, disk.shape))
        colour[0] = np.where((np.arange(len(lights)) == k)[:, None], 0, colour[0])
    return np.concatenate(direction), np.concatenate(colour)


def _relative(found: _Float, wanted: _Float) -> float:
    size = float(np.sqrt(np.sum(wanted**2)))
    return float(np.sqrt(np.sum((found - wanted) ** 2))) / size if size else 0.0
