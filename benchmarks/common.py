"""What the benchmarks share: alternating timing, error, the machine."""

from __future__ import annotations

import os
import platform
import time
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

import stratalux

ASSETS = Path(os.environ.get("STRATALUX_ASSETS", Path(__file__).parents[2] / "shared" / "assets"))


def machine() -> str:
    """One line that says where the numbers come from."""
    cpu = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        cpu = next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    versions = f"stratalux {stratalux.__version__}, mitsuba {mi.__version__}, numpy {np.__version__}"
    return f"{cpu}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}, {versions}"


def timed_render(scene: mi.Scene, integrator: mi.Integrator, spp: int, seed: int) -> tuple[NDArray[np.float32], float]:
    """The image, and the seconds it took once everything was compiled and prepared."""
    dr.sync_thread()
    start = time.perf_counter()
    image = mi.render(scene, integrator=integrator, spp=spp, seed=seed)
    dr.eval(image)
    dr.sync_thread()
    return np.array(image), time.perf_counter() - start


def relative_mse(image: NDArray[np.float32], reference: NDArray[np.float64], mask: NDArray[np.bool_]) -> float:
    """Mean of (I − R)² / (R² + 0.01) over the pixels of ``mask`` and all channels."""
    error = (image.astype(np.float64) - reference) ** 2 / (reference**2 + 0.01)
    return float(error[mask].mean())
