"""The image files that a Mitsuba scene names, read by our reader: in Mitsuba's, damaged ones end the process."""

from __future__ import annotations

import warnings
from pathlib import Path

import mitsuba as mi

from ..errors import SceneWarning
from ..images.reader import Reader
from ..images.textures import read_texture
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
                bitmap = mi.Bitmap(EnvironmentMap.load(path, max_memory=max_memory).texels)
            else:
                if path not in textures:
                    textures[path] = _texture(path, max_memory, reader)
                # Of its own, as the plugin changes it where it is raw.
                bitmap = mi.Bitmap(textures[path])
            del props["filename"]
            props["bitmap"] = bitmap


def _texture(path: Path, max_memory: int | None, reader: Reader) -> mi.Bitmap:
    texture = read_texture(path, max_memory, reader)
    for line in texture.said:
        warnings.warn(f"{path}: {line}", SceneWarning, stacklevel=5)
    bitmap = mi.Bitmap(texture.pixels)
    bitmap.set_srgb_gamma(texture.srgb)
    return bitmap
