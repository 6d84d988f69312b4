"""Image files out; the codecs are Mitsuba's, which is imported only when a file is written. :mod:`.reading` reads."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .tonemap import tonemap

if TYPE_CHECKING:
    import mitsuba as mi

OUTPUT_SUFFIXES = (".exr", ".png", ".jpg", ".hdr", ".pfm")
PICTURE_SUFFIXES = (".png", ".jpg")
"""Formats of 8 bits: tone-mapped, no metadata."""
COLOUR_SUFFIXES = (".hdr", ".pfm")
"""Formats of numbers that know red, green and blue alone."""

_LONGEST_NAME = 255
"""Bytes, in the file systems that people have."""


def check_output(path: str | Path, suffixes: tuple[str, ...] = OUTPUT_SUFFIXES) -> Path:
    """Make sure, before any work is done, that an image can be written to ``path``. Raises :class:`InputError`."""
    _check_given(path)
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise InputError(
            f"{shown(path)}: unknown image format '{shown(path.suffix)}'; use one of {', '.join(suffixes)}"
        )
    check_writable(path)
    return path


def check_writable(path: str | Path) -> None:
    """Raise :class:`InputError` if no file can be written at ``path``."""
    _check_given(path)
    path = Path(path)
    check_name(path)
    path = Path(os.path.realpath(path))
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give the name of a file")
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is a pipe or a device, which an image cannot replace; give the name of a file")
    try:
        if path.is_symlink():
            raise OSError("links in a circle")
        with tempfile.TemporaryFile(dir=path.parent):
            pass
        if path.exists() and not os.access(path, os.W_OK):
            raise PermissionError("the file is write-protected")
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{path}: cannot be written ({reason}); choose another place with -o") from None


def check_name(path: str | Path) -> None:
    """Raise :class:`InputError` if no file or folder can have that name."""
    _check_given(path)
    if shown(path) != str(path):
        raise InputError(f"{shown(path)}: the name is not UTF-8; choose another with -o")
    for name in Path(path).parts:
        if len(size := os.fsencode(name)) > _LONGEST_NAME:
            raise InputError(f"{name[:40]}...: the name has {len(size)} bytes; give one of at most {_LONGEST_NAME}")


def check_different(paths: Sequence[str | Path], inputs: Sequence[str | Path] = ()) -> None:
    """Raise :class:`InputError` if one of the files to write is there twice, or is an input."""
    before = {os.path.realpath(path) for path in inputs}
    seen: set[str] = set()
    for path in paths:
        where = os.path.realpath(path)
        if where in seen:
            raise InputError(f"{path}: is to be written twice; leave one out, or give it another name")
        if where in before:
            raise InputError(f"{path}: is read, and would be lost; give the output another name")
        seen.add(where)


def _check_given(path: str | Path) -> None:
    if not str(path):
        raise InputError("the name of the output is empty; give one")


def write_image(
    path: str | Path,
    bitmap: mi.Bitmap,
    metadata: Mapping[str, bool | str | int | float] | None = None,
    exposure: float | None = None,
) -> None:
    """Write ``bitmap`` (linear, floating point) by the suffix of ``path``; the file appears complete or not at all.

    OpenEXR files carry ``metadata``. PNG and JPEG files are tone-mapped, see :func:`tonemap`.
    """
    import mitsuba as mi

    path = check_output(path)
    if path.suffix.lower() in PICTURE_SUFFIXES:
        bitmap = mi.Bitmap(tonemap(_colours(bitmap), exposure))
    elif path.suffix.lower() in COLOUR_SUFFIXES:
        bitmap = mi.Bitmap(_colours(bitmap))
    else:
        for key, value in (metadata or {}).items():  # whose integers have 32 bits
            large = isinstance(value, int) and not -(1 << 31) <= value < 1 << 31
            bitmap.metadata()[key] = str(value) if large else value
    write_atomically(path, bitmap.write)


def check_channels(path: str | Path, channels: int) -> None:
    """Make sure, before any work is done, that the format of ``path`` can hold a film of so many ``channels``."""
    if channels > 4 and Path(path).suffix.lower() != ".exr":
        raise InputError(f"{path}: the film has {channels} channels, which only .exr can hold; write that")


def _colours(bitmap: mi.Bitmap) -> NDArray[np.float32]:
    """Linear RGB (H, W, 3) of a bitmap that has that, or luminance; alpha is left out."""
    pixels = np.array(bitmap, dtype=np.float32)
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels
    return np.ascontiguousarray(pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, axis=2))


def write_picture(path: str | Path, pixels: NDArray[np.uint8]) -> None:
    """Write 8-bit sRGB pixels (H, W, 3) as .png or .jpg."""
    import mitsuba as mi

    write_atomically(path, mi.Bitmap(pixels).write)


def jpeg(pixels: NDArray[np.uint8], quality: int = 85) -> bytes:
    """8-bit sRGB pixels (H, W, 3) as a JPEG file."""
    import mitsuba as mi

    stream = mi.MemoryStream()
    mi.Bitmap(np.ascontiguousarray(pixels)).write(stream, mi.Bitmap.FileFormat.JPEG, quality)
    return bytes(stream.raw_buffer())


def write_atomically(path: str | Path, write: Callable[[str], object]) -> None:
    """Call ``write`` with a temporary name beside ``path`` and then rename: the file appears complete or not at all."""
    path = Path(os.path.realpath(path))  # what a link leads to, not the link
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".stratalux-", suffix=path.suffix.lower())
    os.close(handle)
    try:
        write(temporary)
        os.chmod(temporary, 0o666 & ~umask())
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise


def umask() -> int:
    """Permissions that this process takes from new files."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def one_line(error: BaseException) -> str:
    """The message of an error on one line, without the source positions that Mitsuba puts in front."""
    text = " ".join(str(error).split())
    while text.startswith("[") and "] " in text:
        text = text.split("] ", 1)[1]
    return text or type(error).__name__


def shown(text: str | Path) -> str:
    """``text`` as it can be printed, whatever bytes a name has."""
    return str(text).encode("utf-8", "replace").decode("utf-8")
