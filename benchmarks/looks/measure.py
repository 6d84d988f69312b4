"""How far two pictures of a file are from each other."""

from __future__ import annotations

import numpy as np

from stratalux.images.metrics import flip_map

from .ours import Passes

_SOME, _ALL = 1e-3, 0.999


def differences(ours: Passes, theirs: Passes) -> dict[str, float]:
    """Means over the pixels in which one or the other has a surface, or for the first two, both have nothing else.

    ``base``: |difference| of the channels of base colours; ``normals``: that of normals (x, y, z); ``coverage``: of the
    part of a pixel that is surface, where rims are off; ``flip``: HDR-FLIP of the pictures, and ``single`` that without
    what microfacets scatter more than once; ``ratio``: of the brightness, ours by theirs.
    """
    inside = (ours.coverage > _ALL) & (theirs.coverage > _ALL)
    there = (ours.coverage > _SOME) | (theirs.coverage > _SOME)

    def flip(reference: np.ndarray) -> float:
        errors = flip_map(ours.picture, reference)
        assert errors is not None
        return float(errors[there].mean(dtype=np.float64))

    def mean(a: np.ndarray, b: np.ndarray, where: np.ndarray) -> float:
        return float(np.abs(a.astype(np.float64) - b)[where].mean())

    return {
        "base": mean(ours.base, theirs.base, inside),
        "normals": 2 * mean(ours.normals, theirs.normals, inside),
        "coverage": mean(ours.coverage, theirs.coverage, there),
        "flip": flip(theirs.picture),
        "single": flip(theirs.picture if theirs.single is None else theirs.single),
        "ratio": float(ours.picture[there].mean(dtype=np.float64) / theirs.picture[there].mean(dtype=np.float64)),
    }
