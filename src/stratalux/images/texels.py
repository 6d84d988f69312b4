"""The numbers of an image as its file has them, for the textures of models: all channels, nothing is converted.

Rows are as stored: coordinates do not follow what a file says of its orientation (glTF 2.0, section 3.8).
"""

from __future__ import annotations

import tempfile
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .reader import Reader
from .reading import WHOLE, check_size, codes, default_memory, on_one_line


@dataclass(frozen=True)
class Texels:
    """`pixels` (H, W, C): uint8 or uint16 codes, or float32. C is 1 (grey), 2 (with alpha), 3 (RGB) or 4 (RGBA).

    `srgb`: whether the file says, or its kind is known to mean, that colours are coded by the curve of sRGB.
    """

    pixels: NDArray[Any]
    srgb: bool

    @property
    def channels(self) -> int:
        """How many there are."""
        return int(self.pixels.shape[2])

    def channel(self, name: str) -> NDArray[Any]:
        """One of "r", "g", "b" and "a", (H, W): a grey image has the same in each, and alpha is full without one."""
        if name == "a":
            if self.channels in (2, 4):
                return self.pixels[..., -1]
            kind = self.pixels.dtype
            return np.full(self.pixels.shape[:2], 1 if kind.kind == "f" else np.iinfo(kind).max, kind)
        return self.pixels[..., "rgb".index(name) if self.channels >= 3 else 0]

    def colours(self) -> NDArray[Any]:
        """Red, green and blue (H, W, 3)."""
        if self.channels >= 3:
            return self.pixels[..., :3]
        return np.repeat(self.pixels[..., :1], 3, axis=2)


def read_texels(name: str, source: Path | bytes, max_memory: int | None = None, reader: Reader | None = None) -> Texels:
    """Read an image file, or the bytes of one.

    `name`: what messages call it. `max_memory`: bytes that its pixels may take in single precision; half of what the
    machine has unless given. `reader`: one to be used for several files. Raises :class:`InputError` with one line if
    the file is missing, damaged, too large or not an image.
    """
    most = default_memory() if max_memory is None else max_memory
    with tempfile.TemporaryDirectory(prefix="stratalux-") as folder:
        if isinstance(source, bytes):
            path = Path(folder) / "texture"
            path.write_bytes(source)
        else:
            path = source
        try:
            with on_one_line(path, name), nullcontext(reader) if reader is not None else Reader() as process:
                return _read(path, name, most, process)
        except InputError as error:
            raise InputError(str(error).replace(str(path), name)) from None


def _read(path: Path, name: str, most: int, reader: Reader) -> Texels:
    parts = reader.parts(path)
    if not parts:
        raise InputError(f"{name}: no image in it")
    part = parts[0]
    x, y, width, height = part["data"]
    if min(width, height) < 1 or part["depth"] > 1 or part["deep"]:
        raise InputError(f"{name}: {width}x{height}x{part['depth']} is no size of an image")
    check_size(path, part, (width, height), most)
    channels = _order(part["channels"])
    pixels: NDArray[Any] = reader.pixels(path, part, 0, channels, (x, x + width), (y, y + height))
    kind = part["types"][channels[0]]
    whole = kind in WHOLE
    if whole:
        pixels = codes(pixels, kind)
    elif not np.isfinite(pixels).all():
        raise InputError(f"{name}: a texel is not a finite number; repair the image")
    space = str(part["attributes"].get("oiio:ColorSpace", "")).lower()
    return Texels(pixels, whole and not space.startswith(("lin", "raw", "data")))


def _order(names: list[str]) -> list[int]:
    """The channels red, green, blue and alpha, or grey and alpha, by their places in the file."""
    places = {name.rsplit(".", 1)[-1].upper(): place for place, name in reversed(list(enumerate(names)))}
    for wanted in (("R", "G", "B"), ("Y",), ("I",)):
        if all(one in places for one in wanted):
            return [places[one] for one in (*wanted, *(("A",) if "A" in places else ()))]
    return list(range(len(names)))[: 4 if len(names) >= 4 else len(names)]
