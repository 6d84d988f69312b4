"""Images out: a picture that is looked at, or linear numbers, by the suffix of the file. :mod:`.reading` reads."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ImageWarning
from ..settings import documented
from .colour import REC709, transform, xyz_to_rec709
from .encoding import encode_file
from .files import check_bits, check_film, check_output, format_of, is_picture, write_atomically
from .settings import OutputSettings, PictureFileSettings
from .strips import strips
from .tonemap import Meter, filled, view_codes, whole

if TYPE_CHECKING:
    from typing import TypeAlias

    import mitsuba as mi

    Image: TypeAlias = mi.Bitmap | NDArray[Any]

_NAMES = {1: ("Y",), 2: ("Y", "A"), 3: ("R", "G", "B"), 4: ("R", "G", "B", "A")}
_COLOURS = ("R", "G", "B", "A", "X", "Y", "Z")
"""Channels that half floats do for; others may be distances or numbers of things."""
_LARGEST_HALF = 65504.0
_XYZ = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)
"""The chromaticities of CIE XYZ."""


@documented(OutputSettings)
def write_image(
    path: str | Path,
    image: Image,
    metadata: Mapping[str, bool | str | int | float] | None = None,
    *,
    channels: Sequence[str] | None = None,
    **settings: Any,
) -> None:
    """Write ``image`` (linear, floating point) by the suffix of ``path``; the file appears complete or not at all.

    ``image``: a bitmap, or an array (H, W, C) of luminance or of red, green and blue, with or without alpha, by which
    they are multiplied; ``channels``: their names, where it has none. OpenEXR files hold them all, and ``metadata``.
    Pictures are developed, see :func:`.tonemap.view_codes`; .png, .webp and .tif have alpha beside colours that are not
    multiplied by it, unless it is 1 everywhere. What is lost is told by an :class:`ImageWarning`. Raises
    :class:`InputError` for a place or format that cannot be written, and :class:`OSError`.
    """
    output = OutputSettings(**settings)
    path = check_output(path)
    check_bits(path, output)
    pixels, names = _channels(image)
    if channels is not None:
        names = list(channels)
    check_film(path, pixels.shape[1], pixels.shape[0], len(names))
    if path.suffix.lower() == ".exr":
        content = _openexr(path, pixels, names, metadata or {}, output.float32)
    elif is_picture(path, output):
        content = _picture(path, *_colours_and_alpha(pixels, names), output)
    else:
        content = _numbers(path, *_colours_and_alpha(pixels, names))
    _write(path, content)


_APART = 2.0
"""Stops between the exposure of an object and that of its picture, at most."""
_OVER = 1.0
"""Stops that the automatic exposure may be above that of the light that falls onto the object."""


def write_developed(
    path: Path, colours: NDArray[np.float32], alpha: NDArray[np.float32] | None, output: PictureFileSettings
) -> None:
    """Write a picture of linear ``colours`` (H, W, 3), multiplied by ``alpha`` (H, W) if there is one."""
    check_film(path, colours.shape[1], colours.shape[0], 3)
    _write(path, _picture(path, colours, alpha, output))


def write_picture(path: str | Path, pixels: NDArray[np.uint8]) -> None:
    """Write sRGB pixels (H, W, 3) of 8 bits in a format of pictures."""
    _write(Path(path), encode_file(Path(path).suffix.lower(), pixels, _NAMES[3]))


def jpeg(pixels: NDArray[np.uint8], quality: int = 85) -> bytes:
    """8-bit sRGB pixels (H, W, 3) as a JPEG file, small enough for pages."""
    return encode_file(".jpg", pixels, _NAMES[3], quality=quality, attributes={"jpeg:subsampling": "4:2:0"})


def automatic_exposure(image: Image, mask: NDArray[np.bool_] | None = None, light: float = 0.0) -> float:
    """The exposure in stops that a picture of ``image`` gets unless told: that of what alpha covers.

    ``mask`` (H, W): pixels that count before others. What is around them still has a say: the exposure stays within
    :data:`_APART` stops of that of the whole picture, or something black would make all the rest white.

    ``light``: the luminance that the object would have if it were white, where it is known. As for a photographer who
    measures the light rather than the object, a white one becomes 1 then, or :data:`_OVER` stops more at most: what is
    black, before a black curtain too, stays dark.
    """
    colours, alpha = _colours_and_alpha(*_channels(image))
    whole, part = Meter(), Meter()
    add_to(whole, colours, alpha)
    stops = whole.stops
    if mask is not None and mask.any():
        for rows in strips(*mask.shape):
            seen = mask[rows]
            add_to(part, colours[rows][seen][None], None if alpha is None else alpha[rows][seen][None])
        stops = min(max(part.stops, stops - _APART), stops + _APART)
    return min(stops, _OVER - float(np.log2(light))) if light > 0 else stops


def add_to(meter: Meter, colours: NDArray[np.float32], alpha: NDArray[np.float32] | None) -> None:
    """Meter ``colours`` (H, W, 3) that are multiplied by ``alpha`` (H, W), where there is one: each pixel counts as
    much as it is covered, as edges that hardly are would be very dark."""
    for rows in strips(*colours.shape[:2]):
        if alpha is None:
            meter.add(colours[rows])
        else:
            meter.add(_straight(colours[rows], alpha[rows]), np.clip(np.nan_to_num(alpha[rows]), 0, 1))


def _straight(colours: NDArray[np.float32], alpha: NDArray[np.float32]) -> NDArray[np.float32]:
    """``colours`` that are no longer multiplied by ``alpha``; black where that is 0."""
    return np.asarray(colours / np.where(alpha > 0, alpha, np.inf)[..., None], dtype=np.float32)


def _write(path: Path, content: bytes) -> None:
    write_atomically(path, lambda name: Path(name).write_bytes(content))


def _channels(image: Image) -> tuple[NDArray[np.float32], list[str]]:
    """Pixels (H, W, C), which are not to be changed, and the names of their channels."""
    pixels = np.asarray(image, dtype=np.float32)
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels
    struct = getattr(image, "struct_", None)
    if struct is not None:
        return pixels, [field.name for field in struct()]
    return pixels, list(_NAMES.get(pixels.shape[2], [f"channel{k}" for k in range(pixels.shape[2])]))


def _colours_and_alpha(
    pixels: NDArray[np.float32], names: Sequence[str]
) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
    """Linear red, green and blue (H, W, 3), and alpha (H, W) if there is one."""
    alpha = pixels[..., names.index("A")] if "A" in names else None
    colours = [k for k, name in enumerate(names) if name != "A"]
    rgb = np.ascontiguousarray(pixels[..., colours[:3]])
    if rgb.shape[2] < 3:
        rgb = np.repeat(rgb[..., :1], 3, axis=2)
    elif list(names[:3]) == ["X", "Y", "Z"]:
        transform(rgb, xyz_to_rec709(REC709[6:]))
    return rgb, alpha


# ------------------------------- Pictures -------------------------------


def _picture(
    path: Path, colours: NDArray[np.float32], alpha: NDArray[np.float32] | None, output: PictureFileSettings
) -> bytes:
    meter, exposure = Meter(), output.exposure
    if exposure is None:
        add_to(meter, colours, alpha)
        exposure = meter.stops
    alpha = _seen(path, alpha, output.bits)
    if alpha is not None and (lost := np.count_nonzero((colours[alpha == 0] > 0).any(axis=-1))):
        _warn(f"{path}: light of {lost} pixel(s) without alpha is left out; .exr holds that")
    height, width, _ = colours.shape
    shown = np.empty((height, width, 3 if alpha is None else 4), dtype=np.uint8 if output.bits == 8 else np.uint16)
    for rows in strips(height, width):
        shown[rows] = _codes(colours, alpha, rows, exposure, output)
    return encode_file(path.suffix.lower(), shown, _NAMES[shown.shape[2]])


def _codes(
    colours: NDArray[np.float32],
    alpha: NDArray[np.float32] | None,
    rows: slice,
    exposure: float,
    output: PictureFileSettings,
) -> NDArray[Any]:
    """Those of some rows; pixels are filled from the rows beside, too."""
    around = slice(max(0, rows.start - 1), rows.stop + 1)
    part = colours[around]
    if alpha is not None:
        part = _straight(filled(part), alpha[around])
    codes = view_codes(part, exposure, output.view)
    if alpha is not None:
        codes = np.dstack([codes, alpha[around]])
    first = rows.start - around.start
    return whole(codes[first : first + rows.stop - rows.start], output.bits)


def _seen(path: Path, alpha: NDArray[np.float32] | None, bits: int = 16) -> NDArray[np.float32] | None:
    """Alpha from 0 to 1, or None where it is 1 everywhere, as far as that many bits tell, or cannot be held."""
    if alpha is None:
        return None
    alpha = np.clip(np.nan_to_num(alpha), 0, 1)
    if (alpha * ((1 << bits) - 1) + 0.5 >= (1 << bits) - 1).all():
        return None
    if not format_of(path).alpha:
        _warn(f"{path}: alpha is left out, which is not 1 everywhere; .exr and .png hold it")
        return None
    return alpha


# ------------------------------- Linear numbers -------------------------------


def _openexr(
    path: Path,
    pixels: NDArray[np.float32],
    names: list[str],
    metadata: Mapping[str, bool | str | int | float],
    float32: bool,
) -> bytes:
    # Integers have 32 bits there.
    about: dict[str, Any] = {
        key: str(value) if isinstance(value, int) and not -(1 << 31) <= value < 1 << 31 else value
        for key, value in metadata.items()
    }
    if names[:3] == ["X", "Y", "Z"]:
        about |= {"chromaticities": _XYZ, "oiio:ColorSpace": ""}
    kinds = ["float" if float32 or name not in _COLOURS else "half" for name in names]
    halves = [k for k, kind in enumerate(kinds) if kind == "half"]
    count, given = 0, pixels
    for rows in strips(*pixels.shape[:2]) if halves else ():
        part = given[rows][..., halves]
        beyond = np.isfinite(part) & (np.abs(part) > _LARGEST_HALF)
        if found := np.count_nonzero(beyond.any(axis=2)):
            count += int(found)
            pixels = given.copy() if pixels is given else pixels
            pixels[rows][..., halves] = np.where(beyond, np.clip(part, -_LARGEST_HALF, _LARGEST_HALF), part)
    if count:
        _warn(f"{path}: {count} pixel(s) above {_LARGEST_HALF:g} are written as that; --float32 keeps them")
    return encode_file(".exr", pixels, names, kinds=kinds, attributes=about)


def _numbers(path: Path, colours: NDArray[np.float32], alpha: NDArray[np.float32] | None) -> bytes:
    alpha = _seen(path, alpha)
    if path.suffix.lower() == ".hdr":
        _check_radiance(path, colours)
    pixels = colours if alpha is None else np.dstack([colours, alpha])
    return encode_file(path.suffix.lower(), pixels, _NAMES[pixels.shape[2]])


def _check_radiance(path: Path, colours: NDArray[np.float32]) -> None:
    """Replace what has no place in a Radiance picture, with a word: of a negative number it makes a large one."""
    bad = ~(np.isfinite(colours) & (colours >= 0))
    if count := np.count_nonzero(bad.any(axis=2)):
        _warn(f"{path}: {count} pixel(s) below 0 or not finite are written as 0; .exr and .pfm hold them")
        colours[bad] = 0


def _warn(text: str) -> None:
    warnings.warn(text, ImageWarning, stacklevel=4)
