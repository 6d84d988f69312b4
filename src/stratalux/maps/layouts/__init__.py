"""Layouts of maps: one module for each, and a line here."""

from __future__ import annotations

from .angular import ANGULAR
from .cube import CROSS, FACES, STRIP, VERTICAL_CROSS, VERTICAL_STRIP
from .equal_area import EQUAL_AREA
from .latlong import LATLONG
from .layout import Layout
from .mirror_ball import MIRROR_BALL
from .octahedral import OCTAHEDRAL
from .openexr_cube import OPENEXR_CUBE

__all__ = ["LATLONG", "LAYOUTS", "Layout"]

LAYOUTS: dict[str, Layout] = {
    layout.name: layout
    for layout in (
        LATLONG,
        CROSS,
        VERTICAL_CROSS,
        STRIP,
        VERTICAL_STRIP,
        FACES,
        OPENEXR_CUBE,
        OCTAHEDRAL,
        EQUAL_AREA,
        ANGULAR,
        MIRROR_BALL,
    )
}
"""By the names that ``--to`` and ``--env-layout`` take."""
