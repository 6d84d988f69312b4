"""Figure 5: a glossy Buddha; highlights that directional lights miss, noise with one proposal and with fifty."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

import numpy as np
from numpy.typing import NDArray

from ..comparison.study import Study
from ..images.colour import LUMINANCE
from ..images.metrics import Mask
from ..report.model import Claim, ImageSet, Picture, Section, Table
from .banding import Quality, quality
from .buddha import crops, masks, masks_work
from .facts import picture_facts
from .flips import with_flip
from .item import Item
from .measure import REFERENCE_PASSES, Judge, Outcome, contest, contest_work, make_reference, reference_work
from .pinned import importance_mis, stratified, structured
from .scenes import ALPHA, EXPONENT, Frame, Subject, Workbench
from .settings import Settings
from .verdicts import SIGMAS, all_of, by_size, when

RAYS = 32
TECHNIQUES = (structured(RAYS), stratified(RAYS), stratified(RAYS, 50))
BRIGHTEST = (0.01, 0.05, 0.2)
"""Parts of the Buddha's pixels, the brightest of the reference, that may be called its highlights."""
_MISSED = 0.9
"""Highlights count as missed if less than this part of their light is there."""
_NOISY = 0.1
"""Noise counts as significant from this part of the mean radiance on."""
_GREATLY = 1.5
"""Noise is greatly reduced if the RMSE falls by more than this factor."""


def _frame(settings: Settings) -> Frame:
    return Frame(Subject("buddha", "glossy"), settings.size)


