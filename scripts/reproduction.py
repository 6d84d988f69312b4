"""Write docs/reproduction.md and its pictures from a reproduction: python -m scripts.reproduction FOLDER."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from stratalux.images.files import write_atomically
from stratalux.reproduce import figure2
from stratalux.reproduce.settings import Settings

ROOT = Path(__file__).parents[1]
DOCUMENT = ROOT / "docs" / "reproduction.md"
PICTURES = ROOT / "docs" / "reproduction"
WIDTH = 1200
"""Of the pictures at least, in pixels: small ones are enlarged."""
RED = (220, 30, 30)
BUDDHA = (0.33, 0.02, 0.67, 0.98)
"""Left, top, right, bottom of the Buddha, parts of the image."""

TEXT = """# The paper, computed again

`stratalux reproduce` computes the figures and numbers of the paper again, on its own data, and says which of its claims
hold. Below is what it found on {machine}, {date}, in a **{size} run** ({command}).{warning}

- **Scenes.** Grace Cathedral, turned by 180 degrees about x to be upright, as bright as gives open ground (reflectance
  0.4) a luminance of 0.2. The object stands on a matte ground. The Buddha has 100,000 triangles, the paper's had more
  than a million; the timings also use one subdivided.
- **Camera rays.** They are fixed: one through the middle of each pixel (2x2 for figure 2), the same for all techniques
  and for the reference. So an error is one of the lighting, and not of the edges of the object.
- **Techniques.** All properties are written out, with BSDF samples off. Importance sampling draws (0, 2)-points.
- **References.** The paper's: importance sampling with 10,000 samples per shading point in a full run.
- **Verdicts.** Where the paper has only a picture, a measure and a threshold stand for the claim; report.html states
  them claim by claim. *holds*: for every seed and every case; *partly*: in the median, or in some of the cases.
- **Seconds.** Of the kernels, medians of rounds in which the sides take turns; compilation and preparation are apart.
"""

FINDINGS = {
    "fig1": ("![64 regions](reproduction/fig1.jpg)",),
    "fig2": (
        "![the teapot](reproduction/fig2.jpg)",
        "From left to right: structured, structured with jitter, stratified with M = 1, reference; 16 above, 32 below.",
        "![the red square](reproduction/fig2-squares.jpg)",
    ),
    "fig3": (
        "From left to right: importance sampling, stratified sampling, reference, and the share of the bright light "
        "that is hidden.",
        "![Buddha, 16 samples](reproduction/fig3.jpg)",
    ),
    "fig4": (),
    "fig5": (
        "From left to right: structured with 32 lights, stratified with N = 32 and M = 1, with M = 50, reference.",
        "![glossy Buddha](reproduction/fig5.jpg)",
    ),
    "timings": (),
}


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit(str(__doc__))
    folder = Path(sys.argv[1])
    if not (folder / "claims.json").is_file():
        sys.exit(f"{folder}: holds no reproduction; make one with stratalux reproduce -o {folder}")
    mi.set_variant("llvm_ad_rgb")
    claims = json.loads((folder / "claims.json").read_text(encoding="utf-8"))
    results = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    PICTURES.mkdir(parents=True, exist_ok=True)
    draw(folder / "images", claims["settings"])
    write_atomically(DOCUMENT, lambda name: Path(name).write_text(document(claims, results), encoding="utf-8"))


def document(claims: dict[str, Any], results: dict[str, Any]) -> str:
    size = claims["settings"]["name"]
    text = [
        TEXT.format(
            machine=claims["machine"],
            date=claims["date"][:10],
            size=size,
            command=f"`stratalux reproduce{'' if size == 'full' else ' --quick'}`",
            warning="" if size == "full" else " Its small images and few samples make its verdicts less certain.",
        )
    ]
    for section in claims["sections"]:
        text.append(f"\n## {section['title']}\n")
        text += [f"{part}\n" for part in FINDINGS[section["anchor"]]]
        rows = [
            [claim["text"], claim["theirs"], claim["ours"], f"**{claim['verdict']}**"] for claim in section["claims"]
        ]
        text.append(table(["claim", "paper", "here", ""], rows))
        if section["anchor"] == "fig4":
            text += [described(found) for found in results["tables"] if found["title"].startswith("RMS error")]
        if section["anchor"] == "timings":
            wanted = ("Render time", "What a light sample")
            text += [described(found) for found in results["tables"] if found["title"].startswith(wanted)]
            text += [heat_map(found) for found in results["heat_maps"]]
    return "\n".join(text)


def table(header: list[str], rows: list[list[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def described(found: dict[str, Any]) -> str:
    return (
        f"**{found['title']}**\n\n"
        + table(found["header"], found["rows"])
        + (f"\n{found['text']}\n" if found["text"] else "")
    )


def heat_map(found: dict[str, Any]) -> str:
    """The best cell in bold."""
    best = min(value for row in found["values"] for value in row if value is not None)
    cells = [
        [name, *("-" if v is None else f"**{v:.2g}**" if v == best else f"{v:.2g}" for v in row)]
        for name, row in zip(found["rows"], found["values"], strict=True)
    ]
    header = [f"{found['y_label']} \\ {found['x_label']}", *found["columns"]]
    return f"**{found['title']}**\n\n" + table(header, cells)


def draw(images: Path, settings: dict[str, Any]) -> None:
    save("fig1", read(images, "fig1-*"))
    whole = read(images, "fig2-teapot-*")
    sizes = {key: tuple(value) if isinstance(value, list) else value for key, value in settings.items()}
    left, top, right, bottom = figure2.frames(Settings(**sizes))[1].crop or (0, 0, 0, 0)
    for x in (left, right - 1):
        whole[top:bottom, x] = RED
    for y in (top, bottom - 1):
        whole[y, left:right] = RED
    save("fig2", whole)
    squares = [
        [
            read(images, f"fig2-the-red-square-{rate}-*-{name}.png")
            for name in (
                f"structured-{rate}-lights",
                f"structured-{rate}-lights-jittered",
                f"stratified-n-{rate}-m-1",
                "reference",
            )
        ]
        for rate in figure2.RATES
    ]
    save("fig2-squares", np.concatenate([np.concatenate(row, axis=1) for row in squares]))
    save("fig3", strip(images, ("fig3-*importance*", "fig3-*stratified*", "fig3-*reference", "fig3-occlusion-*")))
    save("fig5", strip(images, ("fig5-*-lights", "fig5-*-m-1", "fig5-*-m-50", "fig5-*reference")))


def strip(images: Path, patterns: tuple[str, ...]) -> NDArray[np.uint8]:
    """The Buddha in several pictures, side by side."""
    parts = []
    for pattern in patterns:
        picture = read(images, pattern)
        height, width, _ = picture.shape
        left, top, right, bottom = (round(part * n) for part, n in zip(BUDDHA, (width, height) * 2, strict=True))
        parts.append(picture[top:bottom, left:right])
    return np.concatenate(parts, axis=1)


def read(images: Path, pattern: str) -> NDArray[np.uint8]:
    """The one picture (H, W, 3) whose name fits."""
    (path,) = images.glob(pattern if pattern.endswith(".png") else f"{pattern}.png")
    return np.array(mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, True))


def save(name: str, pixels: NDArray[np.uint8]) -> None:
    zoom = max(1, WIDTH // pixels.shape[1])
    pixels = np.repeat(np.repeat(pixels, zoom, axis=0), zoom, axis=1)
    write_atomically(PICTURES / f"{name}.jpg", lambda path: mi.Bitmap(pixels).write(path, quality=85))
    print(name, flush=True)


if __name__ == "__main__":
    main()
