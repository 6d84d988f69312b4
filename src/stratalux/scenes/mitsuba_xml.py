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
from .xml_images import in_place_of, read_images

ENVIRONMENT_PLUGINS = ("envmap", "constant", "sunsky", "sky", "sun")

_DIRECT = ("direct", "direct_stratified", "direct_importance", "direct_wavelet", "direct_lights")
"""Integrators of direct light."""
_WHOLE = ("path", "path_stratified")
_AROUND = {"aov": "AOVs", "moment": "moments"}
"""What has an integrator inside, and what it adds."""
DIRECT = 2
"""Segments of a path of direct light."""
_SEE_THROUGH = ("DeltaTransmission", "GlossyTransmission")
_WRAPPERS = ("BumpMap", "NormalMap")
"""Of Mitsuba 3.9, these do not tell how much a mask inside of them lets through; a mask around them does."""


def load_xml(
    path: Path,
    environment: dict[str, Any] | None,
    size: tuple[int, int] | None,
    parameters: Mapping[str, str],
    max_memory: int | None = None,
) -> tuple[mi.Scene, dict[str, Any] | None]:
    """Load a scene; with it, its integrator: ``direct`` or ``path`` with what its settings mean, None without one.

    ``environment``: emitter that replaces the scene's own map. ``size``: of the film in pixels. ``max_memory``: see
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
        integrator = _integrator(path, state)
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
    return scene, integrator


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


def _integrator(path: Path, state: mi.parser.ParserState) -> dict[str, Any] | None:
    """What the scene's integrator is for; tells what of it is not shown."""
    found: dict[str, Any] | None = None
    for node in state.nodes:
        if node.type != mi.ObjectType.Integrator:
            continue
        name = node.props.plugin_name()
        if name in _AROUND:
            what = f"{_AROUND[name]} ({node.props.get('aovs', '')})" if name == "aov" else _AROUND[name]
            warnings.warn(f"{path}: its {what} are left out; only the image is rendered", SceneWarning, 4)
            continue
        if found is not None:
            warnings.warn(
                f"{path}: it has several integrators; only the first one's image is rendered", SceneWarning, 4
            )
            break
        if name not in (*_DIRECT, *_WHOLE):
            warnings.warn(f"{path}: its integrator '{name}' is replaced by path tracing", SceneWarning, 4)
        kept = ("hide_emitters",) if name in _DIRECT else ("max_depth", "rr_depth", "hide_emitters")
        found = {"type": "direct" if name in _DIRECT else "path"}
        found |= {key: node.props[key] for key in kept if key in node.props}
    return found


def dark_behind(scene: mi.Scene, depth: int) -> list[str]:
    """Kinds of surfaces that light passes, and behind which all is black with paths of so many segments, -1 for any."""
    flags = 0
    for flag in _SEE_THROUGH if depth == DIRECT else ():
        flags |= int(getattr(mi.BSDFFlags, flag))
    return sorted({name for shape in scene.shapes() for name in _see_through(shape.bsdf(), flags)})


def _see_through(bsdf: mi.BSDF | None, flags: int) -> Iterator[str]:
    if bsdf is None:
        return
    wrapped = bsdf.class_name() in _WRAPPERS and mi.has_flag(bsdf.flags(), mi.BSDFFlags.Null)
    if wrapped or int(bsdf.flags()) & flags:
        yield bsdf.class_name()


def _put_environment(state: mi.parser.ParserState, emitter: dict[str, Any]) -> None:
    """Replace the environment emitter of a parsed scene, keeping its orientation and scale, or add one."""
    for node in state.nodes:
        if node.type == mi.ObjectType.Emitter and node.props.plugin_name() in ENVIRONMENT_PLUGINS:
            node.props = in_place_of(node.props, emitter)
            return
    state.root.props["environment"] = mi.load_dict(emitter)
