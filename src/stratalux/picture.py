"""Pictures of partitions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .envmap import EnvironmentMap
from .image import tonemap
from .regions import Regions

_BORDER = (120, 255, 90)
_MIN_WIDTH = 1024


def draw_regions(environment: EnvironmentMap, regions: Regions, exposure: float | None = None) -> NDArray[np.uint8]:
    """The tone-mapped map with the borders of the regions on it (figure 1), 8-bit sRGB; small maps are enlarged."""
    height, width = regions.shape
    zoom = max(1, -(-_MIN_WIDTH // width))
    picture = np.repeat(np.repeat(tonemap(environment.texels, exposure), zoom, axis=0), zoom, axis=1)
    # A border runs through texel centres, so half a texel in from the corner of its texel.
    for y0, y1, x0, x1 in (regions.bounds * zoom + zoom // 2).tolist():
        picture[y0 : y1 + 1, x0] = picture[y0 : y1 + 1, min(x1, width * zoom - 1)] = _BORDER
        picture[y0, x0 : x1 + 1] = picture[min(y1, height * zoom - 1), x0 : x1 + 1] = _BORDER
    return picture
