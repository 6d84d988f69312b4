"""Pixels as text for a page: half floats, predicted, compressed, in base 64. ``pixels.js`` reads them.

OpenEXR compresses in much the same way: what neighbours share is subtracted, low bytes and high bytes are kept apart,
and DEFLATE does the rest. Here, too, red and blue are stored as differences from green, since noise is mostly grey. A
noisy image takes about 3.5 bytes a pixel before base 64.
"""

from __future__ import annotations

import base64
import gzip

import numpy as np
from numpy.typing import NDArray

LARGEST_HALF = 65504.0


def encode_pixels(image: NDArray[np.float32]) -> tuple[str, float]:
    """Linear pixels (H, W, 3) as text, and the power of two that decoded values have to be multiplied by.

    Precise to 2^-11 of a value, or to 2^-25 of that power. Infinities and NaN stay what they are.
    """
    finite = np.abs(image[np.isfinite(image)])
    largest = float(finite.max()) if finite.size else 0.0
    scale = 2.0 ** max(0, int(np.ceil(np.log2(largest / LARGEST_HALF)))) if largest > 0 else 1.0
    codes = (image / np.float32(scale)).astype(np.float16).view(np.uint16)
    red, green, blue = (codes[..., channel] for channel in range(3))
    # Unsigned integers wrap around, and wrap back in the decoder.
    planes = np.stack([green, red - green, blue - green])
    steps = np.diff(planes, axis=2, prepend=np.uint16(0)).view(np.int16).astype(np.int32)
    # Zigzag: small steps of either sign get a high byte of zero.
    folded = ((steps << 1) ^ (steps >> 15)).astype(np.uint16)
    return compress(np.concatenate([(folded & 255).ravel(), (folded >> 8).ravel()]).astype(np.uint8)), scale


def decode_pixels(text: str, height: int, width: int, scale: float) -> NDArray[np.float32]:
    """What the page makes of the text of :func:`encode_pixels`: pixels (H, W, 3)."""
    low, high = decompress(text).reshape(2, -1).astype(np.int32)
    folded = low | high << 8
    steps = ((folded >> 1) ^ -(folded & 1)).astype(np.uint16).reshape(3, height, width)
    green, red, blue = np.cumsum(steps, axis=2, dtype=np.uint16)
    codes = np.stack([red + green, green, blue + green], axis=-1)
    return np.ascontiguousarray(codes).view(np.float16).astype(np.float32) * np.float32(scale)


def encode_unit(values: NDArray[np.float32]) -> str:
    """Values (H, W) in [0, 1] as text, in steps of 1/255."""
    return compress((np.clip(np.nan_to_num(values), 0, 1) * 255 + 0.5).astype(np.uint8))


def compress(data: NDArray[np.uint8]) -> str:
    """Bytes as text. The same bytes give the same text."""
    return base64.b64encode(gzip.compress(data.tobytes(), compresslevel=6, mtime=0)).decode("ascii")


def decompress(text: str) -> NDArray[np.uint8]:
    return np.frombuffer(gzip.decompress(base64.b64decode(text)), dtype=np.uint8)
