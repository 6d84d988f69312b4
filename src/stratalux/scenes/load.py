"""From what people have on disk to a Mitsuba scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..errors import InputError
from ..images.repair import LIMIT
from ..integrators.environment import image_emitter
from ..maps.envmap import EnvironmentMap
from ..settings import documented
from .demo import demo_scene
from .materials import material as material_by_name
from .mesh import FORMATS, load_mesh
from .mitsuba_xml import load_xml
from .settings import CameraSettings, SceneSettings
from .stage import stage

USUAL_SIZE = (600, 400)
_LARGE = 1e6
"""Factor from which on the brightest texel is looked for."""


@documented(SceneSettings, CameraSettings, without=("source",))
def load_scene(
    source: str | Path | SceneSettings,
    camera: CameraSettings | None = None,
    *,
    max_memory: int | None = None,
    **settings: Any,
) -> mi.Scene:
    """Load ``source``: a Mitsuba XML file, a mesh, or ``"demo"``.

    A mesh is framed on a ground plane in ``material``, and needs an ``environment``: the file of a map, or an
    :class:`EnvironmentMap`. Elsewhere the map replaces the scene's own, in its orientation. ``rotate`` (degrees about
    the world's x, y and z axes, in that order) and ``scale`` come on top of what the scene says. ``size``: (width,
    height) of the film in pixels. ``parameters``: values of ``$name`` in the XML file. ``max_memory``: bytes that the
    pixels of the map may take, see :meth:`.EnvironmentMap.load`, and those of each texture that an XML file names.

    Raises :class:`InputError` with one line that says what is wrong.
    """
    if not isinstance(source, SceneSettings):
        seen = {name: settings.pop(name) for name in ("size", "sensor") if name in settings}
        source, camera = SceneSettings(str(source), **settings), camera or CameraSettings(**seen)
    return load(source, camera or CameraSettings(), max_memory).scene


@dataclass(frozen=True)
class Loaded:
    """A scene, and what its file says besides: ``hide_emitters``, of the integrator that is replaced."""

    scene: mi.Scene
    hide_emitters: bool = False


def load(shown: SceneSettings, camera: CameraSettings, max_memory: int | None = None) -> Loaded:
    """The same from settings, with what the file says that is no part of a scene; see :func:`load_scene`."""
    environment = shown.environment
    if isinstance(environment, str):
        environment = EnvironmentMap.load(environment, max_memory=max_memory)
    emitter = None if environment is None else envmap(environment)
    path, size = Path(shown.source), camera.size or USUAL_SIZE
    suffix = path.suffix.lower()
    hide_emitters = False
    if shown.source == "demo":
        scene = mi.load_dict(demo_scene(size, emitter=emitter))
    elif suffix == ".xml":
        bitmap = emitter and emitter["bitmap"]
        scene, hide_emitters = load_xml(path, bitmap, camera.size, shown.definitions, max_memory)
    elif suffix in FORMATS:
        if emitter is None:
            raise InputError(f"{path}: a mesh brings no light; give an environment map with --env MAP")
        scene = mi.load_dict(stage(load_mesh(path, shown.up), material_by_name(shown.material), emitter, size))
    else:
        known = ", ".join((".xml", *sorted(FORMATS)))
        raise InputError(f"{path}: unknown kind of scene; give {known}, or demo")
    _orient(scene, shown.rotate, shown.scale)
    return Loaded(scene, hide_emitters)


def envmap(environment: EnvironmentMap) -> dict[str, Any]:
    """The Mitsuba emitter of a map, as a dictionary."""
    return {"type": "envmap", "bitmap": mi.Bitmap(environment.texels)}


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
        rotation = mi.ScalarTransform4f().rotate(axis, math.fmod(angle, 360)) @ rotation
    params["to_world"] = type(params["to_world"])(rotation.matrix) @ params["to_world"]
    params["scale"] = params["scale"] * scale
    if scale > _LARGE and np.abs(params["data"].numpy()).max() * float(dr.slice(params["scale"], 0)) > LIMIT:
        raise InputError(f"brightness of the map: {scale:g} times it is more than can be reckoned with; give less")
    params.update()
    dr.eval(params["to_world"], params["scale"])
