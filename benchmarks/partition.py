"""Time of the partition into 1,024 regions in NumPy, from the texels on: 1024x512 and 8192x4096."""

from __future__ import annotations

import time
from statistics import median

import numpy as np

from benchmarks.common import machine
from stratalux import EnvironmentMap, median_cut
from stratalux.scenes.demo import demo_map


def seconds(texels: np.ndarray, n: int, rounds: int) -> list[float]:
    times = []
    for _ in range(rounds + 1):
        start = time.perf_counter()
        median_cut(EnvironmentMap(texels), n)
        times.append(time.perf_counter() - start)
    return times[1:]  # the first warms up


def main() -> None:
    print(machine())
    small = demo_map(512)
    for texels, rounds in ((small, 21), (np.tile(small, (8, 8, 1)), 5)):
        times = seconds(texels, 1024, rounds)
        height, width, _ = texels.shape
        spread = f"{1000 * min(times):.1f} to {1000 * max(times):.1f}"
        print(f"{width}x{height} into 1024 regions: median {1000 * median(times):.1f} ms ({spread})")


if __name__ == "__main__":
    main()
