"""Sound files of every kind, and what damage may make of them: always the same of the same number."""

from __future__ import annotations

import random
import re
import struct
import zlib
from pathlib import Path

import numpy as np

from stratalux.images.reading import SUFFIXES
from tests.images.make import COMPRESSIONS, card, exr, hdr, rgbe, spec, write, write_deep, write_parts

_SIZES = (0, 1, 2, 3, 15, 255, 1000, 5000, 20_000, 65_535, 1 << 20, 1 << 30, (1 << 31) - 1, (1 << 32) - 1)
_FIELDS = (b"dataWindow", b"displayWindow", b"tiles", b"channels", b"compression", b"chunkCount", b"version", b"envmap")
_NUMBER = re.compile(rb"[+-]?\d+(\.\d+)?")


def sound_files(folder: Path) -> dict[str, bytes]:
    """Small files of every kind that is read, by name."""
    folder.mkdir(exist_ok=True)
    pixels = card(16, 24)
    share = pixels / 8
    for kind in ("half", "float"):
        for compression in COMPRESSIONS:
            for tile, end in ((0, ""), (16, "-tiled")):
                path = folder / f"{compression}-{kind}{end}.exr"
                write(path, pixels, type=kind, compression=compression, tile=tile)
    for suffix in (*SUFFIXES[1:], ".jxl", ".gif", ".dpx", ".sgi", ".rla", ".fits", ".ico"):
        for kind in ("uint8", "uint16", "float"):
            write(folder / f"{kind}{suffix}", share, type=kind)
    for compression in ("none", "lzw", "zip", "packbits"):
        write(folder / f"{compression}.tif", share, type="uint8", compression=compression)
        write(folder / f"{compression}-tiled.tif", share, type="half", compression=compression, tile=16)
    write(folder / "windows.exr", pixels, at=(-4, -2), display=(0, 0, 16, 8))
    depth = spec(pixels[..., :1], ["Z"], name="depth")
    write_parts(folder / "parts.exr", [depth, spec(pixels, name="rgba")], [pixels[..., :1], pixels])
    write_deep(folder / "deep.exr")
    names = [f"Image.{c}" for c in "RGB"]
    write(folder / "layer.exr", pixels, names=names, chromaticities=(0.7, 0.3, 0.2, 0.8, 0.1, 0.05, 0.32, 0.34))
    chroma = np.full((8, 12), 0.5, dtype=np.float16)
    made = {
        "chroma.exr": exr({"Y": pixels[..., 0].astype(np.float16), "RY": chroma, "BY": chroma}, {"RY": 2, "BY": 2}),
        "integers.exr": exr({c: np.ones((16, 24), dtype=np.uint32) for c in "RGB"}),
        "cube.exr": exr({c: np.ones((24, 4), dtype=np.float32) for c in "RGB"}, envmap=("envmap", b"\1")),
    }
    lines = ["EXPOSURE=2", "COLORCORR=1 2 3", "GAMMA=2.2", "PRIMARIES=0.7 0.3 0.2 0.8 0.1 0.05 0.32 0.34"]
    for runs in ("new", "old", "flat"):
        made[f"{runs}.hdr"] = hdr(rgbe(pixels), lines, "+X -Y", runs)
        made[f"{runs}-xyz.hdr"] = hdr(rgbe(pixels), ["FORMAT=32-bit_rle_xyze"], runs=runs)
    return {**{path.name: path.read_bytes() for path in sorted(folder.iterdir())}, **made}


def damaged(content: bytes, number: int) -> bytes:
    """One of many ways to damage ``content``."""
    chance = random.Random(number)
    kind = chance.random()
    if kind < 0.15:
        return content[: chance.randrange(len(content))]
    if kind < 0.4 and content.startswith(b"v/1\x01"):
        return _with_other_fields(content, chance)
    if kind < 0.4 and content.startswith((b"#?", b"PF", b"Pf", b"P6")):
        return _with_other_numbers(content, chance)
    if kind < 0.4 and content.startswith(b"\x89PNG"):
        return _with_another_size(content, chance)
    if kind < 0.45:
        return bytes(chance.randrange(256) for _ in range(chance.randrange(2000)))
    out = bytearray(content)
    for _ in range(chance.choice((1, 1, 2, 4, 16))):
        at = chance.randrange(len(out) if chance.random() < 0.5 else min(len(out), 400))
        how = chance.random()
        if how < 0.4:
            out[at] ^= 1 << chance.randrange(8)
        elif how < 0.7:
            out[at] = chance.randrange(256)
        elif how < 0.9:
            size = struct.pack(chance.choice("<>") + "I", chance.choice(_SIZES))
            out[at : at + 4] = size
        else:
            out[at:at] = bytes(chance.randrange(256) for _ in range(chance.randrange(1, 64)))
    return bytes(out)


def _with_other_fields(content: bytes, chance: random.Random) -> bytes:
    """Numbers in the header of OpenEXR."""
    out = bytearray(content)
    for _ in range(chance.choice((1, 1, 2, 3))):
        place = out.find(chance.choice(_FIELDS) + b"\0")
        if place < 0:
            continue
        value = out.find(b"\0", out.find(b"\0", place) + 1) + 5
        at = value + chance.choice((0, 4, 8, 12, 16, chance.randrange(24)))
        out[at : at + 4] = struct.pack("<i", chance.choice((chance.choice(_SIZES[:-1]), -chance.choice(_SIZES[:-1]))))
    return bytes(out)


def _with_other_numbers(content: bytes, chance: random.Random) -> bytes:
    """Numbers in a header that is text."""
    places = list(_NUMBER.finditer(content[:200]))
    place = chance.choice(places)
    other = chance.choice((*(str(size) for size in _SIZES), "-1", "nan", "inf", "1e400", "0.0", "x", ""))
    return content[: place.start()] + other.encode() + content[place.end() :]


def _with_another_size(content: bytes, chance: random.Random) -> bytes:
    """The size that a PNG says it has, with a checksum that is right."""
    out = bytearray(content)
    at = chance.choice((16, 20))
    out[at : at + 4] = struct.pack(">I", chance.choice(_SIZES))
    out[29:33] = struct.pack(">I", zlib.crc32(out[12:29]))
    return bytes(out)
