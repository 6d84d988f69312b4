"""The sun of a map: where it is, how wide, and what it adds to the sky around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..images.colour import LUMINANCE
from ..maps.envmap import EnvironmentMap
from ..maps.geometry import texel_solid_angle
from .voronoi import texel_directions

_Float = NDArray[np.float64]

_RADIUS = np.radians(5)
"""Around the brightest texel: what is within belongs to the sun as far as it is brighter than what is around."""
_WIDEST = np.radians(5)
_LEAST_SHARE = 0.05


@dataclass(frozen=True)
class Sun:
    """``direction`` (3,), unit. ``colour`` (3,): ∫ dω of what it has more than the sky around it. ``angle``: its
    diameter in radians, that of a disk of uniform radiance which is as concentrated. ``share`` of the map's luminance.
    """

    direction: _Float
    colour: _Float
    angle: float
    share: float

    @property
    def is_one(self) -> bool:
        """Whether it is as small and as bright as a sun is, and not a window or a lamp."""
        return self.angle <= _WIDEST and self.share >= _LEAST_SHARE

    @property
    def doubt(self) -> str:
        """Why it is none, if :attr:`is_one` says so."""
        return (
            f"the map has no sun: its brightest spot is {np.degrees(self.angle):.2g} degrees wide and has "
            f"{self.share:.1%} of the light"
        )


def find_sun(environment: EnvironmentMap) -> Sun:
    """The brightest spot of the map, which :attr:`Sun.is_one` or not.

    Its sky is the median of the texels between 5 and 10 degrees from the brightest one (a texel and a half, where
    these are larger). With Y what a texel is brighter, the solid angle of the disk is (∫ Y dω)² / ∫ Y² dω.
    """
    return split_sun(environment)[0]


def split_sun(environment: EnvironmentMap) -> tuple[Sun, EnvironmentMap]:
    """The sun as :func:`find_sun` has it, and the map without: their light together is that of the map."""
    height, width = environment.height, environment.width
    weight = np.ravel(texel_solid_angle(height, width))
    points = texel_directions(height, width)
    texels = environment.texels.reshape(-1, 3)
    peak = points[np.argmax(environment.luminance)]
    radius = max(_RADIUS, 1.5 * np.pi / (height - 1), 1.5 * 2 * np.pi / width)
    distance = np.arccos(np.clip(points @ peak, -1, 1))
    within, around = distance <= radius, (distance > radius) & (distance <= 2 * radius)
    sky = np.median(texels[around], axis=0) if around.any() else np.zeros(3)
    excess = np.maximum(texels[within].astype(np.float64) - sky, 0)
    Y, dω = excess @ LUMINANCE.astype(np.float64), weight[within]
    flux = float(Y @ dω)
    total = float(environment.luminance.ravel().astype(np.float64) @ weight)
    if flux <= 0 or total <= 0:
        return Sun(peak, np.zeros(3), 0.0, 0.0), environment
    moment = (Y * dω) @ points[within]
    Ω = flux**2 / float(Y**2 @ dω)
    angle = 2 * np.arccos(max(1 - Ω / (2 * np.pi), -1.0))
    rest = texels.copy()
    rest[within] -= excess.astype(np.float32)
    sun = Sun(moment / np.linalg.norm(moment), dω @ excess, float(angle), flux / total)
    return sun, EnvironmentMap(np.maximum(rest, 0).reshape(environment.texels.shape))
