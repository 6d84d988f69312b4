"""The far side of :mod:`.worker`: holds one renderer and one scene, and renders what it is told.

``python serve.py RENDERER FOLDER``, with RENDERER the name of a file beside this one. It runs as a file and not as part
of the package: it needs NumPy and its renderer and nothing else. So neither Mitsuba nor its libraries are loaded beside
those of the other, and the interpreter may be another one than ours.

In both directions, a line is a JSON object; answers are marked, as renderers talk too. The scene is in FOLDER, see
:mod:`.scene`; images go there as ``image.npy``, (H, W, 3) float32, linear, the top row first.

A RENDERER is a module with ``CONFIGURATIONS`` (settings by name), ``version()`` and ``Renderer(scene, folder)``, whose
``render(settings, spp, seed)`` returns the image and a dictionary: ``spp`` taken, ``seconds`` of the rendering alone,
and ``setup_seconds`` of what came before it (BVH, importance map, caches).
"""

from __future__ import annotations

import importlib.util
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

MARK = "@stratalux "
"""Before each answer."""


def load(name: str) -> Any:
    """The module of a file beside this one, under a name that no module of the renderer's own has."""
    spec = importlib.util.spec_from_file_location(f"stratalux_peer_{name}", Path(__file__).with_name(f"{name}.py"))
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def answer(content: dict[str, Any]) -> None:
    print(f"\n{MARK}{json.dumps(content)}", flush=True)


def main(name: str, folder: Path) -> None:
    start = time.perf_counter()
    module = load(name)
    with np.load(folder / "scene.npz") as stored:
        renderer = module.Renderer({key: stored[key] for key in stored.files}, folder)
    seconds = time.perf_counter() - start
    answer({"version": module.version(), "configurations": module.CONFIGURATIONS, "load_seconds": seconds})
    for line in sys.stdin:
        job = json.loads(line)
        image, about = renderer.render(job["settings"], job["spp"], job["seed"])
        np.save(folder / "image.npy", np.ascontiguousarray(image, dtype=np.float32))
        answer(about)


if __name__ == "__main__":
    # The folder of this file is on the path, where its cycles.py would hide Blender's own module of that name.
    sys.path[:] = [place for place in sys.path if Path(place).resolve() != Path(__file__).resolve().parent]
    main(sys.argv[1], Path(sys.argv[2]))
