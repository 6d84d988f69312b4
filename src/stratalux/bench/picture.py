"""The benchmark as a picture: the speed-up of every case by material, and error against time in a few of them."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

from ..comparison.curves import COLOURS, MARKERS
from .cases import MATERIALS
from .records import CaseResult
from .results import BenchResult

_STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "stratalux",  # the same data give the same file
}

_DENSE = 60
"""An axis that spans less than this factor has room for labels within its decades."""


def why_no_picture() -> str | None:
    """What to install for :func:`draw`, or None if it works."""
    if importlib.util.find_spec("matplotlib") is None:
        return "the picture is left out: pip install 'stratalux[compare]' (or matplotlib) brings it"
    return None


def draw(result: BenchResult, folder: Path) -> None:
    """Write ``bench.svg`` and ``bench.png`` to ``folder``. Needs matplotlib."""
    import matplotlib
    from matplotlib.figure import Figure

    examples = _examples(result)
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(11, 3.4 + 3.2 * bool(examples)), layout="constrained")
        rows = figure.subfigures(2 if examples else 1, 1, squeeze=False)[:, 0]
        _bars(rows[0].add_subplot(yscale="log"), result)
        if examples:
            for k, axes in enumerate(rows[1].subplots(1, len(examples), squeeze=False)[0]):
                _curves(axes, examples[k])
        for suffix, options in ((".svg", {"metadata": {"Date": None}}), (".png", {"dpi": 160})):
            figure.savefig(folder / f"bench{suffix}", **options)


def _examples(result: BenchResult) -> list[CaseResult]:
    """One case of each material: that of the median ratio."""
    examples = []
    for material in MATERIALS:
        rated = [
            (verdict.ratio, n, case)
            for n, case in enumerate(result.cases)
            if case.case.material == material and (verdict := case.verdict(case.case.region)) is not None
        ]
        if rated:
            examples.append(sorted(rated)[len(rated) // 2][2])
    return examples


def _bars(axes: Any, result: BenchResult) -> None:
    """Bars from 1 up or down, sorted within each material; whiskers span the budgets, hatched ones have no ground."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    x, ticks = 0.0, []
    summary = result.summary("surface") or result.summary("image")
    means = summary["materials"] if summary else {}
    for k, material in enumerate(MATERIALS):
        verdicts = [
            (verdict, case)
            for case in result.cases
            if case.case.material == material and (verdict := case.verdict(case.case.region)) is not None
        ]
        verdicts.sort(key=lambda pair: pair[0].ratio)
        if not verdicts:
            continue
        places = [x + n for n in range(len(verdicts))]
        ratios = [verdict.ratio for verdict, _ in verdicts]
        axes.bar(
            places,
            [ratio - 1 for ratio in ratios],
            bottom=1,
            width=0.8,
            color=COLOURS[k],
            hatch=[None if case.case.ground else "////" for _, case in verdicts],
            edgecolor="white",
            yerr=[
                # Equal ratios differ from their mean by rounding.
                [max(0.0, verdict.ratio - verdict.lowest) for verdict, _ in verdicts],
                [max(0.0, verdict.highest - verdict.ratio) for verdict, _ in verdicts],
            ],
            error_kw={"elinewidth": 0.8, "ecolor": "0.3"},
        )
        ticks.append(
            ((places[0] + places[-1]) / 2, f"{material}\n{means[material]:.2f}" if material in means else material)
        )
        x += len(verdicts) + 1
    axes.axhline(1, color="0.2", linewidth=1)
    axes.set_xticks([place for place, _ in ticks], [label for _, label in ticks])
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(which="major", axis="y", color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_ylabel("speed-up at equal error")
    if summary is not None:
        text = f"Against the best of Mitsuba's {result.theirs}: {summary['ratio']:.2f} in the geometric mean"
        axes.set_title(f"{text}, at worst {summary['worst']['ratio']:.2f}", loc="left", fontsize=10)


def _curves(axes: Any, case: CaseResult) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    region = case.case.region
    floor = case.floors.get(region, 0.0)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for k, record in enumerate((case.ours, *case.theirs)):
        points = sorted(record.curve(region, floor).points)
        if not points:
            continue
        axes.plot(
            [seconds for seconds, _ in points],
            [error for _, error in points],
            color=COLOURS[k % len(COLOURS)],
            marker=MARKERS[k % len(MARKERS)],
            markersize=4,
            linewidth=1.4,
            label=record.configuration.label,
        )
    axes.axhline(floor, color="0.5", linestyle="--", linewidth=0.9)
    axes.set_title(case.case.name, loc="left", fontsize=9)
    axes.set_xlabel("seconds")
    if axes.get_subplotspec().is_first_col():
        axes.set_ylabel("relMSE; dashed: of the reference")
    left, right = axes.get_xlim()
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if right < _DENSE * left else (1,)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.grid(which="major", color="0.92", linewidth=0.8)
    axes.legend(edgecolor="none", framealpha=0.9, fontsize=6.5)
