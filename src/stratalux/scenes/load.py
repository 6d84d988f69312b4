"""From what people have on disk to a Mitsuba scene."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..errors import InputError
from ..images.files import one_line
from ..images.repair import LIMIT
from ..integrators.environment import image_emitter
from ..maps.envmap import EnvironmentMap
from .demo import demo_scene
from .materials import material as material_by_name
from .mesh import FORMATS, load_mesh
from .stage import stage

_LARGE = 1e6
"""Factor from which on the brightest texel is looked for."""
ENVIRONMENT_PLUGINS = ("envmap", "constant", "sunsky", "sky", "sun")


def load_scene(
    source: str | Path,
    *,
    environment: str | Path | EnvironmentMap | None = None,
    rotate: tuple[float, float, float] = (0, 0, 0),
    scale: float = 1.0,
    material: str = "diffuse",
    up: str | None = None,
    size: tuple[int, int] | None = None,
    parameters: Mapping[str, str] | None = None,
    max_memory: int | None = None,
) -> mi.Scene:
    """Load ``source``: a Mitsuba XML file, a mesh, or ``"demo"``.

    A mesh is framed on a ground plane in ``material``, and needs an ``environment`` map; elsewhere the map replaces the
    scene's own, in its orientation. ``rotate``: degrees about the world's x, y and z axes, in that order, and
    ``scale``: both on top of what the scene says. ``up``: axis of the mesh file that points up. ``size``: (width,
    height) of the film in pixels. ``parameters``: values of ``$name`` in the XML file. ``max_memory``: bytes that the
    pixels of the map may take, see :meth:`.EnvironmentMap.load`.

    Raises :class:`InputError` with one line that says what is wrong.
    """
    if not all(map(math.isfinite, rotate)):
        raise InputError(f"rotation of the map: {', '.join(map(str, rotate))} are no angles; give degrees")
    if not 0 <= scale <= LIMIT:
        raise InputError(f"brightness of the map: {scale} is no factor for light; give one from 0 to {LIMIT:g}")
    if isinstance(environment, (str, Path)):
        environment = EnvironmentMap.load(environment, max_memory=max_memory)
    source = Path(source)
    suffix = source.suffix.lower()
    if str(source) == "demo":
        emitter = None if environment is None else envmap(environment)
        scene = mi.load_dict(demo_scene(size or (600, 400), emitter=emitter))
    elif suffix == ".xml":
        scene = _load_xml(source, environment, size, parameters or {})
    elif suffix in FORMATS:
        if environment is None:
            raise InputError(f"{source}: a mesh brings no light; give an environment map with --env MAP")
        scene = mi.load_dict(
            stage(load_mesh(source, up), material_by_name(material), envmap(environment), size or (600, 400))
        )
    else:
        known = ", ".join((".xml", *sorted(FORMATS)))
        raise InputError(f"{source}: unknown kind of scene; give {known}, or demo")
    _orient(scene, rotate, scale)
    return scene


def envmap(environment: EnvironmentMap) -> dict[str, Any]:
    """The Mitsuba emitter of a map, as a dictionary."""
    return {"type": "envmap", "bitmap": mi.Bitmap(environment.texels)}


def _load_xml(
    path: Path, environment: EnvironmentMap | None, size: tuple[int, int] | None, parameters: Mapping[str, str]
) -> mi.Scene:
    if not path.is_file():
        raise InputError(f"{path}: no such file; give a Mitsuba scene, a mesh, or demo")
    config = mi.parser.ParserConfig(mi.variant())
    outer = mi.file_resolver()
    inner = mi.FileResolver(outer)
    inner.prepend(str(path.resolve().parent))  # files are named relative to the scene
    mi.set_file_resolver(inner)
    try:
        state = mi.parser.parse_file(config, str(path.resolve()), **parameters)
        mi.parser.transform_all(config, state)
        for node in state.nodes:
            if node.type == mi.ObjectType.Film and size is not None:
                node.props["width"], node.props["height"] = size
        if environment is not None:
            _put_environment(state, environment)
        scene = mi.parser.instantiate(config, state)
    except (RuntimeError, ValueError, TypeError) as error:
        raise InputError(f"{path}: {one_line(error)}") from None
    finally:
        mi.set_file_resolver(outer)
    scene = scene[0] if isinstance(scene, (list, tuple)) else scene
    if not isinstance(scene, mi.Scene):
        raise InputError(f"{path}: holds a {type(scene).__name__}, not a scene")
    if not scene.sensors():
        raise InputError(f"{path}: the scene has no sensor; add one")
    return scene


def _put_environment(state: mi.parser.ParserState, environment: EnvironmentMap) -> None:
    """Replace the environment emitter of a parsed scene, keeping its orientation and scale, or add one."""
    for node in state.nodes:
        if node.type == mi.ObjectType.Emitter and node.props.plugin_name() in ENVIRONMENT_PLUGINS:
            props = mi.Properties("envmap")
            props.set_id(node.props.id())
            if node.props.plugin_name() == "envmap":
                for name in ("to_world", "scale", "mis_compensation"):
                    if name in node.props:
                        props[name] = node.props[name]
            props["bitmap"] = mi.Bitmap(environment.texels)
            node.props = props
            return
    state.root.props["environment"] = mi.load_dict(envmap(environment))


def _orient(scene: mi.Scene, rotate: tuple[float, float, float], scale: float) -> None:
    """Turn and scale the scene's environment map."""
    if not any(rotate) and scale == 1:
        return
    emitter = image_emitter(scene)
    if emitter is None:
        raise InputError("the scene has no environment map to rotate or scale; give one with --env MAP")
    params = mi.traverse(emitter)
    rotation = mi.ScalarTransform4f()
    for axis, angle in zip(np.eye(3).tolist(), rotate, strict=True):
        rotation = mi.ScalarTransform4f().rotate(axis, angle) @ rotation
    params["to_world"] = type(params["to_world"])(rotation.matrix) @ params["to_world"]
    params["scale"] = params["scale"] * scale
    if scale > _LARGE and np.abs(params["data"].numpy()).max() * float(dr.slice(params["scale"], 0)) > LIMIT:
        raise InputError(f"brightness of the map: {scale:g} times it is more than can be reckoned with; give less")
    params.update()
    dr.eval(params["to_world"], params["scale"])
