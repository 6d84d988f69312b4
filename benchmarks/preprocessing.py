"""Preprocessing of Grace Cathedral for 300 lights or regions: every rig, and the stratification, in turn."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from typing import Any

from benchmarks.common import asset, machine
from stratalux import EnvironmentMap, median_cut
from stratalux.rendering.variants import choose_variant
from stratalux.rigs import RIGS

N = 300
ROUNDS = 7


def main() -> None:
    texels = EnvironmentMap.load(asset("envmaps/grace_latlong.exr")).texels
    choose_variant()
    import drjit as dr

    from stratalux.sampling.leaf_sampler import RegionLeafSampler

    def stratification(environment: EnvironmentMap, n: int) -> None:
        RegionLeafSampler(environment, median_cut(environment, n))
        dr.sync_thread()

    tasks: dict[str, Callable[..., Any]] = {
        "median cut alone": median_cut,
        "median cut and leaves": stratification,
        **{f"rig {name}": method for name, method in RIGS.items()},
    }
    times: dict[str, list[float]] = {name: [] for name in tasks}
    for k in range(ROUNDS + 1):
        for name, task in tasks.items():
            environment = EnvironmentMap(texels)  # nothing is remembered from the round before
            start = time.perf_counter()
            task(environment, N)
            if k:
                times[name].append(1000 * (time.perf_counter() - start))
    print(machine())
    base = median(times["median cut alone"])
    for name, values in times.items():
        ms = median(values)
        print(f"{name:22} {ms:9.1f} ms  ({min(values):.1f} to {max(values):.1f})  {ms / base:7.1f} x median cut")


if __name__ == "__main__":
    main()
