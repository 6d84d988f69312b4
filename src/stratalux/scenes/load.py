"""From what people have on disk to a Mitsuba scene."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..errors import InputError
from ..images.repair import LIMIT
from ..integrators.environment import image_emitter, store
from ..integrators.large_map import Memory, is_large, large_envmap, there
from ..maps.envmap import EnvironmentMap
from ..maps.frames import ENV_FRAMES
from ..maps.layouts.guess import face_files
from ..settings import documented
from .assembly import assembled
from .camera import own_camera, sensor
from .demo import demo_scene
from .lamps import dome_emitter
from .mitsuba_xml import load_xml
from .settings import CameraSettings, SceneSettings
from .shapes import FORMATS, Object, load_object
from .sources import source
from .surroundings import GROUND, background, ground

USUAL_SIZE = (600, 400)
_LARGE = 1e6
"""Factor from which on the brightest texel is looked for."""


@documented(SceneSettings, CameraSettings, without=("source",))
def load_scene(
    source: str | Path | SceneSettings,
    seen: CameraSettings | None = None,
    *,
    max_memory: int | None = None,
    **settings: Any,
) -> mi.Scene:
    """Load ``source``: a Mitsuba XML file, a mesh, or ``"demo"``.

    A mesh is framed on a ground plane in ``material``, and needs an ``environment``: the file of a map, or an
    :class:`EnvironmentMap`. Elsewhere the map replaces the scene's own, in its orientation. ``rotate`` (degrees about
    the world's x, y and z axes, in that order) and ``scale`` come on top of what the scene says, ``env_frame`` before
    it. ``size``: (width, height) of the film in pixels. An XML scene keeps all of its cameras: tell ``render``, too,
    which ``camera`` it is. ``parameters``: values of ``$name`` in the XML file. ``max_memory``: bytes that the pixels
    of the map may take, see :meth:`.EnvironmentMap.load`, and those of each texture. ``seen``: settings of the camera,
    instead of keywords.

    Raises :class:`InputError` with one line that says what is wrong.
    """
    if not isinstance(source, SceneSettings):
        asked = {f.name: settings.pop(f.name) for f in fields(CameraSettings) if f.name in settings}
        source, seen = SceneSettings(str(source), **settings), seen or CameraSettings(**asked)
    return load(source, seen or CameraSettings(), max_memory).scene


@dataclass(frozen=True)
class Loaded:
    """A scene, and what its file says besides: ``integrator``, the description of one of Mitsuba's.

    ``camera``: index of the sensor that is asked for. ``measure``: how large the object is, in words.
    ``properties``: of the integrator, for what is behind and below.
    """

    scene: mi.Scene
    integrator: Mapping[str, Any] | None = None
    camera: int = 0
    measure: str = ""
    properties: Mapping[str, Any] = field(default_factory=dict)


def load(shown: SceneSettings, camera: CameraSettings, max_memory: int | None = None) -> Loaded:
    """The same from settings, with what the file says that is no part of a scene; see :func:`load_scene`."""
    environment, memory = shown.environment, None
    if shown.source != "demo":
        source(Path(shown.source))
    if isinstance(environment, str):
        for file in (Path(environment), *face_files(Path(environment))):
            source(file)
        memory = Memory()
        environment = EnvironmentMap.load(
            environment, layout=shown.env_layout, max_memory=max_memory, allocate=memory.allocate if there() else None
        )
    emitter, later = (None, False) if environment is None else _emitter(environment, memory)
    memory = None
    path, size = Path(shown.source), camera.size or USUAL_SIZE
    suffix = path.suffix.lower()
    integrator: dict[str, Any] | None = None
    chosen, measure, below = 0, "", shown.ground
    if shown.source == "demo":
        staged = _seen(camera, demo_scene(size, emitter=emitter), size)
        if shown.ground is not None:
            object_bounds = np.array([staged["object"].bbox().min, staged["object"].bbox().max])
            staged = {**{k: part for k, part in staged.items() if k != GROUND}, **_ground(shown.ground, object_bounds)}
        if shown.ground is not None or shown.background != "map":
            staged["sensor"] = _with_alpha(staged["sensor"])
        scene = mi.load_dict(staged)
    elif suffix == ".xml":
        if shown.ground is not None:
            raise InputError("ground: a Mitsuba scene has what it stands on; leave it out")
        scene, integrator = load_xml(path, emitter, camera.size, shown.definitions, max_memory)
        chosen = own_camera(camera, scene)
    elif suffix in FORMATS:
        found = load_object(path, shown.up)
        emitter = emitter or _dome(path, found, max_memory)
        below = below or _usual_ground(emitter)
        scene, measure = _of_object(path, found, shown, camera, emitter, below, max_memory), found.measure()
    else:
        known = ", ".join((".xml", *sorted(FORMATS)))
        raise InputError(f"{path}: unknown kind of scene; give {known}, or demo")
    if later and environment is not None:
        store(_image_emitter(scene), environment.as_single().texels)
        dr.flush_malloc_cache()
    environment = None  # or there would be two of them, where it was copied
    _orient(scene, shown.rotate, shown.scale, ENV_FRAMES[shown.env_frame])
    properties = _properties(scene, shown, chosen, below == "catcher", max_memory)
    return Loaded(scene, integrator, chosen, measure, properties)


def _properties(
    scene: mi.Scene, shown: SceneSettings, camera: int, catches: bool, max_memory: int | None
) -> dict[str, Any]:
    """What the integrator has to be told of the surroundings; nothing where they are as in any scene."""
    found = {} if shown.background == "map" else {"background": background(scene, shown.background, camera, max_memory)}
    return {**found, "catcher": GROUND} if catches else found


def _ground(kind: str, bounds: Any) -> dict[str, Any]:
    """The ground by its name in a scene; nothing without one."""
    made = ground(kind, bounds)
    return {} if made is None else {GROUND: made}


def _with_alpha(sensor: dict[str, Any]) -> dict[str, Any]:
    return {**sensor, "film": {**sensor["film"], "pixel_format": "rgba"}}


def _seen(camera: CameraSettings, staged: dict[str, Any], size: tuple[int, int]) -> dict[str, Any]:
    """The scene of a stage, seen from where the settings say."""
    if not camera.changed().keys() - {"size"}:
        return staged
    points = mi.traverse(staged["object"])["vertex_positions"].numpy().reshape(-1, 3)
    return {**staged, "sensor": sensor(camera, points, (), size)}


def _dome(path: Path, found: Object, max_memory: int | None) -> dict[str, Any] | None:
    """The map that a file brings itself, or None."""
    domes = [light for light in found.lights if light.kind == "dome"]
    return dome_emitter(path, domes[0], max_memory) if domes else None


def _usual_ground(emitter: dict[str, Any] | None) -> str:
    """Shadows are caught where it is known, in RGB, what would be there without them."""
    return "catcher" if emitter is not None and emitter["type"] != "constant" and not mi.is_spectral else "matte"


def _of_object(
    path: Path,
    found: Object,
    shown: SceneSettings,
    camera: CameraSettings,
    emitter: dict[str, Any] | None,
    below: str,
    max_memory: int | None,
) -> mi.Scene:
    """The scene of a file that is none itself: an object on a ground, in front of a camera, and its own lights."""
    size = camera.size or USUAL_SIZE
    scene = mi.load_dict(
        {
            "type": "scene",
            "sensor": _with_alpha(sensor(camera, found.points(), found.cameras, size, origin=found.origin)),
            **assembled(path, found, shown.material, max_memory),
            **_ground(below, found.bounds),
            **({} if emitter is None else {"emitter": emitter}),
        }
    )
    if not scene.emitters():
        raise InputError(f"{path}: an object without lights; give an environment map with --env MAP")
    return scene


def envmap(environment: EnvironmentMap) -> dict[str, Any]:
    """Mitsuba's own emitter of a map, as a dictionary."""
    return {"type": "envmap", "bitmap": mi.Bitmap(environment.as_single().texels)}


