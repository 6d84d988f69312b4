"""The numbers of an image as its file has them, for the textures of models: all channels, nothing is converted.

Rows are as stored: coordinates do not follow what a file says of its orientation (glTF 2.0, section 3.8).
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .reader import Reader
from .reading import WHOLE, check_size, default_memory, on_one_line


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


@dataclass(frozen=True)
class Found:
    """An image file that was looked at, and whose texels are not read yet.

    `size`: width and height. `channels`: places of red, green, blue and alpha, or of grey and alpha, in the file.
    `kind`: of its numbers, "uint8" for instance. `srgb`: see :class:`Texels`.
    """

    name: str
    path: Path
    part: dict[str, Any]
    size: tuple[int, int]
    channels: list[int]
    kind: str
    srgb: bool

    def texels(self, reader: Reader) -> Texels:
        """Read them. Raises :class:`InputError` with one line if the file is damaged."""
        width, height = self.size
        into = np.empty((height, width, len(self.channels)), self.kind) if self.kind in WHOLE else None
        with _called(self.name, self.path):
            pixels = self._read(reader, self.channels, into)
            if into is None and not np.isfinite(pixels).all():
                raise InputError(f"{self.name}: a texel is not a finite number; repair the image")
        return Texels(pixels, self.srgb)

    def read_rgba(self, reader: Reader, into: NDArray[np.uint8], at: int | None = None) -> None:
        """Read what has 8 bits `into` an array (H, W, 4), of red, green, blue and alpha; raises as :meth:`texels`.

        `at`: the byte of the reader's room where that begins, if it is there.
        """
        colours, alpha = self.channels[: 3 if len(self.channels) >= 3 else 1], self.channels[len(self.channels) - 1]
        with _called(self.name, self.path):
            channels = [*(colours if len(colours) == 3 else 3 * colours), None if len(self.channels) % 2 else alpha]
            self._read(reader, channels, into, at)

    def _read(
        self, reader: Reader, channels: Sequence[int | None], into: NDArray[Any] | None, at: int | None = None
    ) -> NDArray[Any]:
        x, y, width, height = self.part["data"]
        return reader.pixels(self.path, self.part, 0, channels, (x, x + width), (y, y + height), into, at)


def look_at(name: str, path: Path, reader: Reader, max_memory: int | None = None) -> Found:
    """Look at an image file. `name`: what messages call it; the others are those of :func:`read_texels`.

    Raises :class:`InputError` with one line if the file is missing, damaged, too large or not an image.
    """
    with _called(name, path):
        parts = reader.parts(path)
        if not parts:
            raise InputError(f"{name}: no image in it")
        part = parts[0]
        _, _, width, height = part["data"]
        if min(width, height) < 1 or part["depth"] > 1 or part["deep"]:
            raise InputError(f"{name}: {width}x{height}x{part['depth']} is no size of an image")
        check_size(path, part, (width, height), default_memory() if max_memory is None else max_memory)
        channels = _order(part["channels"])
        kind = part["types"][channels[0]]
        space = str(part["attributes"].get("oiio:ColorSpace", "")).lower()
        srgb = kind in WHOLE and not space.startswith(("lin", "raw", "data"))
        return Found(name, path, part, (width, height), channels, kind, srgb)


def read_texels(name: str, source: Path | bytes, max_memory: int | None = None, reader: Reader | None = None) -> Texels:
    """Read an image file, or the bytes of one.

    `name`: what messages call it. `max_memory`: bytes that its pixels may take in single precision; half of what the
    machine has unless given. `reader`: one to be used for several files. Raises :class:`InputError` with one line if
    the file is missing, damaged, too large or not an image.
    """
    with _as_file(source) as path, nullcontext(reader) if reader is not None else Reader() as process:
        return look_at(name, path, process, max_memory).texels(process)


@contextmanager
def _as_file(source: Path | bytes) -> Iterator[Path]:
    """A file, or a temporary one with these bytes."""
    if not isinstance(source, bytes):
        yield source
        return
    with tempfile.TemporaryDirectory(prefix="stratalux-") as folder:
        path = Path(folder) / "texture"
        path.write_bytes(source)
        yield path


@contextmanager
def _called(name: str, path: Path) -> Iterator[None]:
    """Whatever goes wrong with a file is an :class:`InputError` of one line that calls it by its `name`."""
    try:
        with on_one_line(path, name):
            yield
    except InputError as error:
        raise InputError(str(error).replace(str(path), name)) from None


def _order(names: list[str]) -> list[int]:
    """The channels red, green, blue and alpha, or grey and alpha, by their places in the file."""
    places = {name.rsplit(".", 1)[-1].upper(): place for place, name in reversed(list(enumerate(names)))}
    for wanted in (("R", "G", "B"), ("Y",), ("I",)):
        if all(one in places for one in wanted):
            return [places[one] for one in (*wanted, *(("A",) if "A" in places else ()))]
    return list(range(len(names)))[: 4 if len(names) >= 4 else len(names)]
