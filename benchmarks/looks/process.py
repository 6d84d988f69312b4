"""Cycles, through a Python that has Blender (`bpy`): runs :mod:`.blender` in a process of its own."""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .ours import Passes, View

WORKER = Path(__file__).with_name("blender.py")
FLAT = 2
"""Times the samples of pictures, for base colours and normals: details finer than pixels are to be seen alike."""


class BlenderError(Exception):
    """Blender has not rendered a file; the message is one line."""


@dataclass(frozen=True)
class Cycles:
    """Renders with ``spp`` samples a pixel on ``threads`` threads; ``folder`` is for what is passed on."""

    python: str
    folder: Path
    spp: int
    threads: int

    def render(self, file: Path, view: View, environment: Path) -> tuple[Passes, str]:
        """The passes of a file, and the version of Blender. Raises :class:`BlenderError`."""
        output = self.folder / "cycles.npz"
        output.unlink(missing_ok=True)
        job = {
            "file": str(file.resolve()),
            "map": str(environment.resolve()),
            "camera": z_up(view.matrix).tolist(),
            "angle": view.angle,
            "clip": view.clip,
            "size": view.size,
            "spp": self.spp,
            "flat_spp": FLAT * self.spp,
            "threads": self.threads,
            "output": str(output.resolve()),
        }
        written = self.folder / "job.json"
        written.write_text(json.dumps(job), encoding="utf-8")
        ended = subprocess.run([self.python, str(WORKER), str(written)], capture_output=True, text=True, check=False)
        if not output.exists():
            said = [line.strip() for line in (ended.stdout + ended.stderr).splitlines() if line.strip()]
            raise BlenderError(said[-1] if said else f"Blender ended with status {ended.returncode}")
        with np.load(output) as stored:
            single = stored["single"] if "single" in stored.files else None
            passes = Passes(stored["picture"], stored["base"], stored["normals"], stored["coverage"], single)
            return passes, str(stored["version"])


def z_up(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """A camera of Mitsuba (left, up, forward; y up) as one of Blender (right, up, backward; z up)."""
    turn = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    return turn @ matrix @ np.diag([-1.0, 1, -1, 1])
