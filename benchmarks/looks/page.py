"""The table of ``docs/looks.md``, on standard output: ``python -m benchmarks.looks.page RESULTS.json``."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

MOST_FLAT, MOST_FLIP = 0.01, 0.12
"""Differences that need no reason: of base colours and normals, and HDR-FLIP of pictures."""

MORE_THAN_ONCE = "Blender adds what rough surfaces scatter more than once, glTF does not"
APART = "facets hide each other as in glTF, in Cycles less"
REASONS = {
    "AnisotropyStrengthTest.glb": "ours stretches α from r² to r² + (1 − r²) s² as glTF says, Blender by 1 − 0.9 s; "
    f"{MORE_THAN_ONCE}; {APART} (with all of Cycles' ways, 0.11)",
    "Duck.glb": MORE_THAN_ONCE,
    "fuze.obj": f"{MORE_THAN_ONCE}; {APART} (with Cycles' way, 0.08)",
    "fuze.ply": "Blender reads neither the texture that a comment names, nor does it smooth what has no normals",
    "geometry-camera-light.glb": f"a metal of roughness 1: {MORE_THAN_ONCE}",
    "simple-instancing.glb": f"a metal of roughness 1: {MORE_THAN_ONCE}; {APART} "
    "(with Cycles' way, 0.04, and as bright)",
}


def table(results: dict[str, Any]) -> str:
    """Markdown; a reason for each file that needs one. Raises :class:`KeyError` for a file that has none."""
    lines = [
        "| file | base colour | normals | rims | HDR-FLIP | scattered once | brightness | what differs |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in results["files"]:
        if "error" in row:
            lines.append(f"| {row['file']} | | | | | | | Blender does not read it: {row['error'].split(': ')[-1]} |")
            continue
        far = max(row["base"], row["normals"]) > MOST_FLAT or row["flip"] > MOST_FLIP
        keys = ("base", "normals", "coverage", "flip", "single")
        numbers = " | ".join("" if math.isnan(row[key]) else f"{row[key]:.3f}" for key in keys)
        lines.append(f"| {row['file']} | {numbers} | {row['ratio']:.2f} | {REASONS[row['file']] if far else ''} |")
    return "\n".join(lines)


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit("usage: python -m benchmarks.looks.page RESULTS.json")
    print(table(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))))


if __name__ == "__main__":
    main()
