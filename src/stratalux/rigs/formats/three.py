"""three.js: a group for its ``ObjectLoader``.

Since r155 the intensity of a ``DirectionalLight`` is the irradiance of what faces it: ``BRDF_Lambert`` divides by π,
and nothing multiplies by it any more (three.js, migration guide, and ``lights_physical_pars_fragment.glsl.js``). That
of an ``AmbientLight`` is an irradiance as well, π times the radiance. A ``LightProbe`` has coefficients of radiance.

Colours are written as ``hsl()`` of sRGB, since those that are numbers have 8 bits; ``Color`` decodes both.
"""

from __future__ import annotations

import colorsys
import json
import uuid
from pathlib import Path
from typing import Any

import numpy as np

from ..colours import encoded
from ..lights import Lights, plain, split

_NAMES = uuid.UUID("6c5d1b5e-54a4-4d9f-9a51-3b5b0c4a4f1e")
"""Of the names that the same rig always gets."""


def encode(lights: Lights, path: Path) -> bytes:
    target = _object("Object3D", "target")
    children: list[dict[str, Any]] = [target]
    for name, direction, colour, _ in lights.named():
        tint, intensity = split(colour)
        matrix = np.eye(4)
        matrix[3, :3] = direction  # columns, one after the other
        children.append(
            {
                **_object("DirectionalLight", name),
                "color": _hsl(tint),
                "intensity": intensity,
                "matrix": plain(matrix.ravel()),
                "target": target["uuid"],
            }
        )
    if lights.varies and lights.ambient is not None:
        children.append({**_object("LightProbe", "ambient"), "sh": plain(lights.ambient.ravel()), "intensity": 1})
    elif lights.ambient is not None:
        tint, radiance = split(lights.ambient_radiance)
        children.append(
            {**_object("AmbientLight", "ambient"), "color": _hsl(tint), "intensity": float(np.pi * radiance)}
        )
    content = {
        "metadata": {"version": 4.6, "type": "Object", "generator": "stratalux rig"},
        "object": {**_object("Group", "rig"), "children": children},
    }
    return (json.dumps(content, indent=1) + "\n").encode()


def _object(kind: str, name: str) -> dict[str, Any]:
    return {"uuid": str(uuid.uuid5(_NAMES, name)), "type": kind, "name": name}


def _hsl(tint: list[float]) -> str:
    hue, lightness, saturation = colorsys.rgb_to_hls(*encoded(tint))
    return f"hsl({360 * hue:.6f}, {100 * saturation:.6f}%, {100 * lightness:.6f}%)"
