"""Textures in KTX 2 files that are compressed with Basis Universal, decoded by the package opengl_basisu.

Source: Khronos Group, "KHR_texture_basisu".
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ....errors import InputError

BEGINNING = b"\xabKTX 20\xbb\r\n\x1a\n"
"""That of every KTX 2 file."""
_LARGEST = 16384
"""Texels along a side: no graphics card shows more."""
_MOST_COMPRESSED = 100_000
"""Bytes of texels to a byte of file that no compression reaches."""


def png_of(path: Path, name: str, data: bytes) -> bytes:
    """The bytes of a PNG file with the texels of the largest image of a KTX 2 file, red, green, blue and alpha.

    `path` and `name`: what messages call the document and the image. Raises :class:`InputError` for a damaged one.
    """
    try:
        import opengl_basisu
    except ImportError:
        raise InputError(
            f"{path}: {name}: compressed with Basis Universal, which needs another package: "
            "pip install 'stratalux[gltf]'"
        ) from None
    try:
        texture = opengl_basisu.open(data)
        width, height = texture.width, texture.height
        if max(width, height) > _LARGEST or 4 * width * height > _MOST_COMPRESSED * len(data):
            raise ValueError(f"{len(data)} bytes are no {width}x{height} texels")
        texels = texture.transcode("rgba8").data
    except Exception as error:  # of a class of its own, or of C++
        reason = " ".join(str(error).split())[:80]
        raise InputError(f"{path}: {name} cannot be decoded ({reason}); export it again") from None
    return _png(texels)


def _png(texels: npt.NDArray[Any]) -> bytes:
    """A PNG file of texels (H, W, 4), uint8. Source: W3C, "Portable Network Graphics", sections 5 and 11."""
    height, width, _ = texels.shape
    rows = np.zeros((height, 1 + 4 * width), np.uint8)  # each begins with the number of its filter: none
    rows[:, 1:] = texels.reshape(height, -1)

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    body = zlib.compress(rows.tobytes(), 1)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", body) + chunk(b"IEND", b"")
