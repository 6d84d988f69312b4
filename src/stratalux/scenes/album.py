"""Images of many materials in one array on the device, of four bytes a texel, read by several processes at once."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..images.colour import decode
from ..images.reader import Reader
from ..images.reading import default_memory
from ..images.room import Room
from ..images.texels import Found, Texels, look_at
from .model import Picture

_READERS = 4
_MOST = 1 << 32
"""Texels that an index can tell apart."""


@dataclass(frozen=True)
class Place:
    """Where an image of so many texels begins in the array; see :class:`.Texels` for the others."""

    start: int
    width: int
    height: int
    channels: int
    srgb: bool


class Album:
    """The texels of those of the `pictures` that have 8 bits and can be read; `warn` is told of those that cannot.

    `texels`: of all of them, row by row, red, green, blue and alpha from the lowest byte up. `curves`: what the 256
    codes mean, as they are and under the curve of sRGB. `lost`: the identities of what could not be read. `file`: what
    messages speak of. `max_memory`: bytes that one image may take in single precision, as for :func:`.look_at`. Raises
    :class:`InputError` if they do not fit into memory together.
    """

    def __init__(
        self, pictures: Sequence[Picture], file: Path, max_memory: int | None, warn: Callable[[str], None]
    ) -> None:
        self._pictures = list(pictures)  # so that no other gets the identity of one
        self._places: dict[int, Place] = {}
        self.lost: set[int] = set()
        self.curves = mi.Float(_curves())
        with ExitStack() as stack:
            room = stack.enter_context(Room()) if Room.there() else None
            readers = _Readers(stack, len(pictures), room)
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="stratalux-")))
            paths = [_file(picture, folder / f"texture{n}") for n, picture in enumerate(pictures)]

            def look(reader: Reader, which: int) -> Found:
                return look_at(pictures[which].name, paths[which], reader, max_memory)

            found = readers.all(look, range(len(pictures)))
            taken = [n for n, each in enumerate(found) if isinstance(each, Found) and each.kind == "uint8"]
            ends = np.cumsum([0] + [found[n].size[0] * found[n].size[1] for n in taken], dtype=np.int64).tolist()
            _check(ends[-1], file)
            self._bytes: NDArray[np.uint8] = _memory(4 * ends[-1], room, file).reshape(-1, 4)

            def read(reader: Reader, which: int) -> Place:
                one, start = found[taken[which]], ends[which]
                (width, height), into = one.size, self._bytes[start : ends[which + 1]]
                one.read_rgba(reader, into.reshape(height, width, 4), None if room is None else 4 * start)
                return Place(start, width, height, len(one.channels), one.srgb)

            for n, place in zip(taken, readers.all(read, range(len(taken))), strict=True):
                found[n] = place
        for picture, each in zip(pictures, found, strict=True):
            if isinstance(each, Place):
                self._places[id(picture)] = each
            elif isinstance(each, InputError):
                self.lost.add(id(picture))
                warn(f"{each}; the surface is shown without it")
        # Where arrays of the variant are in the memory of the host, it is this one, and not a copy.
        self.texels = mi.UInt32(self._bytes.reshape(-1).view(np.uint32) if ends[-1] else 0)

    def place(self, picture: Picture) -> Place | None:
        """Where a picture is; None if it is not here."""
        return self._places.get(id(picture))

    def read(self, picture: Picture) -> Texels | None:
        """The texels of a picture, which are not copied; None if it is not here."""
        place = self.place(picture)
        if place is None:
            return None
        pixels = self._bytes[place.start : place.start + place.width * place.height]
        pixels = pixels.reshape(place.height, place.width, 4)
        grey = place.channels < 3
        step, last = (3, place.channels * 3 - 2) if grey else (1, place.channels)
        return Texels(pixels[..., :last:step], place.srgb)


class _Readers:
    """Processes that read so many images at most, into a `room`; they end with the `stack`."""

    def __init__(self, stack: ExitStack, most: int, room: Room | None) -> None:
        count = max(1, min(_READERS, os.cpu_count() or 1, most))
        self._readers = [stack.enter_context(Reader(room)) for _ in range(count)]
        self._pool = stack.enter_context(ThreadPoolExecutor(count))

    def all(self, work: Callable[[Reader, int], Any], items: Sequence[int]) -> list[Any]:
        """What becomes of each item, or the :class:`InputError` that it ends with."""
        count = len(self._readers)

        def share(number: int) -> list[Any]:
            return [_tried(work, self._readers[number], item) for item in items[number::count]]

        shares = list(self._pool.map(share, range(count)))
        return [shares[n % count][n // count] for n in range(len(items))]


def _tried(work: Callable[[Reader, int], Any], reader: Reader, item: int) -> Any:
    try:
        return work(reader, item)
    except InputError as error:
        return error


def _file(picture: Picture, temporary: Path) -> Path:
    """The file of a picture, or a temporary one with its bytes."""
    if picture.data is not None:
        temporary.write_bytes(picture.data)
        return temporary
    assert picture.path is not None
    return picture.path


def _memory(size: int, room: Room | None, file: Path) -> NDArray[np.uint8]:
    """So many bytes, in a room if there is one."""
    try:
        return np.empty(size, np.uint8) if room is None else room.array(size)
    except (MemoryError, OSError):
        raise _too_much(size, file) from None


def _check(texels: int, file: Path) -> None:
    if 4 * texels > default_memory() or texels >= _MOST:
        raise _too_much(4 * texels, file)


def _too_much(size: int, file: Path) -> InputError:
    return InputError(f"{file}: its textures take {size / 1e9:.3g} GB, more than there is room for; make them smaller")


def _curves() -> NDArray[np.float32]:
    plain = np.linspace(0, 1, 256, dtype=np.float32)
    curved = plain[:, None, None].copy()
    decode(curved, "srgb")
    return np.concatenate([plain, curved.ravel()])
