"""What is shown, and from where."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..settings import Kind, Settings, option
from .materials import MATERIALS

LARGEST_SIDE = 1 << 16
MOST_PIXELS = 1 << 28
MOST_SCALE = 1e30
UP_AXES = ("x", "y", "z", "-x", "-y", "-z")


def _size(value: Any) -> tuple[int, int]:
    try:
        width, height = (side.__index__() for side in value)
    except (TypeError, ValueError, AttributeError):
        raise InputError(f"size: {value!r} is not one; give (width, height) in pixels") from None
    if width < 1 or height < 1:
        raise InputError(f"size {width}x{height}: width and height must be at least 1 pixel")
    if max(width, height) > LARGEST_SIDE or width * height > MOST_PIXELS:
        raise InputError(
            f"size {width}x{height}: too large; at most {LARGEST_SIDE} pixels a side and {MOST_PIXELS} in all"
        )
    return width, height


def _parse_size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,9})[xX×](\d{1,9})", text)
    if match is None or "0" in (match[1].lstrip("0") or "0", match[2].lstrip("0") or "0"):
        raise InputError(f"'{text}' is not a size; write WIDTHxHEIGHT in pixels, for example 600x400")
    return _size((int(match[1]), int(match[2])))


def _rotation(value: Any) -> tuple[float, float, float]:
    try:
        x, y, z = (float(angle) for angle in value)
    except (TypeError, ValueError):
        raise InputError(f"rotate: {value!r} is not a rotation; give degrees about x, y and z") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(f"rotate: {value!r} is not finite; give degrees about x, y and z")
    return x, y, z


def _parse_rotation(text: str) -> tuple[float, float, float]:
    if text == "flip":
        return 180.0, 0.0, 0.0
    try:
        angles = [float(angle) for angle in text.split(",")]
    except ValueError:
        angles = []
    if len(angles) == 1:
        angles = [0.0, angles[0], 0.0]
    if len(angles) != 3 or not all(map(math.isfinite, angles)):
        raise InputError(f"'{text}' is not a rotation; write degrees about y (90), or X,Y,Z (180,0,0), or flip")
    return angles[0], angles[1], angles[2]


def check_source(source: str) -> None:
    """Make sure, before any work is done, that there is such a scene; raises :class:`InputError`."""
    if source == "demo":
        return
    path = Path(source)
    try:
        what = "is a folder" if path.is_dir() else "is a pipe or a device" if path.exists() else "no such file"
        if source and path.is_file():
            return
    except OSError as error:
        what = error.strerror or str(error)
    raise InputError(f"{source or 'an empty name'}: {what}; give a Mitsuba scene, a mesh, or demo")


def _definition(value: Any) -> tuple[str, str]:
    if isinstance(value, str):
        return _parse_definition(value)
    try:
        name, text = value
    except (TypeError, ValueError):
        raise InputError(f"parameters: {value!r} is not a name and a value") from None
    return _utf8(str(name)), _utf8(str(text))


def _utf8(text: str) -> str:
    if text.encode("utf-8", "replace").decode("utf-8") != text:
        raise InputError(f"parameters: {text!r} is not UTF-8")
    return text


def _parse_definition(text: str) -> tuple[str, str]:
    name, separator, value = text.partition("=")
    if not (name and separator):
        raise InputError(f"'{text}' is not a definition; write name=value")
    return _utf8(name), _utf8(value)


def _map(value: Any) -> Any:
    """A file, or a map of a program, which has texels."""
    if hasattr(value, "texels"):
        return value
    if (isinstance(value, str) or hasattr(value, "__fspath__")) and str(value):
        return str(value)
    raise InputError(f"environment: {value!r} is no map; give a file, or an EnvironmentMap")


def _map_json(value: Any) -> Any:
    return value if isinstance(value, str) else {"of a program": list(value.texels.shape)}


def _show_map(value: Any) -> str:
    if not isinstance(value, str):
        raise InputError("environment: the map is an array of a program, which no command can name; save it first")
    return value


SIZE = Kind("WxH", _parse_size, _size, lambda size: f"{size[0]}x{size[1]}", list)
ROTATION = Kind("DEG|X,Y,Z|flip", _parse_rotation, _rotation, lambda angles: ",".join(f"{a!r}" for a in angles), list)
DEFINITION = Kind("name=value", _parse_definition, _definition, "=".join, list)
MAP = Kind("MAP", _map, _map, _show_map, _map_json)


@dataclass(frozen=True)
class SceneSettings(Settings):
    """What is shown: a scene, a mesh or the demo, and the map that lights it."""

    source: str = option(..., "A Mitsuba XML file, a mesh, or demo.", argument=True, metavar="SCENE")
    environment: Any = option(
        None,
        "Environment map (.exr, .hdr, .pfm, .tif, ...): needed for a mesh, else replaces the scene's own.",
        "--env",
        kind=MAP,
    )
    rotate: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0),
        "Turn the map: degrees about y, or about the world's x, y and z in that order, or flip.",
        "--env-rotate",
        kind=ROTATION,
    )
    scale: float = option(1.0, "Brightness of the map, a factor.", "--env-scale", minimum=0.0, maximum=MOST_SCALE)
    material: str | None = option(
        None,
        f"Material in place of those of the file: {', '.join(MATERIALS)}.",
        "--material",
        choices=tuple(MATERIALS),
        metavar="NAME",
        default_text="what the file says, or clay",
    )
    up: str | None = option(
        None, "Axis of a mesh file that is up.", "--up", choices=UP_AXES, default_text="y, but z for .stl"
    )
    parameters: tuple[tuple[str, str], ...] = option(
        (), "Value of $name in a Mitsuba scene; repeat for several.", "-D", kind=DEFINITION, several=True
    )

    @property
    def definitions(self) -> Mapping[str, str]:
        """``parameters`` by name; the last of a name counts."""
        return dict(self.parameters)


@dataclass(frozen=True)
class CameraSettings(Settings):
    """From where it is seen, and how large."""

    size: tuple[int, int] | None = option(
        None, "Film in pixels.", "--size", kind=SIZE, default_text="the scene's own, or 600x400"
    )
    sensor: int = option(0, "Index of the scene's camera.", "--sensor", minimum=0, maximum=(1 << 31) - 1)
