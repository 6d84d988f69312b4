"""Errors of light rigs: every method and number of lights, on the maps that are there: python -m benchmarks.rigs

Prints the tables of docs/rigs.md. Maps are reduced to no less than what is measured (see ``stratalux.rigs.quality``).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
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
COUNTS = (1, 2, 4, 8, 16, 32)
Make = Callable[[EnvironmentMap, int], Lights]


def strata(method: str, environment: EnvironmentMap, n: int) -> Lights:
    return light_rig(method, environment, n).lights()


METHODS: dict[str, Make] = {
    **{method: partial(strata, method) for method in RIGS},
    "fitted": fitted,
    "fitted, constant": partial(fitted, ambient="constant"),
    "fitted, sh2": partial(fitted, ambient="sh2"),
}


def main() -> None:
    warnings.simplefilter("ignore", RigWarning)
    maps = {name.split(".")[0].split("_")[0]: EnvironmentMap.load(asset(f"envmaps/{name}")) for name in MAPS}
    errors: dict[tuple[str, int, str], dict[str, float]] = {}
    for name, environment in maps.items():
        for method, make in METHODS.items():
            for n in COUNTS:
                errors[method, n, name] = quality(environment, make(environment, n))
        errors["sun", 1, name] = quality(environment, sun_and_sky(environment))

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
