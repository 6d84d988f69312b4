"""Pixels as the bytes of an image file, through OpenImageIO, which is imported only when a file is made."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

SRGB = "srgb_rec709_scene"
LINEAR = "lin_rec709_scene"
"""Names of the Academy Software Foundation's Color Interop Forum."""

_QUALITY = 95
"""Of JPEG and WebP."""
_ATTRIBUTES: dict[str, dict[str, Any]] = {
    # The compression that everything reads; at its lowest level twice as fast as at OpenImageIO's, and 5 % longer.
    ".exr": {"compression": "zip:1", "oiio:ColorSpace": LINEAR},
    # Noise does not get shorter by more work.
    ".png": {"png:compressionLevel": 3, "oiio:ColorSpace": SRGB},
    ".jpg": {"jpeg:subsampling": "4:4:4", "oiio:ColorSpace": SRGB},
    ".webp": {"compression": f"webp:{_QUALITY}", "oiio:ColorSpace": SRGB},
    ".tif": {"compression": "zip:3", "oiio:ColorSpace": SRGB},
}
_MEMORY = hasattr(os, "memfd_create") and Path("/proc/self/fd").is_dir()
_ALIASES = {".jpeg": ".jpg", ".tiff": ".tif"}


def encode_file(
    suffix: str,
    pixels: NDArray[Any],
    names: Sequence[str],
    *,
    kinds: Sequence[str] = (),
    quality: int = _QUALITY,
    attributes: Mapping[str, Any] | None = None,
) -> bytes:
    """``pixels`` (H, W, C) as a file of the format of ``suffix``, with channels of these ``names``.

    ``kinds``: types of the channels, where they are not that of the pixels. ``quality``: of a JPEG. ``attributes``:
    what the file is to remember besides, where the format can. Raises :class:`RuntimeError` if the library fails.
    """
    import OpenImageIO as oiio

    suffix = _ALIASES.get(suffix, suffix)
    height, width, count = pixels.shape
    kind = "float" if pixels.dtype.kind == "f" else str(pixels.dtype)
    spec = oiio.ImageSpec(width, height, count, kinds[0] if len(set(kinds)) == 1 else kind)
    spec.channelnames = tuple(names)
    if len(set(kinds)) > 1:
        spec.channelformats = tuple(map(oiio.TypeDesc, kinds))
    spec.alpha_channel = names.index("A") if "A" in names else -1
    about = {**_ATTRIBUTES.get(suffix, {}), **(attributes or {})}
    if pixels.dtype.kind == "u":
        about["oiio:UnassociatedAlpha"] = 1  # as it is here; else colours would be divided by it
    elif suffix == ".tif":
        del about["oiio:ColorSpace"]  # has no name there
    if suffix == ".jpg":
        about["compression"] = f"jpeg:{quality}"
    for name, value in about.items():
        if name == "chromaticities":
            spec.attribute(name, "float[8]", value)
        else:
            spec.attribute(name, value)

    with _scratch(suffix) as (name, content):
        output = oiio.ImageOutput.create(f"a{suffix}")
        if output is None:
            raise RuntimeError(oiio.geterror())
        fine = output.open(name, spec) and output.write_image(np.ascontiguousarray(pixels)) and output.close()
        if not fine:
            raise RuntimeError(" ".join(output.geterror().split()) or f"{suffix} could not be made")
        return content()


@contextmanager
def _scratch(suffix: str) -> Iterator[tuple[str, Any]]:
    """The name of a file in memory, where the system has such, and a function that gives its content.

    Where a disk is full, some encoders do not end, some end the process, and some say nothing.
    """
    if _MEMORY:
        with os.fdopen(os.memfd_create("stratalux"), "rb") as file:
            yield f"/proc/self/fd/{file.fileno()}", file.read
    else:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"a{suffix}"
            yield str(path), path.read_bytes
