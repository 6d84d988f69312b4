"""The report of a comparison."""

from __future__ import annotations

import datetime
import json
import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..images.metrics import RELATIVE_EPSILON, flip_map, why_no_flip
from ..report.model import Chart, Crop, Curve, HeatMap, ImageSet, Picture, Report, Section, Table
from ..report.text import number
from .findings import Findings
from .provenance import machine, versions
from .records import Entry, Record

_REGIONS = {"surface": "the pixels that are all surface", "image": "the whole image"}
_CROP = 5
"""The crop is one part in so many of the image, in each direction."""
_FIGURES = ("rays", "technique", "spp", "seconds", "relMSE", "FLIP", "efficiency", "vs best")


def comparison_report(comparison: Findings) -> Report:
    """Curves, figures and pictures at equal shadow rays and at equal time.

    Pictures are those of the smallest and the largest number of rays.
    """
    settings, region = comparison.settings, _REGIONS[comparison.region]
    size = f"{settings['width']}x{settings['height']}"
    names = ", ".join(entry.name for entry in comparison.entries)
    reference = comparison.reference
    return Report(
        title=f"Comparison: {settings['scene']}",
        subtitle=f"{names}; {', '.join(map(str, comparison.rays))} rays per shading point; {size} pixels",
        summary=(
            *_verdicts(comparison),
            f"Errors are relative MSE over {region}, against a reference of {reference.spp} samples per pixel that "
            "none of the techniques made. Efficiency is 1 / (seconds · relative MSE): twice as much halves the time.",
        ),
        sections=(
            _part(
                comparison,
                "equal-time",
                "Equal time",
                "At each number of rays, all are allowed the median of the times that they take at equal shadow rays: "
                "they get as many samples per pixel as take so long, and at least one.",
                comparison.equal_time,
                ("rendering time in seconds", lambda record: record.seconds.median),
            ),
            _part(
                comparison,
                "equal-rays",
                "Equal shadow rays",
                "All may trace the same number of shadow rays in a pixel, however long that takes.",
                comparison.equal_rays,
                ("shadow rays per pixel", lambda record: float(record.rays_per_pixel)),
            ),
            Section("techniques", "Techniques", blocks=(_techniques(comparison.entries),)),
        ),
        facts=_facts(comparison),
        notes=tuple(comparison.notes),
    )


def _verdicts(comparison: Findings) -> list[str]:
    """Who is the most efficient at equal time, at the largest number of rays, and by how much.

    Biased techniques are named apart: more samples do not bring them to the right image.
    """
    rays = comparison.rays[-1]
    ranked = [(r.errors[comparison.region].efficiency, r) for r in comparison.equal_time if r.rays == rays]
    ranked = sorted((pair for pair in ranked if 0 < pair[0] < math.inf), key=lambda pair: -pair[0])
    unbiased = [pair for pair in ranked if pair[1].entry.technique.unbiased]
    biased = [pair for pair in ranked if not pair[1].entry.technique.unbiased]
    if not ranked:
        return []
    efficiency, best = (unbiased or biased)[0]
    error = number(best.errors[comparison.region].relative_mse.median)
    reached = f"a relative MSE of {error} in {number(best.seconds.median)} s"

    def beside(others: Sequence[tuple[float, Record]]) -> str:
        return ", ".join(f"{efficiency / other:.2g} times as efficient as {r.entry.name}" for other, r in others)

    if len(unbiased or biased) == 1:
        sentences = [f"At equal time, with {rays} rays, {_name(best.entry)} reaches {reached}."]
    else:
        what = "the most efficient unbiased technique" if unbiased and biased else "the most efficient"
        others = beside((unbiased or biased)[1:])
        sentences = [f"At equal time, with {rays} rays, {_name(best.entry)} is {what}: {others}. It reaches {reached}."]
    if unbiased and biased:
        sentences.append(
            f"It is {beside(biased)}, whose error is partly bias, which more samples do not remove: look at the images."
        )
    return sentences


def _part(
    comparison: Findings,
    anchor: str,
    title: str,
    text: str,
    records: Sequence[Record],
    abscissa: tuple[str, Callable[[Record], float]],
) -> Section:
    """Curves, a heat map and figures of ``records``, and their pictures. ``abscissa``: label, and value of a record."""
    region = comparison.region
    label, place = abscissa
    curves = []
    for entry in comparison.entries:
        mine = [(place(record), record.errors[region].relative_mse) for record in records if record.entry is entry]
        points = sorted((x, error.median, error.minimum, error.maximum) for x, error in mine)
        curves.append(Curve(_name(entry), tuple(points), dashed=not entry.technique.unbiased))
    floor = comparison.reference.relative_mse_floor(comparison.mask(region))
    chart = Chart(
        title=f"Error over {label}",
        x_label=label,
        y_label=f"relative MSE, {_REGIONS[region]}",
        curves=tuple(curves),
        floor=(floor, "noise of the reference") if floor > 0 else None,
        text="Bars reach from the best to the worst repeat; dotted curves are biased.",
    )
    efficiencies = {(r.entry.name, r.rays): r.errors[region].efficiency for r in records}
    heat = HeatMap(
        title="Efficiency",
        x_label="rays per shading point",
        y_label="techniques",
        columns=tuple(map(str, comparison.rays)),
        rows=tuple(_name(entry) for entry in comparison.entries),
        values=np.array(
            [[efficiencies.get((entry.name, n), math.nan) for n in comparison.rays] for entry in comparison.entries]
        ),
        unit="1/s",
        lower_is_better=False,
    )
    figures = Table(
        title="Figures",
        header=_FIGURES,
        rows=tuple(_figures(comparison, record) for record in records),
        text=f"Medians of {comparison.settings['repeats']} repeat(s). * the reference's own noise limits the error.",
    )
    shown = sorted({comparison.rays[0], comparison.rays[-1]})
    images = [_images(comparison, title, n, [record for record in records if record.rays == n]) for n in shown]
    return Section(anchor, title, (text,), blocks=(chart, *images, heat, figures))


