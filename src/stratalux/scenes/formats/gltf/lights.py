"""The lights and the cameras of glTF.

Candela and lux are taken one to one as W/sr and W/m², as all that is photometric in a scene of radiances. The range of
a light is where others stop to reckon with it, to save time.

Sources: Khronos Group, "glTF 2.0 Specification", section 3.10, and "KHR_lights_punctual".
"""

from __future__ import annotations

import math
from typing import Any, Literal

from ...model import Camera, Floats, Light
from .container import Document, item
from .numbers import Numbers

_KINDS: dict[str, Literal["point", "spot", "distant"]] = {
    "point": "point", "spot": "spot", "directional": "distant",
}  # fmt: skip


def light(document: Document, node: dict[str, Any], matrix: Floats) -> Light | None:
    """The light of a node that is at `matrix` (4, 4), or None."""
    index = node.get("extensions", {}).get("KHR_lights_punctual", {}).get("light")
    if index is None:
        return None
    lights = document.json.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    said = item(lights, index)
    left_out = document.left_out
    left_out.extensions_of(said)
    kind = _KINDS.get(said["type"])
    if kind is None:
        left_out.add(f"a light of the kind {str(said['type'])[:40]!r}")
        return None
    if "range" in said and kind != "distant":
        left_out.add("where the range of a light ends")
    numbers, spot = Numbers(said, left_out), Numbers(said.get("spot", {}), left_out)
    intensity = numbers.one("intensity", 1.0, 0.0)
    red, green, blue = numbers.colour("color", 1.0)
    outer = spot.one("outerConeAngle", math.pi / 4, 0.0, math.pi / 2)
    inner = spot.one("innerConeAngle", 0.0, 0.0, outer)
    colour = intensity * red, intensity * green, intensity * blue
    return Light(kind, matrix, colour, _name(said, node), cone=(inner, outer))


def camera(document: Document, node: dict[str, Any], matrix: Floats) -> Camera | None:
    """The camera of a node that is at `matrix` (4, 4), or None."""
    if "camera" not in node:
        return None
    said = item(document.list("cameras"), node["camera"])
    document.left_out.extensions_of(said)
    numbers = Numbers(said.get(said["type"], {}), document.left_out)
    name = _name(said, node)
    if said["type"] == "perspective":
        fov, aspect = numbers.one("yfov", 0.0), numbers.one("aspectRatio", 0.0)
        if 0 < fov < math.pi and aspect >= 0:
            return Camera(matrix, name, fov=fov, aspect=aspect or None)
    else:
        across, up = numbers.one("xmag", 0.0), numbers.one("ymag", 0.0)
        if across and up:
            return Camera(matrix, name, height=2 * abs(up), aspect=abs(across / up))
    document.left_out.add(f"the camera {name[:40]!r}, which has no field of view")
    return None


def _name(said: dict[str, Any], node: dict[str, Any]) -> str:
    return str(node.get("name") or said.get("name") or "")
