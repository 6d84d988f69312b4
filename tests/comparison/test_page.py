"""The report of a comparison, of made-up records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stratalux import Comparison
from stratalux.comparison.page import comparison_report
from stratalux.comparison.records import Entry, Errors, Record, Spread
from stratalux.comparison.reference import Reference
from stratalux.images.metrics import why_no_flip
from stratalux.integrators.techniques import Technique
from stratalux.report.html import render_report
from stratalux.report.model import Chart, HeatMap, ImageSet, Table

SHAPE = (40, 60, 3)
FAST = Entry("fast:k=2", Technique("fast", "p", "a fast one", "A. Author 2020", True), {"k": 2}, "fast")
SLOW = Entry("slow", Technique("slow", "q", "a slow one", "B. Author 2021", False), {}, "slow")


def record(entry: Entry, rays: int, seconds: float, error: float, budget: float | None = None) -> Record:
    spread = Spread((error, 0.8 * error, 1.5 * error))
    image = np.full(SHAPE, 0.2, dtype=np.float32)
    image[30:, 50:] += np.float32(error)
    errors = Errors(spread, spread, 0.1, 1 / (seconds * error), reference_limited=error < 0.01)
    times = Spread((seconds,) * 3)
    return Record(
        entry, rays, {"type": "p"}, 4, rays, 2400, times, 0.0, 0.0, budget, {"image": errors}, image, entry.stem
    )


@pytest.fixture
def comparison() -> Comparison:
    reference = Reference(
        np.full(SHAPE, 0.2, dtype=np.float32),
        np.full(SHAPE, 0.01, dtype=np.float32),
        {"type": "path"},
        64,
        16,
        2.0,
        "k",
    )
    parts = [
        tuple(
            record(entry, rays, seconds * rays, error / rays, budget)
            for rays in (4, 8, 16)
            for entry, seconds, error in ((FAST, 0.1, 0.4), (SLOW, 0.2, 0.8))
        )
        for budget in (None, 1.0)
    ]
    settings = {"scene": "room", "variant": "llvm_ad_rgb", "width": 60, "height": 40, "repeats": 3, "rays": [4, 8, 16]}
    none = np.zeros(SHAPE[:2], dtype=bool)
    return Comparison((FAST, SLOW), (4, 8, 16), reference, none, parts[0], parts[1], settings, ["Mind the gap."])


def test_the_summary_names_the_best(comparison: Comparison) -> None:
    report = comparison_report(comparison)
    assert "room" in report.title and "60x40" in report.subtitle and report.notes == ("Mind the gap.",)
    assert report.summary[0] == "At equal time, with 16 rays, fast:k=2 reaches a relative MSE of 0.025 in 1.6 s."
    assert report.summary[1].startswith("It is 4 times as efficient as slow, whose error is partly bias")
    assert "the whole image" in report.summary[-1] and "64 samples" in report.summary[-1]
    assert "path" in report.facts["reference"] and "core" in report.facts["machine"]


def test_both_parts_have_curves_pictures_and_figures(comparison: Comparison) -> None:
    report = comparison_report(comparison)
    time, rays, techniques = report.sections
    for section in (time, rays):
        chart, few, many, heat, figures = section.blocks
        assert isinstance(chart, Chart) and [curve.dashed for curve in chart.curves] == [False, True]
        assert chart.curves[1].name == "slow (biased)" and chart.floor
        assert chart.curves[0].points[-1][1:] == pytest.approx((0.4 / 16, 0.02, 0.0375))
        assert isinstance(few, ImageSet) and isinstance(many, ImageSet) and "16 rays" in many.title
        assert [picture.name for picture in few.pictures] == ["fast:k=2", "slow (biased)"]
        assert few.reference and (few.pictures[0].flip is None) is (why_no_flip() is not None)
        assert isinstance(heat, HeatMap) and heat.values.shape == (2, 3) and not heat.lower_is_better
        assert isinstance(figures, Table) and len(figures.rows) == 6
        crop = few.crops[0]
        assert crop.left >= 48 - 10 and crop.right > 50 and crop.bottom > 30  # where the errors are
    assert isinstance(rays.blocks[0], Chart) and [p[0] for p in rays.blocks[0].curves[0].points] == [16, 32, 64]
    assert isinstance(techniques.blocks[0], Table) and techniques.blocks[0].rows[0][2] == "k=2"


def test_the_page_can_be_made(comparison: Comparison) -> None:
    text = render_report(comparison_report(comparison))
    assert "Comparison: room" in text and text.count('class="viewer-data"') == 4


def test_figures_that_do_not_exist(comparison: Comparison) -> None:
    broken = [
        replace(r, errors={"image": replace(r.errors["image"], efficiency=float("inf"), flip=None)})
        for r in comparison.equal_time
    ]
    images = [replace(r, image=np.full(SHAPE, np.nan, dtype=np.float32)) for r in comparison.equal_rays]
    odd = replace(comparison, equal_time=tuple(broken), equal_rays=tuple(images))
    text = render_report(comparison_report(odd))
    assert "Comparison: room" in text


def test_the_unbiased_are_ranked(comparison: Comparison) -> None:
    slow = replace(SLOW, technique=replace(SLOW.technique, unbiased=True))
    records = tuple(replace(r, entry=slow) if r.entry is SLOW else r for r in comparison.equal_time)
    report = comparison_report(replace(comparison, equal_time=records))
    assert "fast:k=2 is the most efficient: 4 times as efficient as slow. It reaches" in report.summary[0]


def test_one_technique_is_compared_with_none(comparison: Comparison) -> None:
    alone = replace(
        comparison,
        entries=(FAST,),
        equal_rays=tuple(r for r in comparison.equal_rays if r.entry is FAST),
        equal_time=tuple(r for r in comparison.equal_time if r.entry is FAST),
    )
    assert "fast:k=2 reaches a relative MSE of 0.025" in comparison_report(alone).summary[0]
