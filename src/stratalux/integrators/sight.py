"""What is special about a scene as rays see it, found out once for each picture (Mitsuba)."""

from __future__ import annotations

import mitsuba as mi

from .backdrop import Background, Light, Nothing, Plate
from .straight import Obstacles, lets_through


class Sight:
    """``obstacles``: in place of the scene where some let light through, else None: a ray test will do.

    ``backdrop``: what camera rays see that meet nothing, None where that is as the scene has it. ``straight``: whether
    they pass anything.
    """

    def __init__(self, scene: mi.Scene, background: Background = "map", sensor: mi.Sensor | None = None) -> None:
        self.obstacles = Obstacles(scene) if lets_through(scene) else None
        self.straight = self.obstacles is not None
        self.backdrop = _backdrop(scene, background, sensor)

    def parts(self) -> tuple[mi.Object, ...]:
        """What rays see besides the scene."""
        return self.backdrop.parts() if self.backdrop is not None else ()


def _backdrop(scene: mi.Scene, background: Background, sensor: mi.Sensor | None) -> Light | Nothing | Plate | None:
    if background == "map":
        return None
    if isinstance(background, mi.Emitter):
        return Light(background)
    if isinstance(background, mi.Texture):
        return Plate(background, sensor if sensor is not None else scene.sensors()[0])
    return Nothing()
