"""The cube of OpenEXR (``envmap`` in a header): +X, −X, +Y, −Y, +Z and −Z, one below the other.

Centres of the outer pixels are the edges of the cube, so that neighbouring faces share them (OpenEXR's
``ImfEnvmap.h``). Its axes are those of :mod:`..geometry`, and its faces are seen from within.
"""

from __future__ import annotations

from .faces import Cube, Face
from .layout import Layout

_CUBE = Cube(
    (
        Face((0, 1), (2, 1), (1, -1)),
        Face((0, -1), (2, -1), (1, -1)),
        Face((1, 1), (0, 1), (2, -1)),
        Face((1, -1), (0, 1), (2, 1)),
        Face((2, 1), (0, -1), (1, -1)),
        Face((2, -1), (0, 1), (1, -1)),
    )
)

OPENEXR_CUBE = Layout(
    "openexr-cube",
    _CUBE.direction,
    _CUBE.position,
    _CUBE.density,
    faces=6,
    edges=(True, True),
    rows=2.0,
    grid=(6, 1),
    places=tuple((face, 0, False) for face in range(6)),
)
