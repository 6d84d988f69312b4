"""Errors of light rigs: every method and number of lights, on the maps that are there: python -m benchmarks.rigs

Prints the tables of docs/rigs.md. Maps are halved first; what is measured is no finer (``stratalux.rigs.quality``).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

from benchmarks.common import asset
from stratalux import EnvironmentMap
from stratalux.errors import RigWarning
from stratalux.rigs import RIGS, light_rig
from stratalux.rigs.fitted import fitted, sun_and_sky
from stratalux.rigs.lights import Lights
from stratalux.rigs.quality import quality

MAPS = (
    "apartment.hdr",
    "forest.hdr",
    "grace_latlong.exr",
    "night.hdr",
    "sky.hdr",
    "studio.hdr",
    "venice.hdr",
    "warehouse.hdr",
)
COUNTS = (1, 4, 8, 32)
PROCESSES = 2
Make = Callable[[EnvironmentMap, int], Lights]


def strata(method: str, environment: EnvironmentMap, n: int) -> Lights:
    return light_rig(method, environment, n).lights()


METHODS: dict[str, Make] = {
    **{method: partial(strata, method) for method in RIGS},
    "fitted": fitted,
    "fitted, constant": partial(fitted, ambient="constant"),
    "fitted, sh2": partial(fitted, ambient="sh2"),
}


def measure(file: str) -> dict[tuple[str, int], dict[str, float]]:
    """The errors of all methods on one map."""
    warnings.simplefilter("ignore", RigWarning)
    texels = EnvironmentMap.load(asset(f"envmaps/{file}")).texels
    height, width, _ = texels.shape
    environment = EnvironmentMap(texels.reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3), dtype=np.float32))
    found = {
        (method, n): quality(environment, make(environment, n)) for method, make in METHODS.items() for n in COUNTS
    }
    return {**found, ("sun", 1): quality(environment, sun_and_sky(environment))}


def main() -> None:
    maps = [name.split(".")[0].split("_")[0] for name in MAPS]
    errors: dict[tuple[str, int, str], dict[str, float]] = {}
    with ProcessPoolExecutor(PROCESSES) as pool:
        for name, found in zip(maps, pool.map(measure, MAPS), strict=True):
            errors |= {(method, n, name): each for (method, n), each in found.items()}

    for title, kind in (("Irradiance", "irradiance_error"), ("Shadows", "shadow_error")):
        print(f"\n{title}, geometric mean over the maps, per cent\n")
        print("| method | " + " | ".join(f"N = {n}" for n in COUNTS) + " |")
        print("|---" * (len(COUNTS) + 1) + "|")
        for method in (*METHODS, "sun"):
            cells = []
            for n in COUNTS:
                found = [errors[method, n, name][kind] for name in maps if (method, n, name) in errors]
                cells.append(f"{100 * np.exp(np.mean(np.log(found))):.2g}" if found else "")
            print(f"| {method} | " + " | ".join(cells) + " |")

    columns = (*METHODS, "fitted, sh2, N = 1", "sun")
    for title, kind in (("Irradiance", "irradiance_error"), ("Shadows", "shadow_error")):
        print(f"\n{title} at N = 8, per cent\n")
        print("| map | " + " | ".join(columns) + " |")
        print("|---" * (len(columns) + 1) + "|")
        for name in maps:
            row = [errors[method, 8, name] for method in METHODS]
            row += [errors["fitted, sh2", 1, name], errors["sun", 1, name]]
            print(f"| {name} | " + " | ".join(f"{100 * each[kind]:.2g}" for each in row) + " |")


if __name__ == "__main__":
    main()
