"""Image files as people have them, made from pixels; most of them by OpenImageIO."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

Pixels = NDArray[Any]

LOSSY = ("b44", "b44a", "dwaa", "dwab")
COMPRESSIONS = ("none", "rle", "zips", "zip", "piz", "pxr24", "zstd", "htj2k256", "htj2k32", *LOSSY)
"""Of OpenEXR 3.5."""


def card(height: int = 16, width: int = 32) -> NDArray[np.float32]:
    """Pixels of which no two are alike, exact in half floats; all channels, rows and columns differ."""
    y, x = np.mgrid[:height, :width]
    return np.stack([1 + x / 64 + y / 1024, 2 + y / 32 + x / 1024, 4 - x / 32 + y / 256], axis=2).astype(np.float32)


def write(
    path: Path,
    pixels: Pixels,
    *,
    names: Sequence[str] = (),
    type: str = "float",
    at: tuple[int, int] = (0, 0),
    display: tuple[int, int, int, int] | None = None,
    tile: int = 0,
    **attributes: Any,
) -> Path:
    """One image. ``at``: where the data window begins; ``display``: x, y, width and height of the display window.

    In names of ``attributes``, two underscores stand for a colon.
    """
    return write_parts(path, [spec(pixels, names, type, at, display, tile, **attributes)], [pixels])


def spec(
    pixels: Pixels,
    names: Sequence[str] = (),
    type: str = "float",
    at: tuple[int, int] = (0, 0),
    display: tuple[int, int, int, int] | None = None,
    tile: int = 0,
    **attributes: Any,
) -> oiio.ImageSpec:
    height, width, count = pixels.shape
    made = oiio.ImageSpec(width, height, count, type)
    made.x, made.y = at
    made.full_x, made.full_y, made.full_width, made.full_height = display or (*at, width, height)
    made.tile_width = made.tile_height = tile
    if names:
        made.channelnames = tuple(names)
    for name, value in attributes.items():
        name = name.replace("__", ":")
        if name == "chromaticities":
            made.attribute(name, "float[8]", value)
        else:
            made.attribute(name, value)
    return made


def write_parts(path: Path, specs: Sequence[oiio.ImageSpec], images: Sequence[Pixels]) -> Path:
    """An OpenEXR file of several parts, or any file of one."""
    out = oiio.ImageOutput.create(str(path))
    assert out is not None, oiio.geterror()
    opened = out.open(str(path), tuple(specs)) if len(specs) > 1 else out.open(str(path), specs[0])
    assert opened, out.geterror()
    for number, (part, pixels) in enumerate(zip(specs, images, strict=True)):
        assert number == 0 or out.open(str(path), part, "AppendSubimage"), out.geterror()
        assert out.write_image(np.ascontiguousarray(pixels)), out.geterror()
    out.close()
    return path


def write_deep(path: Path, size: tuple[int, int] = (4, 8)) -> Path:
    """A deep image."""
    height, width = size
    made = oiio.ImageSpec(width, height, 5, "float")
    made.channelnames = ("R", "G", "B", "A", "Z")
    made.deep = True
    data = oiio.DeepData()
    data.init(width * height, 5, (oiio.TypeFloat,) * 5, made.channelnames)
    for pixel in range(width * height):
        data.set_samples(pixel, pixel % 3)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), made) and out.write_deep_image(data), out.geterror()
    out.close()
    return path


def exr(channels: dict[str, Pixels], sampling: dict[str, int] | None = None, **attributes: tuple[str, bytes]) -> bytes:
    """An OpenEXR file without compression, of channels that have fewer pixels than others: one of ``sampling``² each.

    ``attributes``: more of the header, as type and content.
    """
    sampling = sampling or {}
    kinds = {"<u4": 0, "<f2": 1, "<f4": 2}
    names = sorted(channels)
    height, width = max(pixels.shape for pixels in channels.values())
    listed = b"".join(
        name.encode() + struct.pack("<xi4xii", kinds[channels[name].dtype.str], *2 * [sampling.get(name, 1)])
        for name in names
    )
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    header = {
        "channels": ("chlist", listed + b"\0"),
        "compression": ("compression", b"\0"),
        "dataWindow": ("box2i", window),
        "displayWindow": ("box2i", window),
        "lineOrder": ("lineOrder", b"\0"),
        "pixelAspectRatio": ("float", struct.pack("<f", 1)),
        "screenWindowCenter": ("v2f", struct.pack("<2f", 0, 0)),
        "screenWindowWidth": ("float", struct.pack("<f", 1)),
        **attributes,
    }
    begin = struct.pack("<2i", 20000630, 2)
    for name, (kind, content) in header.items():
        begin += name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(content)) + content
    begin += b"\0"
    lines = []
    for y in range(height):
        rows = [channels[name][y // sampling.get(name, 1)] for name in names if y % sampling.get(name, 1) == 0]
        content = b"".join(row.tobytes() for row in rows)
        lines.append(struct.pack("<2i", y, len(content)) + content)
    places = np.cumsum([len(begin) + 8 * height, *map(len, lines)])[:-1]
    return begin + places.astype("<u8").tobytes() + b"".join(lines)


def rgbe(pixels: Pixels) -> NDArray[np.uint8]:
    """Mantissas and exponents (H, W, 4) of Radiance."""
    _, exponent = np.frexp(pixels.max(axis=2))
    mantissas = np.floor(np.ldexp(pixels.astype(np.float64), 8 - exponent[..., None]))
    return np.concatenate([mantissas, exponent[..., None] + 128], axis=2).astype(np.uint8)


def of_rgbe(stored: NDArray[np.uint8]) -> NDArray[np.float32]:
    """What :func:`rgbe` has kept."""
    return np.ldexp(stored[..., :3].astype(np.float32), stored[..., 3:].astype(np.int32) - 136)


def hdr(
    stored: NDArray[np.uint8], lines: Sequence[str] = (), axes: str = "-Y +X", runs: str = "new", end: str = "\n"
) -> bytes:
    """A Radiance picture of ``stored`` rows as they come, with more header ``lines``.

    ``axes``: what rows and columns are. ``runs``: the kind of run lengths, ``new``, ``old`` or ``flat``.
    """
    slow, fast = axes.split()
    rows, columns = stored.shape[:2]
    header = ["#?RADIANCE", "FORMAT=32-bit_rle_rgbe", *lines]
    if any(line.startswith("FORMAT=") for line in lines):
        del header[1]
    text = end.join([*header, "", f"{slow} {rows} {fast} {columns}", ""]).encode()
    return text + {"new": _new_runs, "old": _old_runs, "flat": lambda rows: rows.tobytes()}[runs](stored)


def _new_runs(stored: NDArray[np.uint8]) -> bytes:
    out = bytearray()
    for row in stored:
        out += bytes([2, 2, len(row) >> 8, len(row) & 255])
        for component in row.T:
            begins = [0, *(np.flatnonzero(np.diff(component)) + 1), len(component)]
            for begin, end in pairwise(begins):
                for first in range(begin, end, 127):
                    count = min(127, end - first)
                    out += bytes([128 + count, component[first]]) if count > 1 else bytes([1, component[first]])
    return bytes(out)


def _old_runs(stored: NDArray[np.uint8]) -> bytes:
    """Long runs in two digits, the lower one first."""
    out = bytearray()
    for row in stored:
        begins = [0, *(np.flatnonzero((np.diff(row.astype(int), axis=0) != 0).any(axis=1)) + 1), len(row)]
        for begin, end in pairwise(begins):
            out += row[begin].tobytes()
            more = end - begin - 1
            while more:
                out += bytes([1, 1, 1, more & 255])
                more >>= 8
    return bytes(out)
