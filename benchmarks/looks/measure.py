"""How far two pictures of a file are from each other."""

from __future__ import annotations

import numpy as np

from stratalux.images.metrics import flip_map

from .ours import Passes

_SOME = 1e-3


def differences(ours: Passes, theirs: Passes) -> dict[str, float]:
    """Means over the pixels in which one or the other has a surface.

    ``base``: |difference| of the channels of base colours; ``normals``: that of normals (x, y, z); ``coverage``: of the
    part of a pixel that is surface; ``flip``: HDR-FLIP of the pictures, and ``single`` that without what microfacets
    scatter more than once; ``ratio``: of the brightness, ours by theirs.
    """
    there = (ours.coverage > _SOME) | (theirs.coverage > _SOME)

    def flip(reference: np.ndarray) -> float:
        errors = flip_map(ours.picture, reference)
        assert errors is not None
        return float(errors[there].mean(dtype=np.float64))

    def mean(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.abs(a.astype(np.float64) - b)[there].mean())

    return {
        "base": mean(ours.base, theirs.base),
        "normals": 2 * mean(ours.normals, theirs.normals),
        "coverage": mean(ours.coverage, theirs.coverage),
        "flip": flip(theirs.picture),
        "single": flip(theirs.picture if theirs.single is None else theirs.single),
        "ratio": float(ours.picture[there].mean(dtype=np.float64) / theirs.picture[there].mean(dtype=np.float64)),
    }
