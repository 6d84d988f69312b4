"""Image files out; the codecs are Mitsuba's, which is imported only when a file is written. :mod:`.reading` reads."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .colour import LUMINANCE

if TYPE_CHECKING:
    import mitsuba as mi

OUTPUT_SUFFIXES = (".exr", ".png", ".jpg", ".hdr", ".pfm")
PICTURE_SUFFIXES = (".png", ".jpg")
"""Formats of 8 bits: tone-mapped, no metadata."""


def check_output(path: str | Path, suffixes: tuple[str, ...] = OUTPUT_SUFFIXES) -> Path:
    """Make sure, before any work is done, that an image can be written to ``path``. Raises :class:`InputError`."""
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise InputError(f"{path}: unknown image format '{path.suffix}'; use one of {', '.join(suffixes)}")
    check_writable(path)
    return path


def check_writable(path: str | Path) -> None:
    """Raise :class:`InputError` if no file can be written at ``path``."""
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give the name of a file")
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
        if path.exists() and not os.access(path, os.W_OK):
            raise PermissionError("the file is write-protected")
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{path}: cannot be written ({reason}); choose another place with -o") from None


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
        pixels = np.array(bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
        bitmap = mi.Bitmap(tonemap(pixels, exposure))
    else:
        for key, value in (metadata or {}).items():
            bitmap.metadata()[key] = value
    write_atomically(path, bitmap.write)


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
    path = Path(path)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix.lower())
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


def auto_exposure(pixels: NDArray[np.float32]) -> float:
    """Exposure in stops that brings the geometric mean of the luminance of (H, W, 3) linear pixels to 0.18."""
    luminance = pixels @ LUMINANCE
    luminance = luminance[np.isfinite(luminance) & (luminance > 0)]
    if not luminance.size:
        return 0.0
    return float(np.log2(0.18) - np.log2(luminance.astype(np.float64)).mean())


def tonemap(pixels: NDArray[np.float32], exposure: float | None = None) -> NDArray[np.uint8]:
    """Linear RGB (H, W, 3) to 8-bit sRGB: exposure in stops (None: automatic), then a soft shoulder.

    The shoulder is Reinhard's extended operator on luminance (Reinhard et al. 2002, equation 4) with its white point
    16 times above middle white, so colours keep their hue.
    """
    if exposure is None:
        exposure = auto_exposure(pixels)
    linear = np.clip(np.nan_to_num(pixels.astype(np.float32)) * 2.0**exposure, 0, 1e6)
    luminance = (linear @ LUMINANCE)[..., None]
    white = 16.0
    linear = linear * (1 + luminance / white**2) / (1 + luminance)
    # Middle grey keeps its brightness: undo what the shoulder takes from it.
    linear = np.clip(linear * 1.18, 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return (encoded * 255 + 0.5).astype(np.uint8)


def one_line(error: BaseException) -> str:
    """The message of an error on one line, without the source positions that Mitsuba puts in front."""
    text = " ".join(str(error).split())
    while text.startswith("[") and "] " in text:
        text = text.split("] ", 1)[1]
    return text or type(error).__name__
