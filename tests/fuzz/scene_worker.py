"""Renders damaged scenes one after the other, and prints for each its number, and what has gone wrong, if anything.

python -m tests.fuzz.scene_worker FOLDER FIRST LAST: those with the numbers from FIRST to LAST, less one.
"""

from __future__ import annotations

import gc
import os
import resource
import sys
import tempfile
import warnings
from pathlib import Path

import mitsuba as mi
import numpy as np

from stratalux.cli import main as command
from tests.fuzz.scenes import damaged_scene, make_files
from tests.variants import RGB

MOST = 1 << 31
"""Bytes of memory."""


def main(folder: Path, first: int, last: int) -> None:
    mi.set_variant(RGB)
    make_files(folder)
    os.chdir(folder)
    told = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # some plugins of Mitsuba print there
    print("begun", file=told, flush=True)
    gc.collect()
    gc.freeze()  # what is imported
    for number in range(first, last):
        gc.collect()  # kernels are compiled for all scenes that live
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        Path("scene.xml").write_bytes(damaged_scene(number))
        found = wrong()
        more = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024
        if not found and more > MOST:
            found = f"took {more} bytes"
        print(number, found, file=told, flush=True)


def wrong() -> str:
    """What has gone wrong; nothing if the scene is rendered, or refused in one line."""
    Path("out.exr").unlink(missing_ok=True)
    code, said = _render()
    errors = [line for line in said.splitlines() if not line.startswith("stratalux: warning: ")]
    if code == 0:
        if errors:
            return f"said more than warnings: {errors[:3]}"
        pixels = np.array(mi.Bitmap("out.exr"))
        return "" if np.isfinite(pixels).all() or "not finite numbers" in said else "pixels that are not finite"
    if code == 2:
        if len(errors) != 1 or not errors[0].startswith("stratalux: error: "):
            return f"said in more than a line: {errors[:3]}"
        return "left a file" if Path("out.exr").exists() else ""
    return f"exit code {code}: {errors[-1:]}"


def _render() -> tuple[int, str]:
    """The exit code of the command, and all that it says on standard error."""
    sys.argv = ["stratalux", "render", "scene.xml", "--size", "8x8", "--spp", "1", "-o", "out.exr", "-q"]
    kept = os.dup(2)
    with tempfile.TemporaryFile() as said, warnings.catch_warnings():
        warnings.simplefilter("always")
        sys.stderr.flush()
        os.dup2(said.fileno(), 2)
        try:
            command()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
        finally:
            sys.stderr.flush()
            os.dup2(kept, 2)
            os.close(kept)
        said.seek(0)
        return code, said.read().decode(errors="replace")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
