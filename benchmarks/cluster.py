"""How far a cluster carries: a simulation of a large picture, with launches and sums measured here.

    python -m benchmarks.cluster [--bandwidth 1.25e9] [--cores 16]

Prints a table for docs/cluster.md. Measured on this machine: seconds and bytes of a launch of each stage at the size of
the film, seconds to add two results, and to load the scene. Assumed: the network's bandwidth, the cores of a worker,
and that a launch takes so much less time on them.
"""

from __future__ import annotations

import argparse
import heapq
import math
import time
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

import stratalux
from stratalux.integrators.launches import together
from stratalux.rendering.cluster.client import launches_of_a_task

SIZE, SPP = (3840, 2160), 4096
WORKERS = (1, 10, 100, 1000)


@dataclass(frozen=True)
class Stage:
    """``launches`` of so many core-``seconds`` each; results have so many ``bytes``; two take ``adding`` seconds."""

    name: str
    launches: int
    seconds: float
    bytes: int
    adding: float


def measured() -> tuple[float, list[Stage]]:
    """Seconds until the first launch can begin, and the stages of ``direct_stratified``, measured launch by launch."""
    start = time.perf_counter()
    scene = stratalux.load_scene("demo", size=SIZE)
    camera = scene.sensors()[0]
    integrator = mi.load_dict({"type": "direct_stratified"})
    integrator.prepare(scene)
    preparation = time.perf_counter() - start
    stages: list[Stage] = []

    def make(stage, known, first, count, launch):  # type: ignore[no-untyped-def]
        results, seconds = [], []
        for k in range(4, 7):  # of full size; the first of them compiles
            begin = time.perf_counter()
            results.append(launch(k))
            dr.sync_thread()
            seconds.append(time.perf_counter() - begin)
        begin = time.perf_counter()
        together(results[1], results[2])
        adding = time.perf_counter() - begin
        size = sum(np.asarray(value).nbytes for value in results[1].values())
        stages.append(Stage(stage, count, min(seconds) * dr.thread_count(), size, adding))
        yield count, results[1]

    for _ in integrator.passes(scene, camera, 1, SPP, make=make):
        if len(stages) == 2:
            break
    return preparation, stages


def simulated(
    workers: int, preparation: float, stages: list[Stage], cores: int, bandwidth: float
) -> tuple[float, float]:
    """Seconds of the whole picture, and of those that render alone, on one worker after the other."""
    now, rendering = preparation, 0.0
    for stage in stages:
        one = stage.seconds / cores
        transfer = stage.bytes / bandwidth
        each = launches_of_a_task(one, stage.bytes, bandwidth)
        free = [now] * workers
        heapq.heapify(free)
        left, done = stage.launches, now
        rng = np.random.default_rng(1)
        while left > 0:
            ends = []
            for _ in range(workers):
                if left <= 0:
                    break
                count = min(each, left)
                left -= count
                begin = heapq.heappop(free)
                end = begin + count * one * rng.uniform(0.9, 1.2) + (count - 1) * stage.adding
                heapq.heappush(free, end)
                ends.append(end)
            # Two and two, on the workers that have them, which go on rendering meanwhile but for what adding takes.
            levels = math.ceil(math.log2(max(len(ends), 1)))
            arrived = max(ends) + levels * (transfer + stage.adding) + transfer
            done = max(done + transfer, arrived)  # one after the other, on the machine that asks
            if len(ends) > 1:
                free = [t + stage.adding + transfer / 2 for t in free]
                heapq.heapify(free)
        rendering += stage.launches * one
        now = done + transfer * math.log2(max(workers, 2))  # what the next stage has to know
    return now, rendering


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bandwidth", type=float, default=1.25e9, help="bytes per second: 10 Gbit/s")
    parser.add_argument("--cores", type=int, default=16, help="of a worker")
    options = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    from stratalux.integrators.automatic.view import room  # of the active variant

    preparation, stages = measured()
    samples = room(SIZE[0] * SIZE[1])
    print(f"{SIZE[0]}x{SIZE[1]}, {SPP} spp, launches of {samples} samples; preparation {preparation:.1f} s")
    for stage in stages:
        print(
            f"{stage.name}: {stage.launches} launches of {stage.seconds:.2f} core-seconds, {stage.bytes / 1e6:.0f} MB, "
            f"added in {stage.adding:.2f} s"
        )
    print("| workers | time | efficiency |\n|---|---|---|")
    for workers in WORKERS:
        seconds, rendering = simulated(workers, preparation, stages, options.cores, options.bandwidth)
        print(f"| {workers} | {seconds:,.0f} s | {100 * rendering / workers / seconds:.0f} % |")


if __name__ == "__main__":
    main()
