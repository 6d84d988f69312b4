"""Image files in: linear Rec. 709 from whatever people have, or one line that says why not."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from . import radiance
from .colour import PRIMARIES, REC709, decode, luminance_weights, to_rec709, transform
from .files import shown
from .layers import Choice, choose
from .reader import Reader, ReadError
from .repair import repair

SUFFIXES = (".exr", ".hdr", ".pfm", ".tif", ".png", ".jpg", ".tx", ".webp", ".tga", ".bmp")
"""Formats that people have, of those that OpenImageIO reads; what a file is tells its content, not its suffix."""
_PIXEL_BYTES = 12
_MOST_COMPRESSED = 100_000
"""Bytes of pixels to a byte of file that no compression reaches."""
_SPACE = re.compile(r"(lin|srgb|g\d+)_(\w+?)_(scene|display)")
WHOLE = {"uint8": 255, "uint16": 65535}
"""Whole numbers that images are stored in, and the largest of each kind."""
_ENVIRONMENTS = {"CubeFace Environment": "openexr-cube", "LatLong Environment": "latlong"}
"""What OpenImageIO calls the kinds of ``envmap`` that OpenEXR has."""
_ORIENTATIONS = {
    2: (False, False, True),
    3: (False, True, True),
    4: (False, True, False),
    5: (True, False, False),
    6: (True, False, True),
    7: (True, True, True),
    8: (True, True, False),
}
"""Of TIFF and Exif: whether rows are columns; then, whether the picture's rows and its columns are in reverse."""


Allocate = Callable[[tuple[int, int, int], Any], NDArray[Any]]
"""From a shape and a type to an array with any content."""


@dataclass
class Image:
    """What a file holds: linear Rec. 709 ``pixels`` (H, W, 3), as they are, be they finite or not; float32, or float16
    where that was asked for.

    ``said``: what was chosen, left out, converted or repaired on the way, a line each. ``largest``: the largest number
    that the file's own type holds, where that is less than float32 does; what is infinite stands for it.
    ``layout``: the name of the one that a map has, if the header says so (those of :data:`..maps.layouts.LAYOUTS`).
    ``alpha`` (H, W): where it was asked for and is there; the pixels are multiplied by it.
    """

    pixels: NDArray[Any]
    said: list[str] = field(default_factory=list)
    largest: float | None = None
    layout: str | None = None
    alpha: NDArray[np.float32] | None = None


