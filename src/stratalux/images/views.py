"""View transforms: how linear light becomes a picture. One function each, by its name in :data:`VIEWS`.

Each takes linear Rec. 709 (H, W, 3), exposed so that 0.18 is middle grey, finite and not negative, and gives codes of
sRGB (IEC 61966-2-1), 1 for the largest; what is outside of 0 to 1 is cut off by the caller.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .colour import LUMINANCE

Pixels = NDArray[np.floating[Any]]

ACES_CONFIG = "ocio://cg-config-v2.2.0_aces-v1.3_ocio-v2.4"
"""Built into OpenColorIO since 2.4, with the names below; OpenImageIO brings that along."""
ACES_VIEW = ("sRGB - Display", "ACES 1.0 - SDR Video")
ACES_SOURCE = "Linear Rec.709 (sRGB)"

_AGX_STOPS = -12.47393, 4.026069
"""Base-2 logarithms of the darkest and the brightest."""
_AGX_CURVE = (15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232)
_AGX_IN = np.array(
    [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ],
    dtype=np.float32,
)
_AGX_OUT = np.array(
    [
        [1.19687900512017, -0.0980208811401368, -0.0990297440797205],
        [-0.0528968517574562, 1.15190312990417, -0.0989611768448433],
        [-0.0529716355144438, -0.0980434501171241, 1.15107367264116],
    ],
    dtype=np.float32,
)


def reinhard(linear: Pixels) -> Pixels:
    """Reinhard's extended operator on luminance (Reinhard et al. 2002, equation 4), white 16 times above middle white.

    Colours keep their hue, and middle grey its brightness.
    """
    luminance = (linear @ LUMINANCE)[..., None]
    white = 16.0
    linear = linear * (1 + luminance / white**2) / (1 + luminance)
    # Middle grey keeps its brightness: undo what the shoulder takes from it.
    return encode(linear * 1.18)


def standard(linear: Pixels) -> Pixels:
    """Plain sRGB: 1 is white, and what is brighter, too."""
    return encode(linear)


def filmic(linear: Pixels) -> Pixels:
    """The curve of Hable, of the game Uncharted 2 ("Filmic tonemapping for real-time rendering", course at SIGGRAPH
    2010): one stop comes before it, and white is 11.2."""
    return encode(_hable(2 * linear) / _hable(np.float32(11.2)))


def _hable(x: Any) -> Any:
    A, B, C, D, E, F = 0.15, 0.5, 0.1, 0.2, 0.02, 0.3
    return (x * (A * x + C * B) + D * E) / (x * (A * x + B) + D * F) - E / F


def aces(linear: Pixels) -> Pixels:
    """ACES 1.0, reference rendering and output transform for sRGB displays, as OpenColorIO computes them."""
    import OpenImageIO as oiio

    image = oiio.ImageBuf(np.ascontiguousarray(linear, dtype=np.float32))
    shown = oiio.ImageBufAlgo.ociodisplay(image, *ACES_VIEW, ACES_SOURCE, colorconfig=ACES_CONFIG)
    if shown.has_error:
        raise RuntimeError(shown.geterror())
    return np.asarray(shown.get_pixels(oiio.FLOAT))


def agx(linear: Pixels) -> Pixels:
    """AgX of Sobotka, its base look, in the approximation of Wrensch ("Minimal AgX implementation", 2024).

    A matrix that draws colours to grey, a curve over 16.5 stops of each channel, a polynomial here, and a matrix back.
    What comes out are codes already.
    """
    darkest, brightest = _AGX_STOPS
    stops = np.log2(np.maximum(linear.astype(np.float32) @ _AGX_IN.T, np.float32(2.0**darkest)))
    x = np.minimum((stops - np.float32(darkest)) / np.float32(brightest - darkest), 1)
    codes: Pixels = _horner(x) @ _AGX_OUT.T
    return codes


def _horner(x: NDArray[np.float32]) -> NDArray[np.float32]:
    y = np.full_like(x, _AGX_CURVE[0])
    for coefficient in _AGX_CURVE[1:]:
        y = y * x + np.float32(coefficient)
    return y


def neutral(linear: Pixels) -> Pixels:
    """Khronos PBR Neutral (Khronos Group, "PBR Neutral tone mapper specification", 2024): colours of surfaces stay
    what they are up to 0.8, but for the 0.04 that a dielectric reflects of itself; brighter ones go to white."""
    start, desaturation, reflected = np.float32(0.8 - 0.04), np.float32(0.15), np.float32(0.04)
    least = linear.min(axis=2, keepdims=True)
    colour = linear - np.where(least < 0.08, least - 6.25 * least * least, reflected)
    peak = colour.max(axis=2, keepdims=True)
    d = 1 - start
    compressed = 1 - d * d / (np.maximum(peak, start) + d - start)
    white = 1 - 1 / (desaturation * (peak - compressed) + 1)
    bright = colour * (compressed / np.maximum(peak, start)) * (1 - white) + compressed * white
    return encode(np.where(peak < start, colour, bright))


VIEWS: dict[str, Callable[[Pixels], Pixels]] = {
    "reinhard": reinhard,
    "standard": standard,
    "filmic": filmic,
    "aces": aces,
    "agx": agx,
    "neutral": neutral,
}


def encode(linear: Pixels) -> Pixels:
    """Linear values, 1 for white, as codes of sRGB (IEC 61966-2-1) from 0 to 1, cut off to what that has."""
    linear = np.clip(linear, 0, 1)
    codes: Pixels = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return codes
