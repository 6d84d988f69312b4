"""What is shown, and from where."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..maps.frames import ENV_FRAMES
from ..maps.settings import layout_option
from ..settings import Kind, Settings, option
from .materials import MATERIALS

LARGEST_SIDE = 1 << 16
MOST_PIXELS = 1 << 28
MOST_SCALE = 1e30
UP_AXES = ("x", "y", "z", "-x", "-y", "-z")
LEAST_FOV, MOST_FOV = 0.01, 179.0
LEAST_LENGTH, MOST_LENGTH = 1e-9, 1e15


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


def _camera(value: Any) -> str:
    if hasattr(value, "__index__") and not isinstance(value, bool) and value.__index__() >= 0:
        return str(value.__index__())
    if not isinstance(value, str) or not value:
        raise InputError(f"camera: {value!r} is none; give its name, its index, auto or none")
    return _utf8(value, "camera")


def _numbers(value: Any, what: str) -> tuple[float, ...]:
    """Numbers that can be reckoned with; raises :class:`InputError` that says what is needed."""
    try:
        numbers = tuple(float(number) for number in (value.split(",") if isinstance(value, str) else value))
    except (TypeError, ValueError):
        numbers = ()
    if not numbers or not all(abs(number) <= MOST_LENGTH for number in numbers):
        raise InputError(f"{value!r} is not {what}")
    return numbers


def _orbit(value: Any) -> tuple[float, ...]:
    what = "an orbit; write AZIMUTH,ELEVATION in degrees, or AZIMUTH,ELEVATION,DISTANCE, for example 30,17"
    numbers = _numbers(value, what)
    if len(numbers) not in (2, 3):
        raise InputError(f"{value!r} is not {what}")
    if abs(numbers[1]) > 90:
        raise InputError(f"orbit: an elevation of {numbers[1]:g} degrees is beyond the zenith; give -90 to 90")
    if len(numbers) == 3 and numbers[2] < LEAST_LENGTH:
        raise InputError(f"orbit: a distance of {numbers[2]:g} is too small; give at least {LEAST_LENGTH:g}")
    return numbers


def _point(value: Any) -> tuple[float, ...]:
    what = "a point; write X,Y,Z, for example 0,1,0"
    numbers = _numbers(value, what)
    if len(numbers) != 3:
        raise InputError(f"{value!r} is not {what}")
    return numbers


def _show_numbers(numbers: tuple[float, ...]) -> str:
    return ",".join(f"{number!r}" for number in numbers)


_NAMED = {"black": (0.0, 0.0, 0.0), "grey": (0.18, 0.18, 0.18), "white": (1.0, 1.0, 1.0)}
_HEX = re.compile(r"#([0-9a-f]{3}|[0-9a-f]{6})", re.IGNORECASE)
LEAST_BLUR, MOST_BLUR = 1.0, 180.0


def colour_of(text: str) -> tuple[float, float, float] | None:
    """The linear colour of a text: black, grey (0.18) or white, #rrggbb as on web pages, or linear R,G,B; else None."""
    if text in _NAMED:
        return _NAMED[text]
    if match := _HEX.fullmatch(text):
        digits = match[1] if len(match[1]) == 6 else "".join(2 * digit for digit in match[1])
        codes = [int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4)]
        r, g, b = (code / 12.92 if code <= 0.04045 else ((code + 0.055) / 1.055) ** 2.4 for code in codes)
        return r, g, b
    try:
        r, g, b = (float(word) for word in text.split(","))
    except ValueError:
        return None
    return (r, g, b) if all(0 <= value <= MOST_SCALE for value in (r, g, b)) else None


def _background(value: Any) -> str:
    text = str(value) if isinstance(value, str) or hasattr(value, "__fspath__") else ""
    if text in ("map", "none") or colour_of(text) is not None:
        return text
    if text.startswith("blur:"):
        try:
            degrees = float(text[5:])
        except ValueError:
            degrees = math.nan
        if not LEAST_BLUR <= degrees <= MOST_BLUR:
            raise InputError(f"background '{text}': write blur:DEGREES, {LEAST_BLUR:g} to {MOST_BLUR:g}")
        return text
    try:
        if text and Path(text).is_file():
            return text
    except OSError:
        pass
    raise InputError(
        f"background {value!r}: no such file; give that of a picture, map, none, blur:DEGREES or a colour (white, "
        "#ffcc00, or linear R,G,B)"
    )


def _ground(value: Any) -> str:
    text = value if isinstance(value, str) else ""
    if text in ("none", "catcher", "matte", "mirror"):
        return text
    colour = colour_of(text[6:]) if text.startswith("matte:") else None
    if colour is not None and max(colour) <= 1:
        return text
    raise InputError(f"ground {value!r}: give none, catcher, mirror, matte or matte:COLOUR (matte:0.2,0.2,0.2)")


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


