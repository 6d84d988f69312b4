"""A light rig: an environment map as N directional lights, each standing for a stratum of the map."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..maps.envmap import EnvironmentMap
from ..maps.geometry import texel_solid_angle
from .lights import Lights
from .voronoi import TexelDirections, centroids, slices


@dataclass(frozen=True)
class LightRig:
    """N directional lights that stand for the N strata of an H x W map.

    ``direction`` (N, 3): unit vectors towards the lights, in the map's frame (:mod:`.maps.geometry`). ``colour``
    (N, 3): ∫ L dω over the light's stratum, linear RGB, radiance times steradian. ``label`` (H, W) int32: index of the
    light whose stratum has each texel; every light has at least one. ``method``: the name of the technique.

    A texel stands for the solid angle of :func:`.maps.geometry.texel_solid_angle`. Raises :class:`InputError` if
    the arrays do not fit together.
    """

    direction: NDArray[np.float64]
    colour: NDArray[np.float64]
    label: NDArray[np.int32]
    method: str

    def __post_init__(self) -> None:
        n = len(self.direction)
        if n < 1 or self.direction.shape != (n, 3) or self.colour.shape != (n, 3):
            raise InputError(
                f"light rig: directions {self.direction.shape} and colours {self.colour.shape} are not both (N, 3)"
            )
        if not np.all(np.abs(np.linalg.norm(self.direction, axis=1) - 1) < 1e-5):
            raise InputError("light rig: a direction is not a unit vector")
        if not np.all(np.isfinite(self.colour)) or self.colour.min() < 0:
            raise InputError("light rig: a colour is negative or not finite")
        if self.label.ndim != 2 or self.label.dtype != np.int32 or self.label.size == 0:
            raise InputError(f"light rig: labels {self.label.shape} of type {self.label.dtype} are not (H, W) int32")
        if self.label.min() < 0 or self.label.max() >= n or np.bincount(self.label.ravel(), minlength=n).min() < 1:
            raise InputError(f"light rig: labels do not give each of the {n} lights at least one texel")

    def __len__(self) -> int:
        return len(self.direction)

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) of the map in texels."""
        return self.label.shape[0], self.label.shape[1]

    @property
    def total_colour(self) -> NDArray[np.float64]:
        """∫ L dω over the sphere, (3,): what all lights have together."""
        return np.sum(self.colour, axis=0)

    @cached_property
    def solid_angle(self) -> NDArray[np.float64]:
        """Steradians of each stratum, (N,); their sum is 4π."""
        total = np.bincount(self.label.ravel(), texel_solid_angle(*self.shape).ravel())
        return total.astype(np.float64)

    def lights(self) -> Lights:
        """The lights without their strata, to be written or measured."""
        return Lights(self.direction, self.colour, np.zeros(len(self)), self.method, self.solid_angle)

    def texels_by_light(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Table of the texels of each stratum, for jittered lights.

        Returns ``order`` (H · W,) and ``offset`` (N + 1,): the flat indices i · W + j of the texels of light k are
        ``order[offset[k]:offset[k + 1]]``, ascending.
        """
        label = self.label.ravel()
        offset = np.zeros(len(self) + 1, dtype=np.int64)
        np.cumsum(np.bincount(label, minlength=len(self)), out=offset[1:])
        return np.argsort(label, kind="stable"), offset


def rig_from_labels(
    environment: EnvironmentMap, label: NDArray[np.integer], method: str, direction: NDArray[np.floating] | None = None
) -> LightRig:
    """The rig whose strata are given by ``label`` (H, W), with ∫ L dω of each stratum as its colour.

    ``direction`` (N, 3): unit direction of each light; without it, the energy centroid of the stratum (its middle
    where it is black). A light without a texel is left out and the others are renumbered. Raises
    :class:`InputError` if the labels have another shape than the map.
    """
    shape = (environment.height, environment.width)
    if label.shape != shape:
        raise InputError(f"light rig: labels {label.shape} do not fit the map's {shape} texels")
    flat = label.ravel()
    count = np.bincount(flat, minlength=0 if direction is None else len(direction))
    if np.any(count == 0):
        flat = (np.cumsum(count > 0) - 1)[flat]
        direction = None if direction is None else direction[count > 0]
    n = int(np.count_nonzero(count))
    colour = colours(environment, flat, n)
    if direction is None:
        points = TexelDirections(environment.height, environment.width)
        solid_angle = texel_solid_angle(environment.height, environment.width).ravel()
        direction = centroids(points, energy(environment), solid_angle, flat, n)
    return LightRig(np.asarray(direction, np.float64), colour, flat.reshape(label.shape).astype(np.int32), method)


def colours(environment: EnvironmentMap, label: NDArray[np.integer], n: int) -> NDArray[np.float64]:
    """∫ L dω of the texels of each of ``n`` labels (H · W,): (n, 3)."""
    solid_angle = texel_solid_angle(environment.height, environment.width)[:, 0]
    texels = environment.texels.reshape(-1, 3)
    colour = np.zeros((n, 3))
    for some in slices(len(texels)):
        weight = solid_angle[np.arange(some.start, some.stop) // environment.width]
        colour += np.stack([np.bincount(label[some], weight * texels[some, c], n) for c in range(3)], axis=1)
    return colour


def energy(environment: EnvironmentMap) -> NDArray[np.float64]:
    """Luminance times solid angle of each texel, (H · W,)."""
    solid_angle = texel_solid_angle(environment.height, environment.width)
    return np.ravel(environment.luminance * solid_angle)


def importance(environment: EnvironmentMap) -> NDArray[np.float64]:
    """What lights are distributed by, (H · W,): the energy of each texel, or its solid angle if the map is black."""
    weight = energy(environment)
    return weight if weight.any() else np.ravel(texel_solid_angle(environment.height, environment.width))


def check_count(environment: EnvironmentMap, n: int) -> None:
    """Raise :class:`InputError` unless the map can have ``n`` lights, each with a texel of its own."""
    if n < 1:
        raise InputError(f"number of lights: {n} is too few; give at least 1")
    texels = environment.height * environment.width
    if n > texels:
        raise InputError(f"number of lights: {n} is more than the map's {texels} texels; give at most {texels}")
