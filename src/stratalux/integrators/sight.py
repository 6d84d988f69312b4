"""What is special about a scene as rays see it, found out once for each picture (Mitsuba)."""

from __future__ import annotations

from typing import Any

import mitsuba as mi

from .backdrop import Background, Light, Nothing, Plate
from .both_ways import BothWays
from .catcher import Catcher
from .straight import Obstacles, lets_through


class Sight:
    """``masks``: whether something lets light straight through. If so, ``obstacles`` are in place of the scene.

    ``backdrop``: what camera rays see that meet nothing, None where that is as the scene has it. ``catcher``: what
    shows nothing but shadows. ``straight``: whether camera rays pass anything. ``fades``: whether alpha is a share.
    ``ways``: how paths from the camera share with those from the map, where there are such.
    """

    def __init__(
        self,
        scene: mi.Scene,
        background: Background = "map",
        hidden: bool = False,
        sensor: mi.Sensor | None = None,
        catcher: Catcher | None = None,
    ) -> None:
        self.catcher = catcher
        self.masks = lets_through(scene)
        self.obstacles = Obstacles(scene) if self.masks else None
        hides_lamps = hidden and any(shape.is_emitter() for shape in scene.shapes())
        self.straight = self.masks or catcher is not None or hides_lamps
        self.backdrop = _backdrop(scene, background, sensor)
        if catcher is not None and self.backdrop is None:
            self.backdrop = Nothing() if hidden else Light(scene.environment())
        self.ways: BothWays | None = None
        self.fades = catcher is not None and isinstance(self.backdrop, Nothing)

    def parts(self) -> tuple[mi.Object, ...]:
        """What rays see besides the scene."""
        parts = self.backdrop.parts() if self.backdrop is not None else ()
        return parts if self.catcher is None else (*parts, self.catcher.white)

    def arrays(self) -> tuple[Any, ...]:
        """What kernels read besides the scene's own."""
        found = self.parts(), self.catcher.arrays() if self.catcher is not None else ()
        return found if self.ways is None else (*found, self.ways.arrays())


def _backdrop(scene: mi.Scene, background: Background, sensor: mi.Sensor | None) -> Light | Nothing | Plate | None:
    if background == "map":
        return None
    if isinstance(background, mi.Emitter):
        return Light(background)
    if isinstance(background, mi.Texture):
        return Plate(background, sensor if sensor is not None else scene.sensors()[0])
    return Nothing()
