"""Names of files to write: what formats there are, and whether something can be written there. :mod:`.writing` does."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError

if TYPE_CHECKING:
    from .settings import OutputSettings, PictureFileSettings


@dataclass(frozen=True)
class Format:
    """What a file of a kind can hold.

    ``bits``: the whole numbers of a picture; none where there are linear numbers. ``alpha``: whether there may be
    alpha. ``channels``: the most. ``longest``: pixels along a side, the most. ``float32``: whether it can be made with
    linear numbers of 32 bits.
    """

    bits: tuple[int, ...] = ()
    alpha: bool = True
    channels: int = 4
    longest: int = 1 << 30
    float32: bool = False


_JPEG = Format((8,), alpha=False, longest=65500)
_TIFF = Format((8, 16), float32=True)
FORMATS = {
    ".exr": Format(channels=1 << 10, float32=True),
    ".png": Format((8, 16)),
    ".jpg": _JPEG,
    ".jpeg": _JPEG,
    ".webp": Format((8,), longest=16383),
    ".tif": _TIFF,
    ".tiff": _TIFF,
    ".hdr": Format(alpha=False),
    ".pfm": Format(alpha=False),
}
OUTPUT_SUFFIXES = tuple(FORMATS)
PICTURE_SUFFIXES = tuple(suffix for suffix, kind in FORMATS.items() if kind.bits)
"""Formats of pictures that are looked at: developed, without metadata."""

CHECKPOINT = ".checkpoint"
"""After the name of an output, of the file that keeps it while it is made."""

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


def format_of(path: str | Path) -> Format:
    """The format that the suffix of ``path`` tells."""
    return FORMATS[Path(path).suffix.lower()]


def is_picture(path: str | Path, output: PictureFileSettings) -> bool:
    """Whether the file is one to be looked at, and not one of linear numbers."""
    kind = format_of(path)
    return bool(kind.bits) and not (kind.float32 and getattr(output, "float32", False))


def check_bits(path: str | Path, output: PictureFileSettings) -> None:
    """Make sure, before any work is done, that the format of ``path`` has as many bits as are asked for."""
    if is_picture(path, output) and output.bits not in format_of(path).bits:
        able = ", ".join(suffix for suffix, kind in FORMATS.items() if output.bits in kind.bits)
        raise InputError(f"{path}: has no {output.bits} bits; write one of {able}, or leave --bits out")


def check_float32(paths: Sequence[str | Path], output: OutputSettings) -> None:
    """Make sure that one of the files can be what ``output.float32`` asks for."""
    if output.float32 and not any(format_of(path).float32 for path in paths):
        able = ", ".join(suffix for suffix, kind in FORMATS.items() if kind.float32)
        raise InputError(f"--float32: no output has a choice of 32 bits; write one of {able}, or leave it out")


def check_film(path: str | Path, width: int, height: int, channels: int = 1) -> None:
    """Make sure, before any work is done, that the format of ``path`` can hold a film of that size."""
    kind = format_of(path)
    if channels > kind.channels:
        raise InputError(f"{path}: the film has {channels} channels, which only .exr can hold; write that")
    if max(width, height) > kind.longest:
        raise InputError(f"{path}: has at most {kind.longest} pixels along a side, not {width}x{height}; write a .png")


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
