"""Colours of maps: a few anchors each, between which Python and the page's script interpolate alike."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MAGMA = (
    "000004 0a0822 1d1147 36106b 51127c 6a1c81 832681 9c2e7f b73779 "
    "d0416f e75263 f56b5c fc8961 fea772 fec488 fde2a3 fcfdbf"
)
"""17 values of the colour map of that name (Smith and van der Walt 2015), sampled from matplotlib; FLIP's own map."""
VIRIDIS = (
    "440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c "
    "1fa088 28ae80 3fbc73 5ec962 84d44b addc30 d8e219 fde725"
)
"""As :data:`MAGMA`."""
SIGNED = "00366b 0072b2 6fb1dc f4f4f2 f0a265 d55e00 7a2f00"
"""Blue for too dark, orange for too bright: told apart with any colour vision. The middle is zero."""


def interpolate(anchors: str, t: NDArray[np.floating]) -> NDArray[np.uint8]:
    """8-bit sRGB colours (..., 3) of values in [0, 1]."""
    table = np.array([[int(colour[k : k + 2], 16) for k in (0, 2, 4)] for colour in anchors.split()], dtype=float)
    steps = np.linspace(0, 1, len(table))
    return np.stack([np.interp(t, steps, table[:, channel]) + 0.5 for channel in range(3)], axis=-1).astype(np.uint8)
