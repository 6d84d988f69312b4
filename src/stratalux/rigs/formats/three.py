"""three.js: a group for its ``ObjectLoader``.

Since r155 the intensity of a ``DirectionalLight`` is the irradiance of what faces it: ``BRDF_Lambert`` divides by π,
and nothing multiplies by it any more (three.js, migration guide, and ``lights_physical_pars_fragment.glsl.js``). That
of an ``AmbientLight`` is an irradiance as well, π times the radiance. A ``LightProbe`` has coefficients of radiance.

Colours have 8 bits of sRGB. There are strings that say more, and versions of ``Color`` that do not read them.
"""

from __future__ import annotations

import json
import uuid
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..colours import eight_bits
from ..lights import Lights, plain

_NAMES = uuid.UUID("6c5d1b5e-54a4-4d9f-9a51-3b5b0c4a4f1e")
"""Of the names that the same rig always gets."""


def encode(lights: Lights, path: Path) -> bytes:
    target = _object("Object3D", "target")
    children: list[dict[str, Any]] = [target]
    for name, direction, colour, _ in lights.named():
        code, intensity = _colour(colour)
        matrix = np.eye(4)
        matrix[3, :3] = direction  # columns, one after the other
        children.append(
            {
                **_object("DirectionalLight", name),
                "color": code,
                "intensity": intensity,
                "matrix": plain(matrix.ravel()),
                "target": target["uuid"],
            }
        )
    if lights.varies and lights.ambient is not None:
        children.append({**_object("LightProbe", "ambient"), "sh": plain(lights.ambient.ravel()), "intensity": 1})
    elif lights.ambient is not None:
        code, radiance = _colour(lights.ambient_radiance)
        children.append({**_object("AmbientLight", "ambient"), "color": code, "intensity": float(np.pi * radiance)})
    content = {
        "metadata": {"version": 4.6, "type": "Object", "generator": "stratalux rig"},
        "object": {**_object("Group", "rig"), "children": children},
    }
    return (json.dumps(content, indent=1) + "\n").encode()


def _object(kind: str, name: str) -> dict[str, Any]:
    return {"uuid": str(uuid.uuid5(_NAMES, name)), "type": kind, "name": name}


def _colour(light: NDArray[np.float64]) -> tuple[int, float]:
    """As ``0xRRGGBB``, and the intensity."""
    (red, green, blue), intensity = eight_bits(light)
    return (red << 16) + (green << 8) + blue, intensity
