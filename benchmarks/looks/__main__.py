"""Files as Blender's Cycles shows them, and as we do: ``python -m benchmarks.looks --blender-python PYTHON``.

Direct light of a map at the first surface, through the same camera, for each model of the assets that Blender reads.
Writes ``results.json``, ``sheet.png`` and ``sheet.jpg`` (Cycles, ours, FLIP), and the arrays of each file. Needs the
extra ``compare``, and an interpreter with ``bpy`` 4.4.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from stratalux import InputError
from stratalux.rendering.variants import choose_variant

FORMATS = (".glb", ".gltf", ".obj", ".ply", ".stl")


def main() -> None:
    parser = argparse.ArgumentParser(prog="benchmarks.looks", description=__doc__.split("\n\n")[0])
    parser.add_argument("--blender-python", required=True, metavar="PYTHON", help="an interpreter that has bpy")
    parser.add_argument("--assets", type=Path, default=Path("../shared/assets"), help="folder of models/ and envmaps/")
    parser.add_argument("--map", default="envmaps/studio.hdr", help="of the assets")
    parser.add_argument("--only", default="", help="a part of the names of the files")
    parser.add_argument("--width", type=int, default=180, help="of the pictures in pixels; they are 3:2")
    parser.add_argument("--spp", type=int, default=128, help="of Cycles; ours has four times as many")
    parser.add_argument("--threads", type=int, default=2, help="of Cycles")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/looks"))
    given = parser.parse_args()
    try:
        compared(given)
    except InputError as error:
        sys.exit(f"benchmarks.looks: error: {error}")


def compared(given: argparse.Namespace) -> None:
    """Render, measure and write what ``given`` asks for."""
    choose_variant()
    from .measure import differences
    from .ours import render
    from .process import FLAT, BlenderError, Cycles
    from .sheet import sheet

    size = (given.width, given.width * 2 // 3)
    environment = given.assets / given.map
    files = sorted(path for path in (given.assets / "models").rglob("*") if path.suffix.lower() in FORMATS)
    files = [path for path in files if given.only.lower() in path.name.lower()]
    if not files:
        raise InputError(f"{given.assets}/models: no file that Blender reads")
    given.output.mkdir(parents=True, exist_ok=True)
    results = given.output / "results.json"
    known: dict[str, dict[str, Any]] = {}
    if results.exists():  # of other files, from runs before
        known = {row["file"]: row for row in json.loads(results.read_text(encoding="utf-8"))["files"]}
    with tempfile.TemporaryDirectory(prefix="stratalux-") as folder:
        cycles = Cycles(given.blender_python, Path(folder), given.spp, given.threads)
        for file in files:
            start = time.perf_counter()
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                ours, view = render(file, environment, size, 4 * given.spp, FLAT * given.spp)
            row: dict[str, Any] = {"file": file.name, "told": [str(each.message) for each in told]}
            try:
                theirs, row["blender"] = cycles.render(file, view, environment)
            except BlenderError as error:
                row["error"] = str(error)
            else:
                row |= differences(ours, theirs)
                arrays = {f"ours_{key}": value for key, value in vars(ours).items() if value is not None}
                arrays |= {f"cycles_{key}": value for key, value in vars(theirs).items() if value is not None}
                np.savez_compressed(given.output / f"{file.name}.npz", **arrays)
            keys = ("base", "normals", "flip", "single", "ratio")
            numbers = "  ".join(f"{key} {row[key]:.3f}" for key in keys if key in row)
            print(f"{file.name:32} {time.perf_counter() - start:5.1f} s  {row.get('error', numbers)}", flush=True)
            known[file.name] = row
            settings = {"map": environment.name, "size": size, "spp": given.spp}
            rows = [known[name] for name in sorted(known)]
            results.write_text(json.dumps({**settings, "files": rows}, indent=1), encoding="utf-8")
    if shown := [name for name in sorted(known) if "error" not in known[name]]:
        sheet(given.output, shown)


if __name__ == "__main__":
    main()
