"""Log-log curves of a comparison: error over shadow rays, and error over time."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from .findings import Findings
from .records import Record, Spread

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito 2008: told apart with any colour vision, and each has a marker of its own besides."""
MARKERS = "os^DvPX*"
_DASHES = ("-", (0, (5, 2)), (0, (1, 1.5)))
"""Another one each time that the colours are used up."""
_MOST_TICKS = 9
_MOST_LINES_INSIDE = 7
"""A longer legend stands beside the axes, and the figure is wider for it."""

_STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "stratalux",  # the same data give the same file
}
_REGION_NAMES = {"surface": "pixels that are all surface", "image": "whole image"}


def why_no_curves() -> str | None:
    """What to install for :func:`draw_curves`, or None if it works."""
    if importlib.util.find_spec("matplotlib") is None:
        return "curves are left out: pip install 'stratalux[compare]' (or matplotlib) brings them"
    return None


def draw_curves(comparison: Findings, folder: Path) -> None:
    """Write ``error-rays`` and ``error-time``, each as .svg and .png, to ``folder``. Needs matplotlib."""
    settings = comparison.settings
    where = f"{settings['scene']}, {settings['width']}x{settings['height']}"
    _draw(
        comparison,
        folder / "error-rays",
        comparison.equal_rays,
        lambda record: float(record.rays_per_pixel),
        f"Error at equal numbers of shadow rays: {where}",
        f"shadow rays per pixel (rays asked for × {settings['spp']} camera samples)",
    )
    _draw(
        comparison,
        folder / "error-time",
        comparison.equal_time,
        lambda record: record.seconds.median,
        f"Error at equal time: {where}",
        "rendering time in seconds, without compilation and preprocessing",
    )


def _draw(
    comparison: Findings,
    path: Path,
    records: Sequence[Record],
    abscissa: Callable[[Record], float],
    title: str,
    label: str,
) -> None:
    import matplotlib
    from matplotlib.figure import Figure

    region = comparison.region
    with matplotlib.rc_context(_STYLE):
        width = 7.2 if len(comparison.entries) + 2 <= _MOST_LINES_INSIDE else 9.2
        figure = Figure(figsize=(width, 5.0), layout="constrained")
        axes = figure.add_subplot(xscale="log", yscale="log")
        floor = comparison.reference.relative_mse_floor(comparison.mask(region))
        curves = [
            sorted(
                ((abscissa(record), record.errors[region].relative_mse) for record in records if record.entry is entry),
                key=lambda point: point[0],
            )
            for entry in comparison.entries
        ]
        # A logarithm has no place for the errors of a black scene, nor for what is no number.
        curves = [[(x, y) for x, y in points if x > 0 and 0 < y.minimum <= y.maximum < math.inf] for points in curves]
        drawn = [(x, y.median) for points in curves for x, y in points]
        if drawn:
            _limits(axes, curves, floor)
        for k, (entry, points) in enumerate(zip(comparison.entries, curves, strict=True)):
            if not points:
                continue
            y = [spread.median for _, spread in points]
            reach = [[s.median - s.minimum for _, s in points], [s.maximum - s.median for _, s in points]]
            axes.errorbar(
                [x for x, _ in points],
                y,
                yerr=reach,
                label=entry.name + ("" if entry.technique.unbiased else " (biased)"),
                color=COLOURS[k % len(COLOURS)],
                marker=MARKERS[k % len(MARKERS)],
                linestyle=_DASHES[k // len(COLOURS) % len(_DASHES)],
                markersize=6,
                linewidth=1.6,
                capsize=3,
                elinewidth=1,
            )
        if floor > 0:
            axes.axhline(floor, color="0.35", linestyle="--", linewidth=1.2, label="noise of the reference")
        _guide(axes, drawn)
        _ticks(axes, sorted({x for x, _ in drawn}) if records is comparison.equal_rays else [])
        axes.set_title(title, loc="left", fontsize=11)
        axes.set_xlabel(label)
        axes.set_ylabel(f"relative MSE, {_REGION_NAMES[region]}")
        handles, labels = axes.get_legend_handles_labels()  # lines come first there, but the entries should
        order = sorted(range(len(labels)), key=lambda k: not hasattr(handles[k], "has_yerr"))
        crowded = len(labels) > _MOST_LINES_INSIDE
        (figure if crowded else axes).legend(
            [handles[k] for k in order],
            [labels[k] for k in order],
            loc="outside right center" if crowded else "best",
            handlelength=3.2,
            frameon=False,
            fontsize=9,
        )
        figure.savefig(path.with_suffix(".svg"), metadata={"Date": None})
        figure.savefig(path.with_suffix(".png"), dpi=160)


def _limits(axes: Any, curves: Sequence[Sequence[tuple[float, Spread]]], floor: float) -> None:
    """Room around all points and the floor, also where there is only one of them."""
    points = [point for curve in curves for point in curve]
    left, right = min(x for x, _ in points), max(x for x, _ in points)
    lowest, highest = min(y.minimum for _, y in points), max(y.maximum for _, y in points)
    axes.set_xlim(left / 1.2, right * 1.2)
    axes.set_ylim((min(lowest, floor) if floor > 0 else lowest) / 1.5, highest * 2)


def _guide(axes: Any, drawn: Sequence[tuple[float, float]]) -> None:
    """A thin line along which independent samples would fall: error ∝ 1 / cost."""
    if len({x for x, _ in drawn}) < 2:
        return
    first, last = min(x for x, _ in drawn), max(x for x, _ in drawn)
    top = max(y for _, y in drawn) * 1.5
    axes.plot([first, last], [top, top * first / last], color="0.7", linewidth=1, linestyle=":", label="slope −1")


def _ticks(axes: Any, values: Sequence[float]) -> None:
    """Plain numbers on the lower axis (``values`` themselves if they are few), powers of ten on the other.

    Where the errors span less than a decade, their axis gets further labels.
    """
    from matplotlib.ticker import FixedLocator, LogFormatterSciNotation, LogLocator, NullLocator, StrMethodFormatter

    if 0 < len(values) <= _MOST_TICKS:
        axes.xaxis.set_major_locator(FixedLocator(list(values)))
        axes.xaxis.set_minor_locator(NullLocator())
    else:
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_minor_formatter("")
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(LogFormatterSciNotation(minor_thresholds=(1.5, 0.6)))
    axes.grid(which="major", color="0.9", linewidth=0.8)
    axes.set_axisbelow(True)
