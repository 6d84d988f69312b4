"""Our own JSON, which is read back: lights with the frame, the unit and the convention of their numbers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ..lights import Lights, plain

FORMAT, VERSION = "stratalux rig", 1
FRAME = {
    "handedness": "right",
    "up": "+y",
    "middle_of_the_map": "+z",
    "right_of_the_middle": "-x",
    "direction": "unit vector towards the light",
}
UNITS = {
    "colour": "irradiance of a surface that faces the light, W/m2 (radiance of the map in W/(m2 sr), times sr)",
    "angle": "degrees across the light; 0 for a light with sharp shadows",
    "solid_angle": "sr of the map that the light stands for",
    "ambient": "radiance, W/(m2 sr): coefficients of the real harmonics Y00, Y1-1, Y10, Y11, Y2-2 ... Y22, orthonormal",
    "colours": "linear, Rec. 709",
}
_LARGEST = 1 << 28


def describe(lights: Lights) -> dict[str, Any]:
    """The lights as JSON has them."""
    listed = []
    for k in range(len(lights)):
        light: dict[str, Any] = {"direction": plain(lights.direction[k]), "colour": plain(lights.colour[k])}
        if lights.angle[k]:
            light["angle"] = float(np.degrees(lights.angle[k]))
        if lights.solid_angle is not None:
            light["solid_angle"] = float(lights.solid_angle[k])
        listed.append(light)
    return {
        "format": FORMAT,
        "version": VERSION,
        "map": lights.map,
        "method": lights.method,
        "frame": FRAME,
        "units": UNITS,
        "quality": lights.quality,
        "ambient": None if lights.ambient is None else plain(lights.ambient),
        "lights": listed,
    }


def encode(lights: Lights, path: Path) -> bytes:
    return (json.dumps(describe(lights), indent=1) + "\n").encode()


def read_rig(path: str | Path) -> Lights:
    """The lights of a file that :func:`encode` made. Raises :class:`InputError` for any other, and for a newer one."""
    path = Path(path)
    try:
        if path.stat().st_size > _LARGEST:
            raise InputError(f"{path}: is too long for a rig; give the JSON of stratalux rig")
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); check the path") from None
    except (ValueError, RecursionError):  # of the encoding, too
        raise InputError(f"{path}: is no JSON; give a file that stratalux rig wrote") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f"{path}: is no rig of ours (it has no format '{FORMAT}'); write it again with stratalux rig")
    if content.get("version") != VERSION:
        raise InputError(
            f"{path}: is a rig of version {str(content.get('version'))[:20]}, and this reads {VERSION}; write it again"
        )
    if content.get("frame") != FRAME or content.get("units") != UNITS:
        raise InputError(f"{path}: its frame or its units are not those of stratalux rig; write it again")
    try:
        return _lights(content)
    except InputError as error:
        raise InputError(f"{path}: {error}; write it again with stratalux rig") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:100]
        raise InputError(f"{path}: is damaged ({reason}); write it again with stratalux rig") from None


def _lights(content: dict[str, Any]) -> Lights:
    listed, ambient = content["lights"], content.get("ambient")
    solid = [light.get("solid_angle") for light in listed]
    name = content.get("map")
    return Lights(
        np.array([light["direction"] for light in listed], dtype=np.float64).reshape(-1, 3),
        np.array([light["colour"] for light in listed], dtype=np.float64).reshape(-1, 3),
        np.radians(np.array([light.get("angle", 0.0) for light in listed], dtype=np.float64)),
        str(content["method"]),
        None if None in solid else np.array(solid, dtype=np.float64),
        None if ambient is None else np.array(ambient, dtype=np.float64),
        None if name is None else str(name),
        {str(key): float(value) for key, value in dict(content.get("quality") or {}).items()},
    )
