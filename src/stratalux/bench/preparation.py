"""What comes before the first ray: our tables against Mitsuba's own construction of its ``envmap``, by size of the map.

Ours are those that one gets by default, and those of the paper's scheme with many regions (``pinned``).

Each size is measured in a process of its own, whose peak of memory is then that of one thing at a time. Linux alone
tells it; elsewhere the memory is null.
"""

from __future__ import annotations

import gc
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..comparison.records import Spread
from ..errors import InputError
from .candidates import OURS
from .records import spread_json

_SPP = 16
_FILM = (192, 128)
_SUNS = 40


def measure_preparation(width: int, height: int, strata: int, repeats: int) -> dict[str, Any]:
    """Figures for a synthetic map of ``width`` x ``height``, as in the results' format; in a process of its own."""
    program = "import sys; from stratalux.bench.preparation import main; main(sys.argv[1:])"
    command = [sys.executable, "-c", program, *map(str, (width, height, strata, repeats))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        last = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
        raise InputError(f"preparation of a {width}x{height} map: {last[0]}; is there enough memory and room in /tmp?")
    content: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return content


def synthetic_map(width: int, height: int) -> NDArray[np.float32]:
    """A sky with grain in every texel and a few small suns, (height, width, 3); the same for every call."""
    rng = np.random.default_rng(7)
    texels = np.empty((height, width, 3), dtype=np.float32)
    colour = np.array([0.5, 0.7, 1.0], dtype=np.float32)
    for row in range(height):  # no temporary of the size of the map
        texels[row] = (0.2 + 0.8 * rng.random((width, 1), dtype=np.float32)) * colour
    side = max(1, width // 512)
    for _ in range(_SUNS):
        y, x = rng.integers(0, height - side), rng.integers(0, width - side)
        texels[y : y + side, x : x + side] = 1000 * rng.random()
    return texels


class _Memory:
    """Bytes of this process: at the peak since it was made, beyond what was there before."""

    def __init__(self) -> None:
        _release()
        try:
            Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # forget the former peak
            self.before = _status("VmRSS")
        except OSError:
            self.before = None

    def peak(self) -> int | None:
        return None if self.before is None else max(0, (_status("VmHWM") or 0) - self.before)


def _release() -> None:
    """Give back the memory that Dr.Jit has kept: taking it again leaves no trace and is quicker than new memory."""
    import drjit as dr

    dr.sync_thread()
    gc.collect()
    dr.flush_malloc_cache()


def _status(name: str) -> int | None:
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith(name):
            return 1024 * int(line.split()[1])
    return None


def _measure(width: int, height: int, strata: int, repeats: int, folder: Path) -> dict[str, Any]:
    import mitsuba as mi

    from ..integrators.techniques import parse_technique
    from ..rendering.passes import render
    from ..rendering.variants import choose_variant

    choose_variant()
    from ..integrators.light_samples import SharedLight  # integrators derive from the variant's own classes

    mi.set_log_level(mi.LogLevel.Error)
    technique, given = parse_technique(OURS.technique)
    ways = {"ours": given, "pinned": {**given, "strata": strata}}
    # Imports and kernels are not what is measured.
    for way in ways.values():
        mi.load_dict(technique.integrator(way)).prepare(_scene({"type": "envmap", "bitmap": _bitmap(64, 32)}))
    texels = synthetic_map(width, height)
    size = texels.nbytes
    path = folder / "map.hdr"
    mi.Bitmap(texels).write(str(path))

    seconds: dict[str, list[float]] = {name: [] for name in ("mitsuba_array", "mitsuba_file", *ways)}
    memory: dict[str, list[int | None]] = {name: [] for name in ("mitsuba_array", *ways)}
    tables: dict[str, int] = {}
    scene: Any = None
    for _ in range(repeats):
        scene = None  # one map at a time
        _release()
        seconds["mitsuba_file"].append(_seconds(partial(_emitter, filename=str(path)))[0])

        bitmap = mi.Bitmap(texels)
        watch = _Memory()
        elapsed, emitter = _seconds(partial(_emitter, bitmap=bitmap))
        seconds["mitsuba_array"].append(elapsed)
        memory["mitsuba_array"].append(watch.peak())

        scene = _scene(emitter)
        for name, way in ways.items():
            integrator = mi.load_dict(technique.integrator(way))
            watch = _Memory()
            elapsed, light = _seconds(partial(integrator.prepare, scene))
            seconds[name].append(elapsed)
            memory[name].append(watch.peak())
            tables[name] = light.tables.bytes + SharedLight.BYTES * light.tables.count
            integrator = light = None

    integrators = {
        "ours": mi.load_dict(technique.integrator(given)),
        "direct": mi.load_dict({"type": "direct", "emitter_samples": 1, "bsdf_samples": 0}),
    }
    sample: dict[str, list[float]] = {name: [] for name in integrators}
    for k in range(repeats + 1):
        for name, one in integrators.items():
            result = render(scene, integrator=one, spp=_SPP, seed=k)
            if k:
                sample[name].append(result.seconds / result.spp)
    return {
        "width": width,
        "height": height,
        "strata": strata,
        "map_bytes": size,
        "seconds": {name: spread_json(Spread(tuple(values))) for name, values in seconds.items()},
        # The first is the honest one: later ones find memory that the process has kept.
        "peak_bytes_per_byte": {
            name: None if values[0] is None else values[0] / size for name, values in memory.items()
        },
        "table_bytes": tables,
        "seconds_per_spp": {name: spread_json(Spread(tuple(values))) for name, values in sample.items()},
        "film": list(_FILM),
    }


def _seconds(task: Callable[[], Any]) -> tuple[float, Any]:
    """How long ``task`` takes, with what it leaves to other threads, and its result."""
    import drjit as dr

    start = time.perf_counter()
    result = task()
    dr.sync_thread()
    return time.perf_counter() - start, result


def _emitter(**given: Any) -> Any:
    """Mitsuba's, ready for the first ray: it leaves the last kernel of its construction to whoever looks first."""
    import drjit as dr
    import mitsuba as mi

    emitter = mi.load_dict({"type": "envmap", **given})
    dr.eval(mi.traverse(emitter)["data"])
    return emitter


def _bitmap(width: int, height: int) -> Any:
    import mitsuba as mi

    return mi.Bitmap(synthetic_map(width, height))


def _scene(emitter: Any) -> Any:
    """A matte ball under the map."""
    import mitsuba as mi

    from ..scenes.materials import material

    return mi.load_dict(
        {
            "type": "scene",
            "map": emitter,
            "ball": {"type": "sphere", "bsdf": material("diffuse")},
            "sensor": {
                "type": "perspective",
                "to_world": mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0]),
                "film": {"type": "hdrfilm", "width": _FILM[0], "height": _FILM[1], "rfilter": {"type": "box"}},
                "sampler": {"type": OURS.sampler},
            },
        }
    )


def main(arguments: list[str]) -> None:
    """What the process does: prints the figures for the width, height, strata and repeats of ``arguments``."""
    width, height, strata, repeats = (int(argument) for argument in arguments)
    with tempfile.TemporaryDirectory(prefix="stratalux-bench-") as folder:
        print(json.dumps(_measure(width, height, strata, repeats, Path(folder))))
