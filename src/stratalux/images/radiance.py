"""What the header of a Radiance picture (.hdr) says, and pixels without run lengths, or with those of the old kind.

OpenImageIO decodes the run lengths that nearly all of these files have, and fast, but reads no others, no CIE XYZ, and
leaves exposures, colour corrections and primaries to its callers; so does Mitsuba. The format is that of Ward,
"Radiance file formats", section "Picture file format".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from .colour import to_rec709, xyz_to_rec709

_LONGEST_HEADER = 1 << 20
_RESOLUTION = re.compile(rb"\s*([+-])([XY])\s*(\d{1,9})\s+([+-])([XY])\s*(\d{1,9})\s*")
_EQUAL_ENERGY = (1 / 3, 1 / 3)
"""Radiance's white, and that of XYZ where no primaries are given."""
_EFFICACY = 179.0
"""Lumens to Radiance's watt: Y of CIE XYZ is in lumens."""
_BLOCK = 1 << 16
_NEW_RUNS = range(8, 32768)
"""Lengths of scanlines that can have run lengths of the new kind."""


@dataclass
class Header:
    """``lines`` of ``length`` pixels each, from byte ``start`` of the file on.

    ``turned``: whether lines are columns; ``flipped``: then, whether the picture's rows and its columns are in reverse.
    ``factor``: what to multiply red, green and blue by. ``matrix``: what then makes linear Rec. 709 of them, if they
    are anything else. ``gamma``: the power that makes pixels linear. ``new_runs``: whether they have run lengths of the
    new kind. ``plain``: whether OpenImageIO makes sense of the header. ``said``: what there is to say of it.
    """

    lines: int
    length: int
    start: int
    turned: bool
    flipped: tuple[bool, bool]
    new_runs: bool
    plain: bool = True
    factor: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))
    matrix: NDArray[np.float64] | None = None
    gamma: float = 1.0
    said: list[str] = field(default_factory=list)


def is_radiance(path: Path) -> bool:
    """Whether the file at ``path`` is such a picture, by how it begins."""
    with path.open("rb") as file:
        begin = file.read(4096)
    return begin.startswith((b"#?RADIANCE", b"#?RGBE")) or b"FORMAT=32-bit_rle_" in begin


def read_header(path: Path) -> Header:
    """The header. Raises :class:`ValueError`, which says what is wrong with it."""
    with path.open("rb") as file:
        lines = list(_header_lines(file))
        resolution = file.readline(256)
        found = _RESOLUTION.fullmatch(resolution.rstrip(b"\r\n\0"))
        if found is None or found[2] == found[5]:
            raise ValueError(f"no resolution but {_text(resolution.strip())!r} after the header")
        start = file.tell()
        begin = file.read(4)
    (slow, lines_along, count), (fast, _, length) = found.groups()[:3], found.groups()[3:]
    turned = lines_along == b"X"
    x, y = (slow, fast) if turned else (fast, slow)
    size = int(length)
    runs = len(begin) == 4 and begin[:2] == b"\2\2" and begin[2] < 128 and size in _NEW_RUNS
    header = Header(int(count), size, start, turned, (y == b"+", x == b"-"), runs)
    if header.lines == 0 or header.length == 0:
        raise ValueError("a picture without pixels")
    _follow(header, lines)
    return header


def _header_lines(file: BinaryIO) -> Iterator[bytes]:
    while line := file.readline(_LONGEST_HEADER):
        if not line.rstrip(b"\r\n"):
            return
        if file.tell() > _LONGEST_HEADER:
            break
        yield line.strip()
    raise ValueError("the header does not end")


