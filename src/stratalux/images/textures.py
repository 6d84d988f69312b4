"""Image files as textures: pixels of the file's own type, under the curve that the file has them in.

What Mitsuba's ``bitmap`` makes of them (``raw``, ``format``, one channel or three) is left to it; the values are those
that its own reader gives for sound files. That one is not asked, as damaged files end the process that it runs in.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import radiance
from .reader import Reader
from .reading import (
    WHOLE,
    codes,
    default_memory,
    on_one_line,
    read_radiance,
    read_stored,
    repair_image,
    to_linear,
)


@dataclass
class Texture:
    """``pixels`` (H, W, C), one channel or three: uint8 or uint16 under the ``srgb`` curve, or linear Rec. 709 of type
    float16 or float32. ``said``: what was chosen, left out, converted or repaired on the way, a line each."""

    pixels: NDArray[Any]
    srgb: bool
    said: list[str] = field(default_factory=list)


def read_texture(path: str | Path, max_memory: int | None = None, reader: Reader | None = None) -> Texture:
    """Read an image file of any kind that :func:`.reading.read_image` reads, with its parameters and errors.

    Windows, layers and chromaticities count as there. Orientations do not: coordinates are those of the rows as stored.
    Integers are taken for sRGB, as Mitsuba does, whatever colour space the file names.
    """
    path = Path(path)
    most = default_memory() if max_memory is None else max_memory
    with on_one_line(path), nullcontext(reader) if reader is not None else Reader() as process:
        if radiance.is_radiance(path):
            image = read_radiance(path, most, process)
            return Texture(image.pixels, False, image.said)
        image, part, choice = read_stored(path, most, process)
    kind = part["types"][choice.channels[0]]
    if kind in WHOLE and not choice.chroma:
        if str(part["attributes"].get("oiio:ColorSpace", "")).startswith("lin_"):
            image.said.append("says that it is linear, and is taken for sRGB unless raw")
        return Texture(codes(image.pixels, kind), True, image.said)
    to_linear(image, choice, None, part["attributes"].get("chromaticities"))
    repair_image(image)
    pixels = image.pixels.astype(np.float16) if kind == "half" else image.pixels
    return Texture(pixels, False, image.said)