def default_memory() -> int:
    """Half of what this machine has, or of what the container has in which this runs, in bytes."""
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    with suppress(OSError, ValueError):
        memory = min(memory, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    return memory // 2


def read_image(
    path: str | Path,
    max_memory: int | None = None,
    reader: Reader | None = None,
    *,
    alpha: bool = False,
    allocate: Allocate | None = None,
) -> Image:
    """Read an image file: OpenEXR, Radiance, PFM, TIFF, PNG, JPEG, or whatever else OpenImageIO reads.

    ``max_memory``: bytes that the pixels may take, 12 each; half of what the machine has unless given. ``reader``: one
    to be used for several files; else each has its own. ``alpha``: whether that is read, too. ``allocate``: makes the
    array of the pixels, of a shape and a type, and with it half floats are left as they are where nothing has to be
    converted. What files say is followed: display and data windows (what is outside of the data is black), layers (see
    :func:`.layers.choose`), primaries and white point, curves, exposures, orientations. Raises :class:`InputError` with
    one line if the file is missing, damaged, too large or not an image.
    """
    path = Path(path)
    most = default_memory() if max_memory is None else max_memory
    with on_one_line(path), nullcontext(reader) if reader is not None else Reader() as process:
        if radiance.is_radiance(path):
            return read_radiance(path, most, process, allocate)
        return _image(path, most, process, alpha, allocate)


def read_text(path: str | Path, name: str) -> str | None:
    """The text that an image file has under ``name`` besides its pixels, one of those that the reader knows.

    Raises :class:`InputError` as :func:`read_image`.
    """
    path = Path(path)
    with on_one_line(path), Reader() as process:
        found = process.parts(path)[0]["attributes"].get(name)
    return None if found is None else str(found)


@contextmanager
def on_one_line(path: Path, name: str | None = None) -> Iterator[None]:
    """Whatever goes wrong with a file is an :class:`InputError` of one line, which calls it by its path or `name`."""
    name = shown(path) if name is None else name
    try:
        found = path.is_file()
    except OSError as error:  # a name that is too long
        raise InputError(f"{name}: {error.strerror or error}") from None
    if not found:
        raise InputError(f"{name}: no such file; give an image ({', '.join(SUFFIXES[:3])}, ...)")
    try:
        yield
    except InputError:
        raise
    except (ReadError, ValueError, MemoryError, OSError, IndexError) as error:
        reason = " ".join(str(error).split()).replace(str(path.absolute()), "the file").rstrip(".")
        reason = re.sub(r"EXR Error \(the file\): (EXR_\w+ )?", "", reason)
        raise InputError(f"{name}: cannot be read as an image ({reason[:200]}); copy or export it again") from None


def _image(path: Path, most: int, reader: Reader, alpha: bool, allocate: Allocate | None) -> Image:
    image, part, choice = read_stored(path, most, reader, alpha, allocate)
    attributes, kind = part["attributes"], part["types"][choice.channels[0]]
    if kind in ("uint", "uint32"):
        image.said.append("32-bit integers are taken as they are")
    straight = attributes.get("oiio:UnassociatedAlpha")
    if straight and not alpha:
        image.said.append("alpha is left out")
    if image.alpha is not None and not straight and kind.startswith("uint"):  # codes that were multiplied by it
        np.divide(image.pixels, image.alpha[..., None], out=image.pixels, where=image.alpha[..., None] > 0)
        straight = True
    to_linear(image, choice, *_colour_space(image, part, kind))
    if image.pixels.shape[2] == 1:
        image.pixels = np.repeat(image.pixels, 3, axis=2)
    if image.alpha is not None and straight:
        image.pixels *= image.alpha[..., None]
    image.layout = attributes.get("stratalux:layout") or _ENVIRONMENTS.get(attributes.get("textureformat"))
    turn = _ORIENTATIONS.get(attributes.get("Orientation", 1), (False, False, False))
    image.pixels = _oriented(image.pixels, *turn)
    image.alpha = None if image.alpha is None else _oriented(image.alpha, *turn)
    return image


def read_stored(
    path: Path, most: int, reader: Reader, alpha: bool = False, allocate: Allocate | None = None
) -> tuple[Image, dict[str, Any], Choice]:
    """The picture as it is stored, in its window; the part of the file that it is, and which channels are taken."""
    parts = reader.parts(path)
    if not parts:
        raise InputError(f"{path}: no image in it")
    choice = choose(parts, str(path))
    part = parts[choice.part]
    columns, rows, window = _windows(path, part)
    check_size(path, part, window[2:], most)
    with_alpha = [choice.alpha] if alpha and choice.alpha is not None else []
    channels = [*choice.channels, *with_alpha]
    into = None
    kinds = {part["types"][channel] for channel in channels}
    if allocate is not None and not kinds & {"uint", "uint32"}:
        shape = rows[1] - rows[0], columns[1] - columns[0], len(channels)
        into = allocate(shape, np.float16 if kinds == {"half"} else np.float32)
    pixels = reader.pixels(path, part, choice.part, channels, columns, rows, into)
    image = Image(_framed(pixels, columns, rows, window))
    if with_alpha:
        pixels = image.pixels
        image.pixels, image.alpha = np.ascontiguousarray(pixels[..., :-1]), np.ascontiguousarray(pixels[..., -1])
    image.said += [choice.said] if choice.said else []
    image.said += _said_of_windows(part)
    of_half = part["types"][choice.channels[0]] == "half"
    image.largest = float(np.finfo(np.float16).max) if of_half else None
    return image, part, choice


def codes(pixels: NDArray[np.float32], kind: str) -> NDArray[Any]:
    """The whole numbers of that ``kind`` (see :data:`WHOLE`) that the file has: the reader makes fractions of them."""
    scaled = np.clip(pixels, 0, 1) * np.float32(WHOLE[kind])
    return np.rint(scaled, out=scaled).astype(kind)


def read_radiance(path: Path, most: int, reader: Reader, allocate: Allocate | None = None) -> Image:
    """A Radiance picture, see :func:`read_image`."""
    header = radiance.read_header(path)
    size = header.length, header.lines
    _check_memory(path, size, most)
    if path.stat().st_size - header.start < radiance.least_bytes(header):
        raise ValueError(f"the header says {size[0]}x{size[1]}, for which the file is too short")
    if not header.new_runs:
        pixels = radiance.read_old(path, header)
    else:
        with _standard(path, header) as source:
            part = {"core": 1, "types": ["float"] * 3}
            into = None if allocate is None else allocate((size[1], size[0], 3), np.float32)
            pixels = reader.pixels(source, part, 0, [0, 1, 2], (0, size[0]), (0, size[1]), into)
    if header.gamma != 1:
        decode(pixels, header.gamma)
    if header.factor.min() != 1 or header.factor.max() != 1:
        pixels *= header.factor.astype(np.float32)
    if header.matrix is not None:
        transform(pixels, header.matrix)
    return Image(_oriented(pixels, header.turned, *header.flipped), header.said)


@contextmanager
def _standard(path: Path, header: radiance.Header) -> Iterator[Path]:
    """The file, or a copy of it with a header that OpenImageIO makes sense of."""
    if header.plain:
        yield path
        return
    with tempfile.NamedTemporaryFile(suffix=".hdr") as copy, path.open("rb") as file:
        file.seek(header.start)
        copy.write(radiance.standard_header(header))
        shutil.copyfileobj(file, copy)
        copy.flush()
        yield Path(copy.name)


# ------------------------------- Windows and sizes -------------------------------


def _windows(path: Path, part: dict[str, Any]) -> tuple[tuple[int, int], tuple[int, int], Sequence[int]]:
    """Columns and rows to be read, the first and the one after the last, and the window (x, y, width, height) that is
    the picture."""
    x, y, width, height = part["data"]
    left, top, wide, high = part["display"]
    if min(width, height, wide, high) < 1 or part["depth"] > 1:
        raise InputError(f"{path}: {width}x{height}x{part['depth']} is no size of an image")
    columns = max(x, left), min(x + width, left + wide)
    rows = max(y, top), min(y + height, top + high)
    if columns[0] >= columns[1] or rows[0] >= rows[1]:
        raise InputError(
            f"{path}: the pixels, {_window(part['data'])}, are all outside of the picture, "
            f"{_window(part['display'])} (display window); export it again"
        )
    return columns, rows, part["display"]


def _said_of_windows(part: dict[str, Any]) -> list[str]:
    x, y, width, height = part["data"]
    left, top, wide, high = part["display"]
    said = []
    if x < left or y < top or x + width > left + wide or y + height > top + high:
        said.append("what is outside is cropped")
    if x > left or y > top or x + width < left + wide or y + height < top + high:
        said.append("the rest is black")
    if not said:
        return []
    return [f"pixels, {_window(part['data'])}, in a display window, {_window(part['display'])}: {' and '.join(said)}"]


def _window(window: Sequence[int]) -> str:
    return f"{window[2]}x{window[3]} at {window[0]},{window[1]}"


def _framed(
    pixels: NDArray[np.float32], columns: tuple[int, int], rows: tuple[int, int], window: Sequence[int]
) -> NDArray[np.float32]:
    """``pixels`` where they belong in the ``window``, which is black elsewhere."""
    x, y, width, height = window
    if pixels.shape[:2] == (height, width):
        return pixels
    framed = np.zeros((height, width, pixels.shape[2]), dtype=pixels.dtype)
    framed[rows[0] - y : rows[1] - y, columns[0] - x : columns[1] - x] = pixels
    return framed


def _check_memory(path: Path, size: Sequence[int], most: int) -> None:
    need = _PIXEL_BYTES * size[0] * size[1]
    if need > most:
        raise InputError(
            f"{path}: {size[0]}x{size[1]} pixels take {need / 1e9:.3g} GB, more than {most / 1e9:.3g} GB; "
            "make it smaller, or allow more with --max-memory"
        )


def check_size(path: Path, part: dict[str, Any], size: Sequence[int], most: int) -> None:
    """That the picture fits in memory, and that what the header says of its size can be true of the file."""
    width, height = part["data"][2:]
    _check_memory(path, size, most)
    _check_memory(path, (width, height), most)
    tile = part["tile"]
    least = width * height * len(part["channels"]) / _MOST_COMPRESSED
    if part["format"] == "openexr":
        rows = part["attributes"].get("oiio:RowsPerChunk", 1)
        chunks = -(-width // tile[0]) * -(-height // tile[1]) if min(tile) else -(-height // max(rows, 1))
        least = max(least, 16 * chunks)  # each has a place in a table, and says where it belongs
    elif part["format"] == "pnm" and part["types"][0] == "float":
        least = 4 * width * height * len(part["channels"])
    have = path.stat().st_size
    if have < least:
        raise ValueError(f"the header says {width}x{height}, for which {have} bytes are too few")
    if part["format"] == "jpeg":
        content = path.read_bytes()
        if content.rfind(b"\xff\xd9") < content.rfind(b"\xff\xda"):  # no end after the last scan: it would be grey
            raise ValueError("it is cut off")
    if tile[0] * tile[1] > 16 * max(width * height, 1 << 16):
        raise ValueError(f"the header says tiles of {tile[0]}x{tile[1]} in an image of {width}x{height}")


# ------------------------------- Colours -------------------------------


def to_linear(image: Image, choice: Choice, curve: str | float | None, primaries: Sequence[float] | None) -> None:
    """Make linear Rec. 709 of what the file holds, if there are colours; see :func:`_colour_space`."""
    if choice.chroma or curve is not None or primaries is not None:
        image.pixels = image.pixels.astype(np.float32, copy=False)
    if choice.chroma:
        repair_image(image)
        image.pixels = _colours_of_luminance(image.pixels, primaries or REC709)
    if curve is not None:
        decode(image.pixels, curve)
    try:
        matrix = None if primaries is None or image.pixels.shape[2] == 1 else to_rec709(primaries)
    except ValueError:
        image.said.append("its chromaticities make no sense, and are left out")
        return
    if matrix is not None:
        repair_image(image)
        transform(image.pixels, matrix)
        image.said.append("its primaries and white are converted to those of Rec. 709")


def _colour_space(image: Image, part: dict[str, Any], kind: str) -> tuple[str | float | None, Sequence[float] | None]:
    """The curve that the pixels follow and their primaries; None where they are linear, and of Rec. 709."""
    attributes = part["attributes"]
    space = str(attributes.get("oiio:ColorSpace", ""))
    known = _SPACE.fullmatch(space)
    whole = kind not in ("half", "float", "double") and part["format"] != "openexr"
    curve: str | float | None = "srgb" if whole else None
    primaries: Sequence[float] | None = attributes.get("chromaticities")
    if known and known[2] in PRIMARIES:
        gamma = float(attributes.get("oiio:Gamma", 0)) or 2.2
        curve = {"lin": None, "srgb": "srgb"}.get(known[1], gamma if known[1].startswith("g") else None)
        primaries = primaries or PRIMARIES[known[2]]
    elif space and space != "Rec709":
        image.said.append(f"colour space {space!r} is not known, and taken for {curve or 'linear'} Rec. 709")
    if whole:
        bits = {"uint8": "8", "uint16": "16"}.get(kind, kind)
        image.said.append(
            f"{bits}-bit {'sRGB' if curve == 'srgb' else 'integers'}: what is brighter than white was clipped, so that "
            "suns and lamps are far too dark; use .exr or .hdr"
        )
    profile = str(attributes.get("ICCProfile:profile_description", ""))
    if profile and "srgb" not in profile.lower() and not primaries:
        image.said.append(f"colour profile {profile[:40]!r} is not followed")
    return curve, primaries


def _colours_of_luminance(pixels: NDArray[np.float32], primaries: Sequence[float]) -> NDArray[np.float32]:
    """Red, green and blue of luminance Y, (R − Y) / Y and (B − Y) / Y (OpenEXR, "Technical introduction")."""
    weights = luminance_weights(primaries)
    luminance, red, blue = (pixels[..., c].astype(np.float64) for c in range(3))
    red, blue = (red + 1) * luminance, (blue + 1) * luminance
    green = (luminance - weights[0] * red - weights[2] * blue) / weights[1]
    return np.stack([red, green, blue], axis=2).astype(np.float32)


def repair_image(image: Image) -> None:
    """Without what is not finite, which would spread to other channels."""
    repaired, said = repair(image.pixels, image.largest, keep_negative=True)
    if repaired is not image.pixels:
        image.pixels = repaired
        image.said.append(said)


def _oriented(pixels: NDArray[Any], turned: bool, rows: bool, columns: bool) -> NDArray[Any]:
    """``pixels`` with rows for columns if ``turned``; then, ``rows`` and ``columns`` in reverse."""
    if turned:
        pixels = pixels.swapaxes(0, 1)
    return np.ascontiguousarray(pixels[:: -1 if rows else 1, :: -1 if columns else 1])
