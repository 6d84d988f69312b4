"""LuxCore, through ``pyluxcore``; run by :mod:`.serve`.

The path tracer on the CPU, cut after as many hits as the scene says, one for direct light: that is by samples of the
map alone, as the last vertex of a path gets no other.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pyluxcore
from numpy.typing import NDArray

_CACHE = "cache"

CONFIGURATIONS = {
    "Sobol": {"sampler.type": "SOBOL", "sampler.sobol.adaptive.strength": 0.0},
    "random": {"sampler.type": "RANDOM", "sampler.random.adaptive.strength": 0.0},
    "Sobol, visibility cache": {"sampler.type": "SOBOL", "sampler.sobol.adaptive.strength": 0.0, _CACHE: True},
}
"""Properties of the rendering by name of the configuration; ``cache``: whether the map has its visibility cache."""
_POLL = 0.002
"""Seconds between two looks at whether a rendering is done."""


def version() -> str:
    return f"LuxCore {pyluxcore.Version()}"


class Renderer:
    def __init__(self, scene: dict[str, NDArray[Any]], folder: Path) -> None:
        pyluxcore.Init(lambda message: None)
        self.arrays, self.folder = scene, folder
        self.scenes: dict[bool, Any] = {}

    def render(self, settings: dict[str, Any], spp: int, seed: int) -> tuple[NDArray[np.float32], dict[str, Any]]:
        cache = settings.get(_CACHE, False)
        if cache not in self.scenes:
            self.scenes[cache] = _scene(self.arrays, self.folder, cache)
        width, height = (int(n) for n in self.arrays["size"])
        hits = int(self.arrays["depth"]) - 1
        properties = {
            "renderengine.type": "PATHCPU",
            "renderengine.seed": seed,
            "native.threads.count": int(self.arrays["threads"]),
            **{f"path.pathdepth.{kind}": hits for kind in ("total", "diffuse", "glossy", "specular")},
            "path.clamping.variance.maxvalue": 0.0,
            "film.width": width,
            "film.height": height,
            "film.filter.type": "NONE",  # a sample counts in its own pixel: a box
            "film.outputs.0.type": "RGB",
            "film.outputs.0.filename": "rgb.exr",
            "batch.haltspp": spp,
            **{name: value for name, value in settings.items() if name != _CACHE},
        }
        session = pyluxcore.RenderSession(pyluxcore.RenderConfig(_properties(properties), self.scenes[cache]))
        start = time.perf_counter()
        session.Start()
        began = time.perf_counter()
        while not session.HasDone():
            time.sleep(_POLL)
            session.UpdateStats()
        seconds = time.perf_counter() - began
        taken = session.GetStats().Get("stats.renderengine.total.samplecount").GetFloat() / (width * height)
        session.Stop()
        image = np.empty((height, width, 3), np.float32)
        session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, image)
        return image[::-1], {"spp": taken, "seconds": seconds, "setup_seconds": began - start}


def _properties(content: dict[str, Any]) -> Any:
    properties = pyluxcore.Properties()
    for name, value in content.items():
        properties.Set(pyluxcore.Property(name, value if isinstance(value, list) else [value]))
    return properties


def _scene(arrays: dict[str, NDArray[Any]], folder: Path, cache: bool) -> Any:
    scene = pyluxcore.Scene()
    frame = arrays["camera"]
    position, forward, up = frame[:3, 3], frame[:3, 2], frame[:3, 1]
    body, ground = (float(albedo) for albedo in arrays["albedo"])
    properties = {
        "scene.camera.type": "perspective",
        "scene.camera.lookat.orig": position.tolist(),
        "scene.camera.lookat.target": (position + forward).tolist(),
        "scene.camera.up": up.tolist(),
        "scene.camera.fieldofview": float(2 * np.degrees(np.arctan(arrays["tangent"]))),
        "scene.camera.screenwindow": _window(*(int(n) for n in arrays["size"])),
        "scene.camera.autofocus.enable": False,
        "scene.lights.map.type": "infinite",
        "scene.lights.map.file": str(folder / "mirrored.exr"),
        "scene.lights.map.gamma": 1.0,
        "scene.lights.map.storage": "float",
        "scene.lights.map.visibilitymapcache.enable": cache,
        "scene.materials.body.type": "matte",
        "scene.materials.body.kd": [body] * 3,
        "scene.materials.ground.type": "matte",
        "scene.materials.ground.kd": [ground] * 3,
    }
    scene.Parse(_properties(properties))
    _mesh(scene, "body", arrays["vertices"], arrays["faces"], arrays["normals"])
    _mesh(scene, "ground", arrays["ground_vertices"], arrays["ground_faces"], None)
    return scene


def _window(width: int, height: int) -> list[float]:
    """What the film shows: left, right, bottom, top, in units of half its shorter side.

    LuxCore's images are one pixel higher than those of others, which is taken back here.
    """
    x, y = width / min(width, height), height / min(width, height)
    pixel = 2 * y / height
    return [-x, x, -y - pixel, y - pixel]


def _mesh(scene: Any, name: str, vertices: Any, faces: Any, normals: Any) -> None:
    points, triangles, directions = (
        None if a is None else list(map(tuple, a.tolist())) for a in (vertices, faces, normals)
    )
    scene.DefineMesh(name, points, triangles, directions, None, None, None)
    scene.Parse(_properties({f"scene.objects.{name}.shape": name, f"scene.objects.{name}.material": name}))
