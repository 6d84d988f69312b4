"""HDR-FLIP beside pictures, where it is installed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..images.metrics import flip_map, why_no_flip
from ..report.model import Picture


def with_flip(picture: Picture, reference: NDArray[np.float32]) -> Picture:
    """``picture`` with its difference from ``reference`` as a person sees it."""
    if why_no_flip() is not None:
        return picture
    differences = flip_map(picture.image, reference)
    if differences is None:
        return picture
    facts = picture.facts | {"FLIP": f"{differences.mean(dtype=np.float64):.4f}"}
    return replace(picture, flip=differences, facts=facts)
