"""The table of ``docs/looks.md`` from ``results.json``: ``python -m benchmarks.looks.page FILE``."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

MOST_FLAT, MOST_FLIP = 0.01, 0.12
"""Differences that need no reason: of base colours and normals, and HDR-FLIP of pictures."""

MORE_THAN_ONCE = "Blender adds what rough surfaces scatter more than once, glTF does not"
ROUGH_METAL = f"{MORE_THAN_ONCE}: what has no material is white metal of roughness 1, and loses most by that"
DETAIL = "details finer than a pixel, sampled at other places"
REASONS = {
    "AlphaBlendModeTest.glb": f"{DETAIL}: stripes behind masks",
    "AnisotropyStrengthTest.glb": "ours stretches α from r² to r² + (1 − r²) s² as glTF says, Blender by 1 − 0.9 s, "
    f"which keeps r = 0 a mirror; {MORE_THAN_ONCE}",
    "AttenuationTest.glb": "the clear row is thin glass, of which Blender makes solid glass: black after one bounce",
    "ClearCoatTest.glb": f"{DETAIL}; the normals of a coat are not shown (told by a warning)",
    "Duck.glb": MORE_THAN_ONCE,
    "FlightHelmet.gltf": f"{DETAIL}; its glasses are thin",
    "Fox.glb": "Blender shows the first picture of an animation, ours the pose that the file rests in",
    "fuze.obj": "its gloss is Phong's, which each translates in its own way",
    "fuze.ply": "Blender's importer leaves the texture out that a comment of the file names",
    "geometry-camera-light.glb": ROUGH_METAL,
    "NormalTangentTest.glb": DETAIL,
    "PBR_Spheres.glb": MORE_THAN_ONCE,
    "simple-instancing.glb": ROUGH_METAL,
    "SpecularTest.glb": "colours of reflections are not shown (told by a warning)",
    "SunglassesKhronos.glb": "the lenses are thin glass, of which Blender makes solid glass: black after one bounce",
    "TransmissionRoughnessTest.glb": "thin glass, of which Blender makes solid glass: black after one bounce",
}


def table(results: dict[str, Any]) -> str:
    """Markdown; a reason for each file that needs one. Raises :class:`KeyError` for a file that has none."""
    lines = [
        "| file | base colour | normals | rims | HDR-FLIP | scattered once | brightness | what differs |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in sorted(results["files"], key=lambda row: str(row["file"]).lower()):
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
