"""Mitsuba 3: a scene of ``directional`` emitters, to be included by another.

Its irradiance is that of a surface that faces the light; ``direction`` is the way that light travels. Sources:
Mitsuba 3, "Plugins", "Emitters"; both are tested.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..lights import Lights
from .beside import ambient_file


def encode(lights: Lights, path: Path) -> bytes:
    scene = ElementTree.Element("scene", version="3.0.0")
    for name, direction, colour, _ in lights.named():
        emitter = ElementTree.SubElement(scene, "emitter", type="directional", id=name)
        x, y, z = (repr(float(a)) for a in 0.0 - direction)
        ElementTree.SubElement(emitter, "vector", name="direction", x=x, y=y, z=z)
        ElementTree.SubElement(emitter, "rgb", name="irradiance", value=_numbers(colour))
    if lights.varies:
        emitter = ElementTree.SubElement(scene, "emitter", type="envmap", id="ambient")
        ElementTree.SubElement(emitter, "string", name="filename", value=ambient_file(lights, path).name)
    elif lights.ambient is not None:
        emitter = ElementTree.SubElement(scene, "emitter", type="constant", id="ambient")
        ElementTree.SubElement(emitter, "rgb", name="radiance", value=_numbers(lights.ambient_radiance))
    ElementTree.indent(scene)
    return ElementTree.tostring(scene, encoding="utf-8", xml_declaration=True) + b"\n"


def _numbers(colour: np.ndarray) -> str:
    return ", ".join(repr(float(c)) for c in colour)