def work(settings: Settings) -> dict[str, float]:
    frame = _frame(settings)
    reference = reference_work(frame, importance_mis(settings.reference_samples // REFERENCE_PASSES))
    return {"fig5": masks_work() + reference + contest_work(frame, TECHNIQUES, settings.seeds)}


def run(study: Study, bench: Workbench) -> Section:
    settings = bench.settings
    frame = _frame(settings)
    regions = masks(study, bench, frame)
    technique = importance_mis(settings.reference_samples // REFERENCE_PASSES)
    reference = make_reference(study, bench, "fig5-reference", frame, technique)
    thing = regions.get("object", next(iter(regions.values()), np.ones(reference.image.shape[:2], dtype=bool)))
    judge = Judge(reference, {"object": thing})
    outcomes = contest(study, bench, "fig5", frame, TECHNIQUES, settings.seeds, judge, ("image", "mean", "variance"))
    qualities = [
        quality(o.mean, o.variance, settings.seeds, reference.image, reference.standard_error, thing, SIGMAS)
        for o in outcomes
    ]
    lights = [highlights(reference.image, thing, part) for part in BRIGHTEST]
    caught = [[captured(o.image, reference.image, light) for light in lights] for o in outcomes]
    pictures = ImageSet(
        f"Glossy Buddha, {RAYS} samples per shading point",
        tuple(with_flip(Picture(o.technique.label, o.image, picture_facts(o)), reference.image) for o in outcomes),
        reference=Picture("reference", reference.image),
        crops=crops(thing),
        text=f"The reference has {settings.reference_samples:,} samples per shading point, half of them of the BSDF "
        "under multiple importance sampling: samples of the map alone converge too slowly here.",
    )
    return Section(
        "fig5",
        ITEM.title,
        (
            f"The paper's Cook-Torrance material with a specular exponent of {EXPONENT} is Mitsuba's roughconductor "
            f"with Beckmann's distribution, that of Cook and Torrance, and roughness {ALPHA:.2f}: a Blinn-Phong "
            "exponent n has about the lobe of a Beckmann roughness of sqrt(2 / (n + 2)). Metal: aluminium. "
            f"{frame.size[0]}x{frame.size[1]}, one fixed camera ray in each pixel.",
        ),
        _claims(outcomes, qualities, caught),
        (pictures, _table(outcomes, qualities, caught)),
    )


def highlights(image: NDArray[np.floating], mask: Mask, part: float) -> Mask:
    """The brightest ``part`` of the pixels of ``mask`` (H, W) in ``image`` (H, W, 3), at least one."""
    luminance = np.where(mask, np.asarray(image, dtype=np.float64) @ LUMINANCE, -np.inf)
    count = max(1, round(part * int(mask.sum())))
    chosen = np.zeros(mask.size, dtype=bool)
    chosen[np.argsort(-luminance.ravel(), kind="stable")[:count]] = True
    return chosen.reshape(mask.shape)


def captured(image: NDArray[np.floating], reference: NDArray[np.floating], mask: Mask) -> float:
    """How much of the reference's light in ``mask`` the image has, in [0, 1]: the sum of the smaller luminance of both.

    Light in excess at one pixel does not make up for light that is missing at another.
    """
    ours, truth = (np.asarray(a, dtype=np.float64)[mask] @ LUMINANCE for a in (image, reference))
    return float(np.minimum(ours, truth).sum() / truth.sum()) if truth.sum() > 0 else float("nan")


def _claims(outcomes: list[Outcome], qualities: list[Quality], caught: list[list[float]]) -> tuple[Claim, ...]:
    _, single, many = outcomes
    noise = [a / b for a, b in zip(single.rmse["object"], many.rmse["object"], strict=True)]
    where = f"of the light of the brightest {_percent(BRIGHTEST)} of the Buddha's pixels"
    return (
        Claim(
            f"Structured sampling with {RAYS} lights gives an image without noise",
            "picture only",
            f"noise {100 * qualities[0].noise:.2f} % of the mean",
            when(qualities[0].noise == 0),
            "Holds if renderings with different seeds are the same.",
        ),
        Claim(
            "It fails to catch part of the highlights",
            "picture only",
            f"{_percent(caught[0])} {where}",
            all_of([when(part < _MISSED) for part in caught[0]]),
            f"Holds if each is less than {100 * _MISSED:.0f} %, partly if some are. Pixel by pixel, the smaller of "
            "image and reference: too much light in one place does not make up for too little in another.",
        ),
        Claim(
            "One proposal (M = 1) leaves significant noise on the glossy surface",
            "picture only",
            f"noise {100 * qualities[1].noise:.0f} % of the mean; relMSE {median(single.relmse['object']):.4f}",
            when(qualities[1].noise > _NOISY),
            f"Holds if the RMS standard deviation is above {100 * _NOISY:.0f} % of the mean radiance of the Buddha.",
        ),
        Claim(
            "Fifty proposals (M = 50) greatly reduce the noise",
            "picture only",
            f"RMSE {median(noise):.2f} times lower; relMSE {median(many.relmse['object']):.4f}; "
            f"{many.time / max(single.time, 1e-9):.0f} times the render time",
            by_size(noise, _GREATLY),
            f"At equal rays. Holds if every rendering's RMSE falls by more than a factor of {_GREATLY}, partly if it "
            "falls in the median.",
        ),
        Claim(
            "Fifty proposals catch more highlights than structured sampling",
            "picture only",
            f"{_percent(caught[2])} against {_percent(caught[0])} {where}",
            all_of([when(many > fixed) for many, fixed in zip(caught[2], caught[0], strict=True)]),
            f"One rendering; holds if it is more in each case. M = 1: {_percent(caught[1])}. At its brightest pixels, "
            "where a light is mirrored, structured sampling shows too much light rather than too little.",
        ),
    )


def _percent(parts: Sequence[float]) -> str:
    return ", ".join(f"{100 * part:.0f} %" for part in parts)


def _table(outcomes: list[Outcome], qualities: list[Quality], caught: list[list[float]]) -> Table:
    rows = tuple(
        (
            o.technique.label,
            f"{median(o.rmse['object']):.4f}",
            f"{median(o.relmse['object']):.4f}",
            f"{100 * q.bias:.1f} %" + ("" if q.bias_seen else " (chance)"),
            f"{100 * q.noise:.1f} %",
            _percent(part),
            f"{o.time:.3g}",
        )
        for o, q, part in zip(outcomes, qualities, caught, strict=True)
    )
    return Table(
        "The Buddha's pixels",
        ("", "RMSE", "relMSE", "bias", "noise", "highlights caught", "seconds"),
        rows,
        "Errors and seconds: medians. Bias and noise over the mean radiance. Highlights: of the light of the brightest "
        f"{_percent(BRIGHTEST)} of the pixels, the part that one rendering has in the right place.",
    )


ITEM = Item("fig5", "Figure 5: glossy Buddha, highlights and proposals", ("grace", "buddha"), work, run)
