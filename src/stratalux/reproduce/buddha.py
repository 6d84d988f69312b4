"""The view of the Happy Buddha that figures 3 and 4 share: its frame, its reference and its pixels."""

from __future__ import annotations

import numpy as np

from ..comparison.reference import Reference
from ..comparison.study import Study
from ..images.metrics import Mask
from ..report.model import Crop
from .measure import REFERENCE_PASSES, make_reference, reference_work
from .pinned import importance
from .scenes import Frame, Subject, Workbench
from .settings import Settings

_MASK_WORK = 0.5


def diffuse_frame(settings: Settings) -> Frame:
    """One camera ray for each pixel: samples of a shading point are samples of a pixel, as in the paper's counts."""
    return Frame(Subject("buddha"), settings.size)


def diffuse_reference(study: Study, bench: Workbench) -> Reference:
    """The paper's reference: standard importance sampling with 10,000 samples per shading point."""
    technique = importance(bench.settings.reference_samples // REFERENCE_PASSES)
    return make_reference(study, bench, "buddha-reference", diffuse_frame(bench.settings), technique)


def diffuse_work(settings: Settings) -> dict[str, float]:
    """Of the reference and the masks of the diffuse Buddha, which figures 3 and 4 share."""
    technique = importance(settings.reference_samples // REFERENCE_PASSES)
    return {"buddha": reference_work(diffuse_frame(settings), technique) + _MASK_WORK}


def masks(study: Study, bench: Workbench, frame: Frame) -> dict[str, Mask]:
    """``surface``, object and ground, and ``object``, the object alone."""
    hits = study.step(
        "buddha-masks",
        bench.fingerprint(frame),
        _MASK_WORK,
        lambda fraction: {name: getattr(bench.view(frame).hits(), name) for name in ("surface", "object")},
    )
    return nonempty({name: hits[name] for name in ("object", "surface")})


def crops(mask: Mask) -> tuple[Crop, ...]:
    """The Buddha in the picture, with a margin, if he is in it."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return ()
    margin = mask.shape[0] // 40
    left, top = max(0, int(columns[0]) - margin), max(0, int(rows[0]) - margin)
    right, bottom = min(mask.shape[1], int(columns[-1]) + 1 + margin), min(mask.shape[0], int(rows[-1]) + 1 + margin)
    return (Crop("the Buddha", left, top, right, bottom),)


def masks_work() -> float:
    return _MASK_WORK


def nonempty(named: dict[str, Mask]) -> dict[str, Mask]:
    """Without the masks that no pixel is in: an error over none of them means nothing."""
    return {name: mask for name, mask in named.items() if np.any(mask)}
