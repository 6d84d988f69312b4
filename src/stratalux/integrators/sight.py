"""What is special about a scene as rays see it, found out once for each picture (Mitsuba)."""

from __future__ import annotations

import mitsuba as mi

from .straight import Obstacles, lets_through


class Sight:
    """``obstacles``: in place of the scene where some let light through, else None: a ray test will do."""

    def __init__(self, scene: mi.Scene) -> None:
        self.obstacles = Obstacles(scene) if lets_through(scene) else None
        self.straight = self.obstacles is not None
