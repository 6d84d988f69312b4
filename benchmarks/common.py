"""What the benchmarks share: alternating timing, error, the machine."""

from __future__ import annotations

import platform
import sys
import time
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

import stratalux
from stratalux import InputError, provenance
from stratalux.assets import Assets
from stratalux.metrics import relative_mse

__all__ = ["asset", "machine", "relative_mse", "timed_render"]


def asset(file: str) -> Path:
    """A file of real data, by its path in the folder of assets; ends the program where it is missing."""
    try:
        return Assets().require(file)
    except InputError as error:
        sys.exit(str(error))


def machine() -> str:
    """One line that says where the numbers come from."""
    versions = f"stratalux {stratalux.__version__}, mitsuba {mi.__version__}, numpy {np.__version__}"
    return f"{provenance.machine()}, Python {platform.python_version()}, {versions}"


def timed_render(scene: mi.Scene, integrator: mi.Integrator, spp: int, seed: int) -> tuple[NDArray[np.float32], float]:
    """The image, and the seconds it took once everything was compiled and prepared."""
    dr.sync_thread()
    start = time.perf_counter()
    image = mi.render(scene, integrator=integrator, spp=spp, seed=seed)
    dr.eval(image)
    dr.sync_thread()
    return np.array(image), time.perf_counter() - start
