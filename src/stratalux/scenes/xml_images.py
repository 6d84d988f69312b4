"""The image files that a Mitsuba scene names, read by our reader: in Mitsuba's, damaged ones end the process."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mitsuba as mi

from ..errors import SceneWarning
from ..images.reader import Reader
from ..images.textures import read_texture
from ..integrators.large_map import Memory, is_large, large_envmap, there
from ..maps.envmap import EnvironmentMap


def read_images(state: mi.parser.ParserState, max_memory: int | None = None) -> None:
    """Give ``envmap`` and ``bitmap`` objects of a parsed scene pixels in place of file names.

    Names are relative to Mitsuba's file resolver. ``max_memory``: bytes that the pixels of each file may take, see
    :func:`.reading.read_image`. Warns of what files say and is not followed. Raises :class:`InputError`.
    """
    textures: dict[Path, mi.Bitmap] = {}
    with Reader() as reader:
        for node in state.nodes:
            props, kind = node.props, node.props.plugin_name()
            if kind not in ("bitmap", "envmap") or "filename" not in props or not isinstance(props["filename"], str):
                continue  # Mitsuba says what is wrong
            path = Path(str(mi.file_resolver().resolve(props["filename"])))
            if kind == "envmap":
                memory = Memory()
                allocate = memory.allocate if there() else None
                environment = EnvironmentMap.load(path, max_memory=max_memory, allocate=allocate)
                if is_large(environment):
                    node.props = in_place_of(props, large_envmap(environment.texels, memory))
                    continue
                bitmap = mi.Bitmap(environment.as_single().texels)
            else:
                if path not in textures:
                    textures[path] = _texture(path, max_memory, reader)
                # Of its own, as the plugin changes it where it is raw.
                bitmap = mi.Bitmap(textures[path])
            del props["filename"]
            props["bitmap"] = bitmap


def in_place_of(props: mi.Properties, emitter: Mapping[str, Any]) -> mi.Properties:
    """Those of another ``emitter``, as a dictionary has it, with the orientation and the scale of an ``envmap``."""
    made = mi.Properties(emitter["type"])
    made.set_id(props.id())
    if props.plugin_name() == "envmap":
        for name in ("to_world", "scale", *(["mis_compensation"] if emitter["type"] == "envmap" else [])):
            if name in props:
                made[name] = props[name]
    for name, value in emitter.items():
        if name != "type":
            made[name] = value
    return made


def _texture(path: Path, max_memory: int | None, reader: Reader) -> mi.Bitmap:
    texture = read_texture(path, max_memory, reader)
    for line in texture.said:
        warnings.warn(f"{path}: {line}", SceneWarning, stacklevel=5)
    bitmap = mi.Bitmap(texture.pixels)
    bitmap.set_srgb_gamma(texture.srgb)
    return bitmap