def _utf8(text: str, name: str = "parameters") -> str:
    if text.encode("utf-8", "replace").decode("utf-8") != text:
        raise InputError(f"{name}: {text!r} is not UTF-8")
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
ROTATION = Kind("DEG|X,Y,Z|flip", _parse_rotation, _rotation, _show_numbers, list)
DEFINITION = Kind("name=value", _parse_definition, _definition, "=".join, list)
CAMERA = Kind("NAME|INDEX|auto|none", _camera, _camera)
ORBIT = Kind("AZ,EL[,DIST]", _orbit, _orbit, _show_numbers, list)
POINT = Kind("X,Y,Z", _point, _point, _show_numbers, list)
BACKGROUND = Kind("map|none|COLOUR|FILE|blur:DEG", _background, _background)
GROUND = Kind("none|catcher|matte[:COLOUR]|mirror", _ground, _ground)
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
        "Turn the map: degrees about y (counter-clockwise seen from above), or about the world's x, y and z in that "
        "order, or flip.",
        "--env-rotate",
        kind=ROTATION,
    )
    env_frame: str = option(
        "mitsuba",
        f"Let the map stand around the scene as in another tool, before it is turned: {', '.join(ENV_FRAMES)}.",
        "--env-frame",
        choices=tuple(ENV_FRAMES),
        metavar="TOOL",
    )
    env_layout: str = layout_option()
    scale: float = option(1.0, "Brightness of the map, a factor.", "--env-scale", minimum=0.0, maximum=MOST_SCALE)
    material: str | None = option(
        None,
        f"Material in place of those of the file: {', '.join(MATERIALS)}.",
        "--material",
        choices=tuple(MATERIALS),
        metavar="NAME",
        default_text="what the file says, or clay",
    )
    background: str = option(
        "map",
        "What is behind: the map, or none (alpha 0); COLOUR: white, #ffcc00 or linear R,G,B; FILE: a picture over the "
        "film; blur:DEG: the map out of focus. It lights nothing.",
        "--background",
        kind=BACKGROUND,
    )
    ground: str | None = option(
        None,
        "What an object stands on: none, catcher (what is behind, in its shadow), matte, or mirror.",
        "--ground",
        kind=GROUND,
        default_text="catcher; matte for the demo, and without a map",
    )
    up: str | None = option(
        None, "Axis of a mesh file that is up.", "--up", choices=UP_AXES, default_text="y, but z for .stl"
    )
    parameters: tuple[tuple[str, str], ...] = option(
        (), "Value of $name in a Mitsuba scene; repeat for several.", "-D", kind=DEFINITION, several=True
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.env_layout != "auto" and not isinstance(self.environment, str):
            raise InputError("--env-layout: says how the map of --env lies in its file; give both")

    @property
    def definitions(self) -> Mapping[str, str]:
        """``parameters`` by name; the last of a name counts."""
        return dict(self.parameters)


@dataclass(frozen=True)
class CameraSettings(Settings):
    """From where it is seen, and how large.

    Raises :class:`InputError` for a camera of the file that is to stand elsewhere than the file says.
    """

    size: tuple[int, int] | None = option(
        None, "Film in pixels.", "--size", kind=SIZE, default_text="the scene's own, or 600x400"
    )
    camera: str = option(
        "auto",
        "Camera of the file: its name, or its index from 0; none: one that frames the object; auto: the file's first, "
        "if it has any.",
        "--camera",
        kind=CAMERA,
    )
    orbit: tuple[float, ...] | None = option(
        None,
        "Instead, a camera around what is looked at: degrees from +z (counter-clockwise seen from above) and above the "
        "horizon, and the distance in the file's units, by default the closest that frames the object.",
        "--orbit",
        kind=ORBIT,
        default_text="30,17",
    )
    look_at: tuple[float, ...] | None = option(
        None,
        "Point that this camera looks at, in the file's units, y up.",
        "--look-at",
        kind=POINT,
        default_text="the object's middle",
    )
    fov: float | None = option(
        None,
        "Field of view of this camera in degrees, of the picture's shorter side.",
        "--fov",
        minimum=LEAST_FOV,
        maximum=MOST_FOV,
        default_text="30",
    )
    aperture: float | None = option(
        None,
        "Radius of the lens in the file's units; what is out of focus gets blurred.",
        "--aperture",
        minimum=0.0,
        maximum=MOST_LENGTH,
        default_text="the file's camera's, or 0",
    )
    focus: float | None = option(
        None,
        "Distance that is sharp, along the axis of view.",
        "--focus",
        minimum=LEAST_LENGTH,
        maximum=MOST_LENGTH,
        default_text="the file's camera's, or the object's nearest point in the picture",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.placed and self.camera not in ("auto", "none"):
            raise InputError(
                f"camera '{self.camera}' and {self.placed[0].replace('_', '-')} contradict each other: the file says "
                "where its cameras stand; leave one out"
            )

    @property
    def placed(self) -> tuple[str, ...]:
        """The settings that put a camera where no file says."""
        return tuple(name for name in ("orbit", "look_at", "fov") if getattr(self, name) is not None)
