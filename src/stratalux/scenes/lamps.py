"""From the lights of a model to emitters of Mitsuba."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from ..maps.envmap import EnvironmentMap
from .model import Floats, Light

_TURN = np.diag([-1.0, 1.0, -1.0, 1.0])
"""Lights of models shine along -z, Mitsuba's along +z."""


def lamps(lights: Sequence[Light], warn: Callable[[str], None]) -> dict[str, Any]:
    """Emitters, and shapes that shine, by names for a scene's dictionary; those that are maps are left out.

    `warn` is told what is shown otherwise than the file says.
    """
    found = {}
    for number, light in enumerate(lights):
        if light.kind == "dome" or max(light.colour) <= 0:
            continue
        found[f"lamp{number}"] = _KINDS[light.kind](light, _frame(light.matrix))
        if light.kind == "distant" and light.angle:
            warn(f"the light {light.name!r} is {np.degrees(light.angle):.3g} degrees wide: its shadows are shown sharp")
    return found


def dome_emitter(path: Path, light: Light, max_memory: int | None = None) -> dict[str, Any]:
    """The environment emitter of a light that is a map, or of one colour. `path`: of the file that has it.

    Raises :class:`InputError` for a map that cannot be read.
    """
    turn = mi.ScalarTransform4f(_rotation(_frame(light.matrix)))
    if light.picture is None:
        return {"type": "constant", "radiance": _rgb(light)}
    with tempfile.TemporaryDirectory(prefix="stratalux-") as folder:
        file = light.picture.path
        if file is None:
            file = Path(folder) / f"map{Path(light.picture.name).suffix}"
            file.write_bytes(light.picture.data or b"")
        environment = EnvironmentMap.load(file, max_memory=max_memory)
    texels = environment.texels * np.asarray(light.colour, dtype=np.float32)
    return {"type": "envmap", "bitmap": mi.Bitmap(np.ascontiguousarray(texels)), "to_world": turn}


def _frame(matrix: Floats) -> Floats:
    """The matrix (4, 4) of a light whose axis is +z."""
    return np.asarray(matrix, dtype=np.float64) @ _TURN


def _rigid(frame: Floats) -> Any:
    """A transform without scale: lights that are points have none."""
    rigid = _rotation(frame)
    rigid[:3, 3] = frame[:3, 3]
    return mi.ScalarTransform4f(rigid)


def _rotation(frame: Floats) -> Floats:
    """The rotation (4, 4) with the same z, and x as near as can be."""
    rotation = np.eye(4)
    z = frame[:3, 2] / np.linalg.norm(frame[:3, 2])
    x = frame[:3, 0] - z * (z @ frame[:3, 0])
    x /= np.linalg.norm(x)
    rotation[:3, 0], rotation[:3, 1], rotation[:3, 2] = x, np.cross(z, x), z
    return rotation


def _rgb(light: Light) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(x) for x in light.colour]}


def _point(light: Light, frame: Floats) -> dict[str, Any]:
    return {"type": "point", "position": frame[:3, 3].tolist(), "intensity": _rgb(light)}


def _spot(light: Light, frame: Floats) -> dict[str, Any]:
    inner, outer = (float(np.degrees(angle)) for angle in light.cone)
    return {
        "type": "spot",
        "to_world": _rigid(frame),
        "intensity": _rgb(light),
        "cutoff_angle": outer,
        "beam_width": min(inner, outer * 0.999),
    }


def _distant(light: Light, frame: Floats) -> dict[str, Any]:
    return {"type": "directional", "to_world": _rigid(frame), "irradiance": _rgb(light)}


def _flat(plugin: str) -> Callable[[Light, Floats], dict[str, Any]]:
    def shape(light: Light, frame: Floats) -> dict[str, Any]:
        scaled = frame @ np.diag([light.size[0] / 2, light.size[1] / 2, 1.0, 1.0])
        return {"type": plugin, "to_world": mi.ScalarTransform4f(scaled), "emitter": _area(light), "bsdf": _BLACK}

    return shape


def _sphere(light: Light, frame: Floats) -> dict[str, Any]:
    scale = float(np.cbrt(abs(np.linalg.det(frame[:3, :3]))))
    radius = scale * light.size[0] / 2
    return {
        "type": "sphere", "center": frame[:3, 3].tolist(), "radius": radius, "emitter": _area(light), "bsdf": _BLACK
    }  # fmt: skip


def _area(light: Light) -> dict[str, Any]:
    return {"type": "area", "radiance": _rgb(light)}


_BLACK = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
_KINDS: dict[str, Callable[[Light, Floats], dict[str, Any]]] = {
    "point": _point,
    "spot": _spot,
    "distant": _distant,
    "rectangle": _flat("rectangle"),
    "disk": _flat("disk"),
    "sphere": _sphere,
}