def _emitter(environment: EnvironmentMap, memory: Memory | None) -> tuple[dict[str, Any], bool]:
    """The emitter of a map, and whether it has another one's texels yet.

    Mitsuba takes more memory and time for a bitmap than for texels that are put in the place of others.
    """
    if is_large(environment):
        return large_envmap(environment.texels, memory), False
    if mi.is_spectral or mi.is_monochromatic:
        return envmap(environment), False
    return envmap(EnvironmentMap(np.ones((3, 4, 3), dtype=np.float32))), True


def _image_emitter(scene: mi.Scene) -> mi.Emitter:
    emitter = image_emitter(scene)
    assert emitter is not None
    return emitter


def _orient(scene: mi.Scene, rotate: tuple[float, float, float], scale: float, turn: float) -> None:
    """Turn and scale the scene's environment map, whose tool has it turned by ``turn`` degrees about y."""
    if not (any(rotate) or turn) and scale == 1:
        return
    emitter = image_emitter(scene)
    if emitter is None:
        raise InputError("the scene has no environment map to rotate or scale; give one with --env MAP")
    params = mi.traverse(emitter)
    rotation = mi.ScalarTransform4f()
    for axis, angle in zip(np.eye(3).tolist(), rotate, strict=True):
        rotation = mi.ScalarTransform4f().rotate(axis, math.fmod(angle, 360)) @ rotation
    frame = mi.ScalarTransform4f().rotate([0, 1, 0], turn)
    kind = type(params["to_world"])
    params["to_world"] = kind(rotation.matrix) @ params["to_world"] @ kind(frame.matrix)
    params["scale"] = params["scale"] * scale
    if scale > _LARGE and float(params["data"].numpy().max()) * float(dr.slice(params["scale"], 0)) > LIMIT:
        raise InputError(f"brightness of the map: {scale:g} times it is more than can be reckoned with; give less")
    params.update()
    dr.eval(params["to_world"], params["scale"])
