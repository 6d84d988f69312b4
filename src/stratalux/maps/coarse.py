"""A density for directions that is about that of the map, in a table that is much smaller."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..images.colour import LUMINANCE
from ..images.half import single

_HEIGHT, _WIDTH = 2048, 4096
"""Of blocks of texels, at most."""
_FLOOR = 0.01
"""Added everywhere, in units of the mean: light in less than a texel is not missed where all around it is black."""


def coarse_density(texels: NDArray[Any]) -> NDArray[np.float32]:
    """Numbers in proportion to luminance times sin θ, (K + 1, L + 1); the density over (u, v) is bilinear between them.

    The first row and column are at 0, the last ones at 1. Each is the mean of the four blocks of texels (H, W, 3)
    around it, so that all light is in reach of the density. What is not (sin θ), it is not either.
    """
    height, width = texels.shape[:2]
    rows, columns = (
        np.unique(np.linspace(0, n, min(n, most) + 1).astype(np.int64))
        for n, most in ((height, _HEIGHT), (width, _WIDTH))
    )
    means = np.empty((len(rows) - 1, len(columns) - 1))
    for k, (first, last) in enumerate(pairwise(rows.tolist())):
        luminance = (single(texels[first:last]) @ LUMINANCE).sum(axis=0, dtype=np.float64)
        means[k] = np.add.reduceat(luminance, columns[:-1]) / ((last - first) * np.diff(columns))
    around = np.pad(means, ((1, 1), (0, 0)), mode="edge")
    around = np.concatenate([around[:, -1:], around, around[:, :1]], axis=1)
    nodes = around[:-1, :-1] + around[:-1, 1:] + around[1:, :-1] + around[1:, 1:]
    nodes += (_FLOOR * nodes.mean()) or 1.0
    sin_θ = np.sin(np.linspace(0, np.pi, len(nodes)))
    sin_θ[-1] = 0
    nodes *= sin_θ[:, None]
    return (nodes / nodes.max()).astype(np.float32)