def _figures(comparison: Findings, record: Record) -> tuple[str, ...]:
    errors = record.errors[comparison.region]
    return (
        str(record.rays),
        _name(record.entry),
        str(record.spp),
        number(record.seconds.median),
        number(errors.relative_mse.median) + (" *" if errors.reference_limited else ""),
        "–" if errors.flip is None else f"{errors.flip:.4f}",
        number(errors.efficiency),
        f"{comparison.relative_to_best(record):.2f}",
    )


def _images(comparison: Findings, title: str, rays: int, records: Sequence[Record]) -> ImageSet:
    truth = _colour(comparison.reference.image)
    pictures = []
    for record in records:
        image = _colour(record.image)
        errors = record.errors[comparison.region]
        facts = {
            "relative MSE": number(errors.relative_mse.values[0]),
            **({} if errors.flip is None else {"FLIP": f"{errors.flip:.4f}"}),
            "seconds": number(record.seconds.values[0]),
            "samples per pixel": str(record.spp),
            "shadow rays per pixel": str(record.rays_per_pixel),
        }
        flip = flip_map(image, truth) if why_no_flip() is None else None
        pictures.append(Picture(_name(record.entry), image, facts, flip))
    reference = Picture("reference", truth, {"samples per pixel": str(comparison.reference.spp)})
    return ImageSet(
        title=f"{title}, {rays} rays",
        pictures=tuple(pictures),
        reference=reference,
        exposure=comparison.exposure,
        crops=_crops(pictures, truth),
        text="The first repeat of each.",
    )


def _crops(pictures: Sequence[Picture], truth: NDArray[np.float32]) -> tuple[Crop, ...]:
    """Where the techniques together err most: the rectangle with the largest sum of relative errors."""
    height, width = (max(1, n // _CROP) for n in truth.shape[:2])
    if min(height, width) < 8:
        return ()
    scale = np.sqrt(truth.astype(np.float64) ** 2 + RELATIVE_EPSILON)
    with np.errstate(invalid="ignore"):  # an image that is not finite is no reason to look there
        error = sum(np.abs(picture.image - truth) / scale for picture in pictures)
    error = np.nan_to_num(np.asarray(error).sum(axis=2), posinf=0.0)
    sums = np.pad(error.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    boxes = sums[height:, width:] - sums[:-height, width:] - sums[height:, :-width] + sums[:-height, :-width]
    top, left = (int(k) for k in np.unravel_index(np.argmax(boxes), boxes.shape))
    return (Crop("largest errors", left, top, left + width, top + height),)


def _techniques(entries: Sequence[Entry]) -> Table:
    return Table(
        title="What they are",
        header=("name", "technique", "given", "unbiased", "source"),
        rows=tuple(
            (
                entry.name,
                entry.technique.summary,
                ", ".join(f"{key}={value}" for key, value in entry.given.items()) or "–",
                "yes" if entry.technique.unbiased else "no",
                entry.technique.source,
            )
            for entry in entries
        ),
    )


def _facts(comparison: Findings) -> dict[str, str]:
    settings, reference = comparison.settings, comparison.reference
    given = {name: value for name, value in settings.items() if name not in ("width", "height", "rays")}
    floor = number(reference.relative_mse_floor(comparison.mask(comparison.region)))
    return {
        "size": f"{settings['width']}x{settings['height']} pixels",
        "rays per shading point": ", ".join(map(str, comparison.rays)),
        **{name: str(value) for name, value in given.items()},
        "reference": f"{json.dumps(reference.estimator)}, {reference.spp} samples per pixel in {reference.passes} "
        f"passes, made in {number(reference.seconds)} s; its own relative MSE is {floor}",
        "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
        "machine": machine(gpu=settings["variant"].startswith("cuda")),
        "versions": ", ".join(f"{name} {version}" for name, version in versions().items() if version),
    }


def _name(entry: Entry) -> str:
    return entry.name + ("" if entry.technique.unbiased else " (biased)")


def _colour(image: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.repeat(image, 3, axis=2) if image.shape[2] == 1 else image
