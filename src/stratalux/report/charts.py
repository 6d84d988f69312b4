"""Curves as static SVG, readable as they are; ``charts.js`` adds tooltips and switches.

Colours, and sizes of text, are those of the page's style sheet, so that they follow its light or dark scheme.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise

from .model import Chart, Curve
from .tables import table_markup
from .text import Identifiers, number, paragraphs

_WIDTH, _HEIGHT = 640, 400
_LEFT, _RIGHT, _TOP, _BOTTOM = 70, 14, 34, 60
_COLOURS = 7
"""Series colours in the style sheet; further curves take them again with another marker."""
_MOST_TICKS = 8
_MOST_TICKS_ON_A_PHONE = 4
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

Points = tuple[tuple[float, float, float, float], ...]


@dataclass(frozen=True)
class _Axis:
    """Maps values to user units. ``ticks``: value and label; a label may be empty."""

    place: Callable[[float], float]
    ticks: tuple[tuple[float, str], ...]


def chart_markup(chart: Chart, identifiers: Identifiers) -> str:
    """A figure: the SVG, its legend, and its values as a table."""
    drawn = [(curve, _drawable(chart, curve)) for curve in chart.curves]
    drawn = [(curve, points) for curve, points in drawn if points]
    title = identifiers.new("chart")
    head = f'<figure class="chart block" aria-labelledby="{title}"><h3 id="{title}">{escape(chart.title)}</h3>'
    if not drawn:
        return f'{head}{paragraphs(chart.text)}<p class="empty">There is no value to draw.</p></figure>'
    legend = "".join(
        f'<li data-curve="{k}"><svg class="swatch series-{k % _COLOURS}" viewBox="0 0 34 14" aria-hidden="true">'
        f'<line class="line{" dashed" if curve.dashed else ""}" x1="1" y1="7" x2="33" y2="7"/>{_marker(k, 17, 7)}</svg>'
        f"<span>{escape(curve.name)}</span></li>"
        for k, (curve, _) in enumerate(drawn)
    )
    rows = [[curve.name, *map(number, point)] for curve, points in drawn for point in points]
    header = ["curve", chart.x_label, chart.y_label, "lowest", "highest"]
    return (
        f"{head}{paragraphs(chart.text)}"
        f'<div class="plot">{_svg(chart, drawn)}</div><ul class="legend">{legend}</ul>'
        f"<details><summary>Values</summary>{table_markup(header, rows, f'Values of {chart.title}')}</details></figure>"
    )


def _drawable(chart: Chart, curve: Curve) -> Points:
    """The points of a curve that the axes have a place for."""
    least = 0.0 if chart.logarithmic else -math.inf
    return tuple(point for point in curve.points if all(math.isfinite(v) and v > least for v in point))


def _svg(chart: Chart, drawn: Sequence[tuple[Curve, Points]]) -> str:
    xs = [x for _, points in drawn for x, *_ in points]
    ys = [y for _, points in drawn for _, *reach in points for y in reach]
    floor = chart.floor if chart.floor and (chart.floor[0] > 0 or not chart.logarithmic) else None
    if floor:
        ys.append(floor[0])
    scale = _logarithmic if chart.logarithmic else _linear
    x_axis = scale(min(xs), max(xs), _LEFT + 12, _WIDTH - _RIGHT - 12, sorted(set(xs)))
    y_axis = scale(min(ys), max(ys), _HEIGHT - _BOTTOM - 12, _TOP + 12, [])
    parts = [_grid(x_axis, y_axis), _labels(chart)]
    if floor:
        y = y_axis.place(floor[0])
        parts.append(
            f'<g class="floor"><line x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
            f'<text x="{_LEFT + 6}" y="{y - 5:.1f}">{escape(floor[1])}</text></g>'
        )
    parts += [_curve(k, curve, points, x_axis, y_axis, chart) for k, (curve, points) in enumerate(drawn)]
    says = f"{chart.title}. {chart.y_label} over {chart.x_label}, {len(drawn)} curves: " + ", ".join(
        curve.name for curve, _ in drawn
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" '
        f'aria-label="{escape(says)}">{"".join(parts)}</svg>'
    )


def _grid(x_axis: _Axis, y_axis: _Axis) -> str:
    bottom, right = _HEIGHT - _BOTTOM, _WIDTH - _RIGHT
    lines, labels = [], []
    for k, (value, label) in enumerate(x_axis.ticks):
        x = x_axis.place(value)
        spare = " spare" if k % 2 and len(x_axis.ticks) > _MOST_TICKS_ON_A_PHONE else ""
        lines.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{_TOP}" y2="{bottom}"/>')
        labels.append(f'<text class="x{spare}" x="{x:.1f}" y="{bottom + 19}">{label}</text>')
    for value, label in y_axis.ticks:
        y = y_axis.place(value)
        lines.append(f'<line x1="{_LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
        labels.append(f'<text class="y" x="{_LEFT - 7}" y="{y:.1f}" dy="0.35em">{label}</text>')
    frame = f'<path class="axis" d="M{_LEFT} {_TOP}V{bottom}H{right}"/>'
    return f'<g class="grid">{"".join(lines)}</g>{frame}<g class="ticks">{"".join(labels)}</g>'


def _labels(chart: Chart) -> str:
    middle = (_LEFT + _WIDTH - _RIGHT) / 2
    return (
        f'<g class="labels"><text class="x" x="{middle}" y="{_HEIGHT - 8}">{escape(chart.x_label)}</text>'
        f'<text x="4" y="18">{escape(chart.y_label)}</text></g>'
    )


def _curve(k: int, curve: Curve, points: Points, x_axis: _Axis, y_axis: _Axis, chart: Chart) -> str:
    places = [(x_axis.place(x), y_axis.place(y)) for x, y, *_ in points]
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    parts = [f'<polyline class="line{" dashed" if curve.dashed else ""}" points="{line}"/>']
    for (x, y), (value_x, value_y, low, high) in zip(places, points, strict=True):
        bar, says = "", f"{curve.name}\n{chart.x_label}: {number(value_x)}\n{chart.y_label}: {number(value_y)}"
        if low < high:
            bottom, top = y_axis.place(low), y_axis.place(high)
            stem = f"M{x:.1f} {bottom:.1f}V{top:.1f}M{x - 4:.1f} {bottom:.1f}h8m0 {top - bottom:.1f}h-8"
            bar = f'<path class="bar" d="{stem}"/>'
            says += f"\nfrom {number(low)} to {number(high)}"
        parts.append(
            f'<g class="point" data-x="{x:.1f}" data-y="{y:.1f}"><title>{escape(says)}</title>'
            f"{bar}{_marker(k, x, y)}</g>"
        )
    return f'<g class="curve series-{k % _COLOURS}" data-curve="{k}">{"".join(parts)}</g>'


def _marker(k: int, x: float, y: float) -> str:
    """A shape of its own for each curve, so that colour is not all that tells them apart."""
    polygons = (
        [(-4, -4), (4, -4), (4, 4), (-4, 4)],
        [(0, -5.5), (5, 4), (-5, 4)],
        [(0, -5.5), (5.5, 0), (0, 5.5), (-5.5, 0)],
        [(0, 5.5), (5, -4), (-5, -4)],
        [(-6, 0), (0, -3), (6, 0), (0, 3)],
        [(0, -6), (3, 0), (0, 6), (-3, 0)],
    )
    shape = (k + k // _COLOURS) % (len(polygons) + 1)
    if shape == 0:
        return f'<circle class="marker" cx="{x:.1f}" cy="{y:.1f}" r="4.5"/>'
    corners = " ".join(f"{x + dx:.1f},{y + dy:.1f}" for dx, dy in polygons[shape - 1])
    return f'<polygon class="marker" points="{corners}"/>'


def _logarithmic(low: float, high: float, start: float, end: float, wanted: Sequence[float]) -> _Axis:
    """Ticks at the ``wanted`` values if they are few, otherwise at powers of ten, with 2 and 5 between few of them."""
    if low == high:
        low, high = low / 2, high * 2
    a, b = math.log10(low), math.log10(high)
    if 0 < len(wanted) <= _MOST_TICKS and all(y / x > (high / low) ** 0.07 for x, y in pairwise(wanted)):
        ticks = [(value, number(value)) for value in wanted]
    else:
        powers = range(math.floor(a), math.ceil(b) + 1)
        steps = (1,) if b - a > 3 else (1, 3) if b - a > 1.5 else (1, 2, 5)
        every = max(1, math.ceil(len(powers) / _MOST_TICKS))
        ticks = [(m * 10.0**p, _power(m, p)) for p in powers if p % every == 0 for m in steps]
        ticks = [(value, label) for value, label in ticks if low / 1.05 <= value <= high * 1.05]
        if len(ticks) < 2:
            ticks = [(value, number(value)) for value in (low, high)]
    return _Axis(lambda value: start + (math.log10(value) - a) / (b - a) * (end - start), tuple(ticks))


def _power(factor: int, exponent: int) -> str:
    if -3 <= exponent <= 4:
        return f"{factor * 10.0**exponent:.{max(0, -exponent)}f}"
    power = "10" + str(exponent).translate(_SUPERSCRIPTS)
    return power if factor == 1 else f"{factor}·{power}"


def _linear(low: float, high: float, start: float, end: float, wanted: Sequence[float]) -> _Axis:
    """Ticks at multiples of 1, 2 or 5 times a power of ten; ``wanted`` is for the other kind of axis."""
    if low == high:
        low, high = low - 0.5, high + 0.5
    rough = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough)
    values = [k * step for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]
    ticks = tuple((value, number(value)) for value in values)
    return _Axis(lambda value: start + (value - low) / (high - low) * (end - start), ticks)
