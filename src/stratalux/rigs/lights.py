"""What a rig is once it leaves: directional lights and an ambient one, as numbers that a file can hold."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .harmonics import turned

_Float = NDArray[np.float64]


@dataclass(frozen=True)
class Lights:
    """N directional lights, and what shines from everywhere.

    ``direction`` (N, 3): unit vectors towards the lights, in the map's frame (:mod:`..maps.geometry`: y up, the middle
    of the map at +z, right-handed). ``colour`` (N, 3): linear Rec. 709, the irradiance of a surface that faces the
    light; radiance in W/(m²·sr) times steradian, so W/m². ``angle`` (N,): diameter of the light as it is seen, in
    radians; 0 for a light whose shadows are sharp. ``solid_angle`` (N,): steradians of what each stands for, or None.
    ``ambient`` (9, 3): radiance from all sides as coefficients of the real spherical harmonics of
    :mod:`.harmonics`; the first alone is a constant. None for no ambient light. ``method``: how it was made. ``map``:
    the path of the map, or None. ``quality``: what is known of its errors (:mod:`.quality`).
    ``turned``: degrees about +y that :meth:`turn` has turned them by; 0 in the map's frame.

    Raises :class:`InputError` if the arrays do not fit together, are not finite, or a colour is negative.
    """

    direction: _Float
    colour: _Float
    angle: _Float
    method: str
    solid_angle: _Float | None = None
    ambient: _Float | None = None
    map: str | None = None
    quality: dict[str, float] = field(default_factory=dict)
    turned: float = 0.0

    def __post_init__(self) -> None:
        n = len(self.direction)
        if n < 1 or self.direction.shape != (n, 3) or self.colour.shape != (n, 3) or self.angle.shape != (n,):
            raise InputError(
                f"lights: directions {self.direction.shape}, colours {self.colour.shape} and angles "
                f"{self.angle.shape} are not (N, 3), (N, 3) and (N,)"
            )
        if not np.all(np.abs(np.linalg.norm(self.direction, axis=1) - 1) < 1e-5):
            raise InputError("lights: a direction is not a unit vector")
        if not np.all(np.isfinite(self.colour)) or self.colour.min() < 0:
            raise InputError("lights: a colour is negative or not finite")
        if not np.all((self.angle >= 0) & (self.angle <= np.pi)):
            raise InputError("lights: an angle is not between 0 and 180 degrees")
        if self.ambient is not None and (self.ambient.shape != (9, 3) or not np.all(np.isfinite(self.ambient))):
            raise InputError(f"lights: the ambient light {self.ambient.shape} is not (9, 3) finite numbers")

    def __len__(self) -> int:
        return len(self.direction)

    @property
    def varies(self) -> bool:
        """Whether the ambient light is not the same from all sides."""
        return self.ambient is not None and bool(np.any(self.ambient[1:]))

    @property
    def ambient_radiance(self) -> _Float:
        """The mean radiance of the ambient light over the sphere, (3,); not negative."""
        return np.zeros(3) if self.ambient is None else np.maximum(self.ambient[0] / np.sqrt(4 * np.pi), 0)

    def without_variation(self) -> Lights:
        """The lights with the mean of the ambient light, from everywhere."""
        if self.ambient is None:
            return self
        return replace(self, ambient=np.concatenate([self.ambient[:1], np.zeros((8, 3))]))

    def turn(self, degrees: float) -> Lights:
        """The lights turned about +y, counter-clockwise seen from above: at 90, what was at +z is at +x."""
        if not degrees % 360:
            return self
        φ = np.radians(degrees)
        rotation = np.array([[np.cos(φ), 0, np.sin(φ)], [0, 1, 0], [-np.sin(φ), 0, np.cos(φ)]])
        ambient = None if self.ambient is None else turned(self.ambient, rotation)
        direction = self.direction @ rotation.T
        return replace(self, direction=direction, ambient=ambient, turned=self.turned + degrees)

    def named(self) -> list[tuple[str, _Float, _Float, float]]:
        """Name, direction, colour and angle of each light that shines."""
        digits = len(str(len(self)))
        return [
            (f"light_{k + 1:0{digits}}", self.direction[k] + 0.0, self.colour[k], float(self.angle[k]))
            for k in range(len(self))
            if self.colour[k].any()
        ]


def split(colour: _Float) -> tuple[list[float], float]:
    """A colour whose largest component is 1, and the strength that makes the light of it, as most tools have it."""
    strength = float(colour.max())
    return (colour / strength if strength else np.ones(3)).tolist(), strength


def frame_towards(direction: _Float) -> _Float:
    """A rotation (3, 3) that takes +z to ``direction``, on the shortest way."""
    x, y, z = direction.tolist()
    if z < -1 + 1e-12:
        return np.diag([-1.0, 1.0, -1.0])
    return np.array(
        [[1 - x * x / (1 + z), -x * y / (1 + z), x], [-x * y / (1 + z), 1 - y * y / (1 + z), y], [-x, -y, z]]
    )


def quaternion_towards(direction: _Float) -> list[float]:
    """The rotation of :func:`frame_towards` as (x, y, z, w)."""
    x, y, z = direction.tolist()
    if z < -1 + 1e-12:
        return [0.0, 1.0, 0.0, 0.0]
    q = np.array([-y, x, 0.0, 1 + z])
    return [float(a) for a in q / np.linalg.norm(q)]


def plain(array: NDArray[Any]) -> Any:
    """Nested lists of Python's numbers."""
    return np.asarray(array, dtype=np.float64).tolist()
