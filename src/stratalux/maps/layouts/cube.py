"""Cubes as OpenGL and Direct3D have them: +X, −X, +Y, −Y, +Z, −Z, as crosses, strips, or six files.

Cube maps are left-handed there (OpenGL 4.6, table 8.19): where +Z is ahead and +Y is up, +X is to the right. So the
pictures of the faces are not mirrored, and +Z is the middle of a latitude-longitude map, +X the quarter to the right of
it. In our right-handed frame the axes of the cube are (−x, y, z). three.js looks its cubes up in this way.
"""

from __future__ import annotations

from dataclasses import replace

from .faces import Cube, Face
from .layout import Layout

_CUBE = Cube(
    (
        Face((0, -1), (2, -1), (1, -1)),
        Face((0, 1), (2, 1), (1, -1)),
        Face((1, 1), (0, -1), (2, 1)),
        Face((1, -1), (0, -1), (2, -1)),
        Face((2, 1), (0, -1), (1, -1)),
        Face((2, -1), (0, 1), (1, -1)),
    )
)

STRIP = Layout(
    "strip",
    _CUBE.direction,
    _CUBE.position,
    _CUBE.density,
    faces=6,
    rows=2.0,
    grid=(1, 6),
    places=tuple((0, face, False) for face in range(6)),
)
VERTICAL_STRIP = replace(STRIP, name="vertical-strip", grid=(6, 1), places=tuple((face, 0, False) for face in range(6)))
_ARMS = ((1, 2, False), (1, 0, False), (0, 1, False), (2, 1, False), (1, 1, False))
CROSS = replace(STRIP, name="cross", grid=(3, 4), places=(*_ARMS, (1, 3, False)))
VERTICAL_CROSS = replace(STRIP, name="vertical-cross", grid=(4, 3), places=(*_ARMS, (3, 1, True)))
FACES = replace(STRIP, name="faces", files=("px", "nx", "py", "ny", "pz", "nz"))
