"""Where figures come from: the machine and the versions of everything that matters for them."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ..errors import InputError

PACKAGES = ("stratalux", "mitsuba", "drjit", "numpy", "flip-evaluator", "matplotlib")


def versions() -> dict[str, str | None]:
    """Versions by name, None for what is not installed."""
    found: dict[str, str | None] = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = None
    return found


def machine(gpu: bool = False) -> str:
    """One line: processor, cores that this process may use, system, and with ``gpu`` the graphics card."""
    cpu = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        cpu = next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return ", ".join([cpu, f"{cores} core(s)", f"{platform.system()} {platform.machine()}", *_gpus(gpu)])


def check_machine(wanted: str, gpu: bool = False) -> None:
    """Raise :class:`InputError` where this worker of a cluster is another :func:`machine` than the ``wanted`` one."""
    if (own := machine(gpu)) != wanted:
        raise InputError(
            f"cluster: a worker is another machine ({own}) than this one ({wanted}), and times are compared; use alike"
        )


def _gpus(wanted: bool) -> list[str]:
    if not wanted:
        return []
    command = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=20, check=True).stdout
    except (OSError, subprocess.SubprocessError):
        return ["GPU unknown"]
    # Dr.Jit renders on the first card.
    return [", driver ".join(part.strip() for part in answer.splitlines()[0].split(","))] if answer.strip() else []
