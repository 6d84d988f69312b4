"""Tables, heat maps and claims as tables."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from html import escape

import numpy as np

from .colours import VIRIDIS, interpolate
from .model import Claim, HeatMap, Table, Verdict
from .text import Identifiers, number, paragraphs

VERDICTS: dict[Verdict, str] = {"holds": "✓", "partly": "◐", "fails": "✗", "not tested": "–"}
"""The sign of each, so that colour is not all that tells them apart."""
_NUMBER = re.compile(r"[-+−]?[\d.,]+(e[-+]?\d+)?\s*([%×*sx]|ms|dB|MB|spp)?(\s*\*)?")
_GAPS = ("", "-", "–", "—")


def verdict_markup(verdict: Verdict, count: int | None = None) -> str:
    """A badge: sign and word, and how many there are of it."""
    many = "" if count is None else f"<b>{count}</b> "
    return (
        f'<span class="verdict {verdict.replace(" ", "-")}"><span class="sign" aria-hidden="true">{VERDICTS[verdict]}'
        f"</span>{many}{verdict}</span>"
    )


def claims_markup(claims: Sequence[Claim], label: str) -> str:
    """What the paper says beside what was found. On a phone the rows become cards, so roles are said explicitly."""
    head = "".join(f'<th role="columnheader" scope="col">{name}</th>' for name in ("Verdict", "Claim", "Paper", "Here"))
    rows = "".join(
        f'<tr role="row"><td role="cell" class="is">{verdict_markup(claim.verdict)}</td>'
        f'<th role="rowheader" scope="row">{escape(claim.text)}'
        f"{f'<p>{escape(claim.comment)}</p>' if claim.comment else ''}</th>"
        f'<td role="cell" data-label="Paper">{escape(claim.theirs)}</td>'
        f'<td role="cell" data-label="Here">{escape(claim.ours)}</td></tr>'
        for claim in claims
    )
    return (
        f'<table class="claims" role="table" aria-label="{escape(label)}"><thead role="rowgroup"><tr role="row">{head}'
        f'</tr></thead><tbody role="rowgroup">{rows}</tbody></table>'
    )


def table_block(table: Table, identifiers: Identifiers) -> str:
    title = identifiers.new("table")
    return (
        f'<section class="block" aria-labelledby="{title}"><h3 id="{title}">{escape(table.title)}</h3>'
        f"{paragraphs(table.text)}{table_markup(table.header, table.rows, table.title)}</section>"
    )


def table_markup(header: Sequence[str], rows: Sequence[Sequence[str]], label: str) -> str:
    """A table that scrolls in itself where it is too wide, by the keyboard too. Columns of numbers are flush right."""
    numeric = [all(_is_number(row[k]) for row in rows) and bool(rows) for k in range(len(header))]
    kind = [' class="number"' if flag else "" for flag in numeric]
    head = "".join(f'<th scope="col"{k}>{escape(name)}</th>' for name, k in zip(header, kind, strict=True))
    cells = ("".join(f"<td{k}>{escape(cell)}</td>" for cell, k in zip(row, kind, strict=True)) for row in rows)
    body = "".join(f"<tr>{row}</tr>" for row in cells)
    return (
        f'{_scroller(label)}<table class="sortable"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'
    )


def heat_map_markup(chart: HeatMap, identifiers: Identifiers) -> str:
    """A table whose cells are coloured by the logarithm of their values; signs and words mark the best."""
    values = np.asarray(chart.values, dtype=np.float64)
    if values.shape != (len(chart.rows), len(chart.columns)):
        raise ValueError(f"heat map '{chart.title}': {values.shape} values for its labels")
    known = np.isfinite(values) & (values > 0)
    logs = np.log(values, where=known, out=np.full(values.shape, np.nan))
    low, high = (float(np.nanmin(logs)), float(np.nanmax(logs))) if known.any() else (0.0, 0.0)
    t = (logs - low) / (high - low) if high > low else np.where(known, 0.5, np.nan)
    # Dark is far, bright is good, as long as good is what the eye should find.
    t = 1 - t if chart.lower_is_better else t
    best = (low if chart.lower_is_better else high) if known.any() else math.nan
    colours = interpolate(VIRIDIS, np.nan_to_num(t))
    title = identifiers.new("heat")
    rows = []
    for i, label in enumerate(chart.rows):
        cells = [
            _cell(float(values[i, j]), colours[i, j].tolist(), bool(known[i, j]), bool(logs[i, j] == best))
            for j in range(len(chart.columns))
        ]
        rows.append(f'<tr><th scope="row">{escape(label)}</th>{"".join(cells)}</tr>')
    head = "".join(f'<th scope="col">{escape(label)}</th>' for label in chart.columns)
    unit = f" ({escape(chart.unit)})" if chart.unit else ""
    better = "lower" if chart.lower_is_better else "higher"
    return (
        f'<section class="block" aria-labelledby="{title}"><h3 id="{title}">{escape(chart.title)}</h3>'
        f"{paragraphs(chart.text)}<p>{escape(chart.y_label)} down, {escape(chart.x_label)} across{unit}; "
        f'{better} is better, ★ marks the best.</p>{_scroller(chart.title)}<table class="heat"><thead><tr><td></td>'
        f"{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div></section>"
    )


def _cell(value: float, colour: list[int], known: bool, best: bool) -> str:
    if not known:
        return f"<td>{'–' if math.isnan(value) else number(value)}</td>"
    light = 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2] > 125
    style = f"background:rgb({colour[0]} {colour[1]} {colour[2]});color:{'#000' if light else '#fff'}"
    star = '<span class="best" aria-hidden="true">★</span><span class="unseen">best: </span>' if best else ""
    return f'<td style="{style}">{star}{number(value)}</td>'


def _scroller(label: str) -> str:
    return f'<div class="scroller" tabindex="0" role="region" aria-label="{escape(label)}">'


def _is_number(text: str) -> bool:
    return text.strip() in _GAPS or _NUMBER.fullmatch(text.strip()) is not None