def _follow(header: Header, lines: list[bytes]) -> None:
    """Do as the lines say."""
    layout, primaries = b"", None
    for line in lines:
        name, _, value = line.partition(b"=")
        if name == b"FORMAT":
            layout = value.strip()
        elif name in (b"EXPOSURE", b"COLORCORR"):
            numbers = _numbers(value)
            if len(numbers) not in (1, 3) or not all(0 < x < np.inf for x in numbers):
                header.said.append(f"{_text(line)} makes no sense, and is left out")
            else:
                header.factor /= numbers
        elif name == b"GAMMA":
            numbers = _numbers(value)
            if len(numbers) != 1 or not 0.01 < numbers[0] < 100:
                header.said.append(f"{_text(line)} makes no sense, and is left out")
            elif numbers[0] != 1:
                header.gamma = numbers[0]
                header.said.append(f"{_text(line)}: pixels are raised to that power")
        elif name == b"PRIMARIES":
            primaries = _numbers(value)
    if layout not in (b"32-bit_rle_rgbe", b"32-bit_rle_xyze", b""):
        raise ValueError(f"FORMAT={_text(layout)} is not one of 32-bit_rle_rgbe and 32-bit_rle_xyze")
    xyz = layout == b"32-bit_rle_xyze"
    header.plain = layout == b"32-bit_rle_rgbe" and bool(lines) and lines[0].startswith((b"#?RADIANCE", b"#?RGBE"))
    if not np.isfinite(header.factor).all():
        raise ValueError("its EXPOSURE lines have no finite product")
    _set_matrix(header, primaries, xyz)
    if header.factor.min() != 1 or header.factor.max() != 1:
        divisors = list(dict.fromkeys(f"{x:g}" for x in 1 / header.factor))
        header.said.append(f"divided by its EXPOSURE and COLORCORR, {' '.join(divisors)}")
    if xyz:
        header.factor /= _EFFICACY


def _set_matrix(header: Header, primaries: list[float] | None, xyz: bool) -> None:
    white = _EQUAL_ENERGY
    if primaries is not None and any(primaries):  # Photoshop writes eight zeros
        try:
            header.matrix = to_rec709(primaries)
            white = primaries[6], primaries[7]
            if header.matrix is not None and not xyz:
                header.said.append("its PRIMARIES are converted to those of Rec. 709")
        except ValueError:
            header.said.append("its PRIMARIES make no sense, and are left out")
    if xyz:
        header.matrix = xyz_to_rec709(white)
        header.said.append(f"CIE XYZ is converted to Rec. 709, {_EFFICACY:g} lm to the watt")


def _numbers(text: bytes) -> list[float]:
    try:
        return [float(number) for number in text.split()]
    except ValueError:
        return []


def _text(line: bytes) -> str:
    return "".join(c if c.isprintable() else "?" for c in line[:60].decode("latin-1"))


def least_bytes(header: Header) -> int:
    """That the pixels of a whole file take, at least."""
    if header.new_runs:
        return header.lines * (4 + 4 * 2 * -(-header.length // 127))
    return 8  # a pixel, and how often it is repeated


def read_old(path: Path, header: Header) -> NDArray[np.float32]:
    """Pixels (lines, length, 3) that are flat or have run lengths of the old kind: a pixel of mantissas 1, 1, 1 stands
    for so many more of the one before as its exponent says, in digits to the base of 256 if there are several.

    Raises :class:`ValueError` if there are not enough.
    """
    with path.open("rb") as file:
        file.seek(header.start)
        data = np.frombuffer(file.read(), dtype=np.uint8)
    stored = data[: len(data) // 4 * 4].reshape(-1, 4)
    repeats = (stored[:, :3] == 1).all(axis=1)
    wanted = header.lines * header.length
    if repeats.any():
        number = np.arange(len(stored))
        source = np.maximum.accumulate(np.where(repeats, 0, number))
        digit = number - source - 1
        if repeats[0] or digit.max() > 3:
            raise ValueError("a run length without a pixel, or of more than four bytes")
        counts = np.where(repeats, stored[:, 3].astype(np.int64) << 8 * np.maximum(digit, 0), 1)
        end = int(np.searchsorted(np.minimum(counts, wanted).cumsum(), wanted)) + 1
        stored = np.repeat(stored[source[:end]], np.minimum(counts[:end], wanted), axis=0)
    if len(stored) < wanted:
        raise ValueError(f"{len(stored)} of {wanted} pixels are there")
    pixels = np.empty((wanted, 3), dtype=np.float32)
    for first in range(0, wanted, _BLOCK):
        block = stored[first : min(first + _BLOCK, wanted)]
        exponent = block[:, 3:].astype(np.int32)
        mantissas = block[:, :3].astype(np.float32)
        np.ldexp(mantissas, np.where(exponent, exponent - 136, -1000), out=pixels[first : first + len(block)])
    return pixels.reshape(header.lines, header.length, 3)


def standard_header(header: Header) -> bytes:
    """One for the same pixels that OpenImageIO makes sense of."""
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (header.lines, header.length)
