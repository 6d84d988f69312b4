"""glTF 2.0, .gltf and .glb: directional lights of KHR_lights_punctual, in lux, which shine along −z of their nodes.

Lux are written one to one for W/m², as viewers of glTF show them beside a map of radiance. Source: Khronos Group,
"glTF 2.0 Specification" and "KHR_lights_punctual".
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

from ..lights import Lights, quaternion_towards, split

_NAME = "KHR_lights_punctual"


def encode(lights: Lights, path: Path) -> bytes:
    text = json.dumps(document(lights), indent=1, allow_nan=False)
    if path.suffix.lower() != ".glb":
        return f"{text}\n".encode()
    chunk = text.encode()
    chunk += b" " * (-len(chunk) % 4)
    header = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(chunk))
    return header + struct.pack("<I4s", len(chunk), b"JSON") + chunk


def document(lights: Lights) -> dict[str, Any]:
    """The JSON of the file."""
    nodes: list[dict[str, Any]] = []
    said: list[dict[str, Any]] = []
    for name, direction, colour, _ in lights.named():
        tint, lux = split(colour)
        nodes.append(
            {"name": name, "rotation": quaternion_towards(direction), "extensions": {_NAME: {"light": len(said)}}}
        )
        said.append({"type": "directional", "name": name, "color": tint, "intensity": lux})
    content: dict[str, Any] = {"asset": {"version": "2.0", "generator": "stratalux rig"}, "scene": 0}
    if not said:  # lists may not be empty
        return {**content, "scenes": [{"name": "rig"}]}
    return {
        **content,
        "extensionsUsed": [_NAME],
        "extensions": {_NAME: {"lights": said}},
        "scenes": [{"name": "rig", "nodes": list(range(len(nodes)))}],
        "nodes": nodes,
    }
