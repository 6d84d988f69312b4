"""Formats that a rig is written in: one module for each, and a line here."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ...errors import InputError, RigWarning
from ...images.files import check_writable, shown, write_atomically
from ...maps.frames import ENV_FRAMES
from ..lights import Lights
from . import blender, csv, gltf, godot, mitsuba, own, pbrt, radiance, three, unreal, usd
from .own import read_rig

__all__ = ["FORMATS", "Format", "format_of", "read_rig", "write_rig"]


@dataclass(frozen=True)
class Format:
    """A format of rigs, with the ``suffixes`` of its files.

    ``encode``: the bytes of the file of that path, for lights that are turned already; what belongs beside the file it
    writes itself. ``frame``: where the tool has the middle of a map, by :data:`ENV_FRAMES`. ``ambient``: what it can
    say of ambient light. ``by_suffix``: whether a suffix alone means it.
    """

    suffixes: tuple[str, ...]
    encode: Callable[[Lights, Path], bytes]
    frame: str = "mitsuba"
    ambient: Literal["none", "constant", "all"] = "constant"
    by_suffix: bool = True


FORMATS: dict[str, Format] = {
    "json": Format((".json",), own.encode, ambient="all"),
    "csv": Format((".csv",), csv.encode),
    "mitsuba": Format((".xml",), mitsuba.encode, ambient="all"),
    "pbrt": Format((".pbrt",), pbrt.encode),
    "gltf": Format((".glb", ".gltf"), gltf.encode, ambient="none"),
    "usd": Format((".usda", ".usdc", ".usd", ".usdz"), usd.encode, ambient="all"),
    "three": Format((".json",), three.encode, "three", "all", by_suffix=False),
    "blender": Format((".py",), blender.encode, "blender", "all"),
    "blend": Format((".blend",), blender.encode_blend, "blender", "all"),
    "unreal": Format((".py",), unreal.encode, ambient="none", by_suffix=False),
    "godot": Format((".tscn",), godot.encode),
    "radiance": Format((".rad",), radiance.encode),
}
"""By the names that ``--to`` takes."""


def format_of(path: str | Path, name: str | None = None) -> Format:
    """The format of a file: that of ``name``, or else that of its suffix. Raises :class:`InputError`."""
    suffix = Path(path).suffix.lower()
    if name is not None:
        if name not in FORMATS:
            raise InputError(f"{name}: is no format of rigs; use one of {', '.join(FORMATS)}")
        if suffix not in FORMATS[name].suffixes:
            raise InputError(f"{shown(path)}: a rig for {name} ends with {' or '.join(FORMATS[name].suffixes)}")
        return FORMATS[name]
    for known in FORMATS.values():
        if known.by_suffix and suffix in known.suffixes:
            return known
    suffixes = [each for known in FORMATS.values() if known.by_suffix for each in known.suffixes]
    raise InputError(f"{shown(path)}: no rig is written as '{shown(suffix)}'; use one of {', '.join(suffixes)}")


def write_rig(lights: Lights, path: str | Path, name: str | None = None, *, env_frame: str | None = None) -> None:
    """Write the lights for another tool, with its axes and its units (docs/conventions.md).

    ``name``: of one of the :data:`FORMATS`, where the suffix of ``path`` does not say it. ``env_frame``: the tool whose
    map the lights stand with, where it is not that of the format; our own JSON is in the map's frame always. What the
    format cannot say is told in a :class:`RigWarning`. Raises :class:`InputError` for a format that is unknown, or
    whose package is missing, and for a path that cannot be written.
    """
    path = Path(path)
    known = format_of(path, name)
    check_writable(path)
    if env_frame is not None and env_frame not in ENV_FRAMES:
        raise InputError(f"env_frame: '{env_frame}' is unknown; use one of {', '.join(ENV_FRAMES)}")
    frame = env_frame or known.frame
    if known is FORMATS["json"]:
        if env_frame is not None and ENV_FRAMES[env_frame]:
            _warn(f"{path}: our JSON is in the map's frame always; --env-frame is for the other formats")
        frame = "mitsuba"
    if lights.ambient is not None and known.ambient == "none":
        _warn(f"{path}: the format has no ambient light, which is left out; choose --ambient none")
    elif lights.varies and known.ambient == "constant":
        _warn(f"{path}: the format has ambient light of one colour only: its mean is written")
        lights = lights.without_variation()
    content = known.encode(lights.turn(ENV_FRAMES[frame]), path)
    write_atomically(path, lambda temporary: Path(temporary).write_bytes(content))


def _warn(text: str) -> None:
    warnings.warn(text, RigWarning, stacklevel=3)
