"""Mitsuba's XML scenes: what they say is checked before Mitsuba parses them, and what we replace is told."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import mitsuba as mi

from ..errors import InputError, SceneWarning
from ..images.files import one_line
from .settings import MOST_PIXELS, check_source
from .xml_checks import check_filters, check_objects, check_text
from .xml_images import read_images

ENVIRONMENT_PLUGINS = ("envmap", "constant", "sunsky", "sky", "sun")

_DIRECT = ("direct", "direct_stratified", "direct_importance", "direct_wavelet", "direct_lights")
"""Integrators of which nothing is lost when another one of direct light takes their place."""
_SEE_THROUGH = ("DeltaTransmission", "GlossyTransmission")
_WRAPPERS = ("BumpMap", "NormalMap")
"""Of Mitsuba 3.9, these do not tell how much a mask inside of them lets through; a mask around them does."""


def load_xml(
    path: Path,
    environment: Any,
    size: tuple[int, int] | None,
    parameters: Mapping[str, str],
    max_memory: int | None = None,
) -> tuple[mi.Scene, bool]:
    """Load a scene; with it, whether its integrator hides emitters.

    ``environment``: bitmap of a map that replaces the scene's own. ``size``: of the film in pixels. ``max_memory``: see
    :func:`.xml_images.read_images`.
    Warns with a :class:`SceneWarning` of what the file asks for and is not shown. Raises :class:`InputError`.
    """
    check_source(str(path))
    check_text(path, dict(parameters))
    config = mi.parser.ParserConfig(mi.variant())
    outer = mi.file_resolver()
    inner = mi.FileResolver(outer)
    inner.prepend(str(path.resolve().parent))  # files are named relative to the scene
    mi.set_file_resolver(inner)
    try:
        state = mi.parser.parse_file(config, str(path.resolve()), **parameters)
        mi.parser.transform_all(config, state)
        check_objects(state)
        _set_films(path, state, size)
        hide_emitters = _integrator(path, state)
        if environment is not None:
            _put_environment(state, environment)
        read_images(state, max_memory)
        scene = mi.parser.instantiate(config, state)
    except InputError:
        raise
    except UnicodeError:
        raise InputError(f"{path}: is not UTF-8, or names something that is not; save it as UTF-8") from None
    except (RuntimeError, ValueError, TypeError) as error:
        raise InputError(f"{path}: {one_line(error)}") from None
    finally:
        mi.set_file_resolver(outer)
    scene = scene[0] if isinstance(scene, (list, tuple)) else scene
    if not isinstance(scene, mi.Scene):
        raise InputError(f"{path}: holds a {type(scene).__name__}, not a scene")
    if not scene.sensors():
        raise InputError(f"{path}: the scene has no sensor; add one")
    check_filters(path, scene)
    _tell_what_lets_light_through(path, scene)
    return scene, hide_emitters


def _set_films(path: Path, state: mi.parser.ParserState, size: tuple[int, int] | None) -> None:
    """Give the films the ``size`` that is asked for, and refuse those that cannot be."""
    for node in state.nodes:
        if node.type != mi.ObjectType.Film:
            continue
        if size is not None:
            node.props["width"], node.props["height"] = size
        asked = {
            name: node.props[name] for name in ("width", "height", "crop_width", "crop_height") if name in node.props
        }
        if any(isinstance(side, int) and side < 1 for side in asked.values()):
            shown = ", ".join(f"{name} {side}" for name, side in asked.items())
            raise InputError(f"{path}: a film has no pixels ({shown}); give sides of at least 1")
        width, height = asked.get("width", 768), asked.get("height", 576)
        if isinstance(width, int) and isinstance(height, int) and width * height > MOST_PIXELS:
            raise InputError(f"{path}: a film of {width}x{height} is too large; {MOST_PIXELS} pixels are the most")


def _integrator(path: Path, state: mi.parser.ParserState) -> bool:
    """Tell what of the scene's integrator is not shown; whether it hides emitters."""
    hide = False
    for node in state.nodes:
        if node.type != mi.ObjectType.Integrator:
            continue
        name = node.props.plugin_name()
        hide = hide or bool(node.props.get("hide_emitters", False))
        depth = node.props.get("max_depth", -1)
        if name == "aov":
            asked = node.props.get("aovs", "")
            warnings.warn(f"{path}: its AOVs ({asked}) are left out; only the image is rendered", SceneWarning, 4)
        elif name not in _DIRECT and not (name in ("path", "volpath") and depth == 2):
            warnings.warn(
                f"{path}: its integrator '{name}' is replaced: direct light only, without what is reflected between "
                "surfaces",
                SceneWarning,
                4,
            )
    return hide


def _tell_what_lets_light_through(path: Path, scene: mi.Scene) -> None:
    """Direct light sees nothing behind glass; through masks it goes straight on."""
    flags = 0
    for flag in _SEE_THROUGH:
        flags |= int(getattr(mi.BSDFFlags, flag))
    names = sorted({name for shape in scene.shapes() for name in _see_through(shape.bsdf(), flags)})
    if names:
        warnings.warn(
            f"{path}: what is behind {', '.join(names)} is black, and much darker than with path: direct light ends at "
            "the first surface",
            SceneWarning,
            4,
        )


def _see_through(bsdf: mi.BSDF | None, flags: int) -> Iterator[str]:
    if bsdf is None:
        return
    wrapped = bsdf.class_name() in _WRAPPERS and mi.has_flag(bsdf.flags(), mi.BSDFFlags.Null)
    if wrapped or int(bsdf.flags()) & flags:
        yield bsdf.class_name()


def _put_environment(state: mi.parser.ParserState, bitmap: mi.Bitmap) -> None:
    """Replace the environment emitter of a parsed scene, keeping its orientation and scale, or add one."""
    for node in state.nodes:
        if node.type == mi.ObjectType.Emitter and node.props.plugin_name() in ENVIRONMENT_PLUGINS:
            props = mi.Properties("envmap")
            props.set_id(node.props.id())
            if node.props.plugin_name() == "envmap":
                for name in ("to_world", "scale", "mis_compensation"):
                    if name in node.props:
                        props[name] = node.props[name]
            props["bitmap"] = bitmap
            node.props = props
            return
    state.root.props["environment"] = mi.load_dict({"type": "envmap", "bitmap": bitmap})
