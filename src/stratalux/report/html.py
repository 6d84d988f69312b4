"""One self-contained page of a report: no network, no server, opened from where it lies.

The page stays below :data:`LARGEST_PAGE`. What would make it larger is left out from the bottom of the page upwards,
never made coarser in silence: first the linear pixels (the stills remain), then stills. A note and the place itself say
so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

from ..images.colour import LUMINANCE
from ..images.files import write_atomically
from ..images.metrics import RELATIVE_EPSILON
from .charts import chart_markup
from .colours import MAGMA, SIGNED
from .images import EncodedSet, encode_set, set_markup
from .model import Block, Chart, Claim, HeatMap, ImageSet, Report, Section
from .tables import VERDICTS, claims_markup, heat_map_markup, table_block, verdict_markup
from .text import Identifiers, paragraphs, script_json

LARGEST_PAGE = 25_000_000
"""Bytes."""
_RESERVE = 200_000
"""For what is not known before the page is made, mostly the notes and descriptions of pictures."""
_SCRIPTS = ("page.js", "pixels.js", "charts.js", "stage.js", "viewer.js")


def write_report(report: Report, path: str | Path) -> None:
    """Write the page of ``report`` to ``path``; the file appears complete or not at all."""
    page = render_report(report)
    write_atomically(path, lambda name: Path(name).write_text(page, encoding="utf-8"))


def render_report(report: Report, largest: int = LARGEST_PAGE) -> str:
    """The page of ``report`` as text of at most ``largest`` bytes, as far as pictures make it larger."""
    anchors = Counter(section.anchor for section in report.sections)
    if double := [anchor for anchor, count in anchors.items() if count > 1]:
        raise ValueError(f"anchor '{double[0]}' names several sections")
    sets = [encode_set(block) for section in report.sections for block in section.blocks if isinstance(block, ImageSet)]
    with_nothing = _page(report, sets, stills=0, viewers=0)
    room = largest - len(with_nothing.encode()) - min(_RESERVE, largest // 10)
    stills = _fitting([(encoded.still_size, {}) for encoded in sets], room)
    room -= sum(encoded.still_size for encoded in sets[:stills])
    viewers = _fitting([(0, {n: len(t) for n, t in encoded.data.items()}) for encoded in sets[:stills]], room)
    return _page(report, sets, stills, viewers)


def _fitting(sizes: Sequence[tuple[int, dict[str, int]]], room: int) -> int:
    """How many of the first sets fit; each has a size of its own, and parts by name that it may share."""
    shared: dict[str, int] = {}
    total = 0
    for k, (own, parts) in enumerate(sizes):
        shared.update(parts)
        total += own
        if total + sum(shared.values()) > room:
            return k
    return len(sizes)


def _page(report: Report, sets: Sequence[EncodedSet], stills: int, viewers: int) -> str:
    """The page with the stills of the first ``stills`` sets, and the linear pixels of the first ``viewers``.

    ``sets``: the image sets of the report, in its order.
    """
    identifiers = Identifiers()
    claims = [claim for section in report.sections for claim in section.claims]
    notes = list(report.notes)
    for missing, what in ((sets[viewers:stills], "are stills, without linear pixels"), (sets[stills:], "are left out")):
        if missing:
            names = ", ".join(f"'{encoded.block.title}'" for encoded in missing)
            notes.append(f"The pictures of {names} {what}, or the page would be larger than it may.")
    ranked = iter(enumerate(sets))

    def block_markup(block: Block) -> str:
        if isinstance(block, ImageSet):
            rank, encoded = next(ranked)
            return set_markup(encoded, identifiers, stills=rank < stills, viewer=rank < viewers)
        if isinstance(block, Chart):
            return chart_markup(block, identifiers)
        if isinstance(block, HeatMap):
            return heat_map_markup(block, identifiers)
        return table_block(block, identifiers)

    sections = "".join(_section(section, "".join(map(block_markup, section.blocks))) for section in report.sections)
    data = {name: text for encoded in sets[:viewers] for name, text in encoded.data.items()}
    constants = {"luminance": LUMINANCE.tolist(), "epsilon": RELATIVE_EPSILON, "magma": MAGMA, "signed": SIGNED}
    return Template(_asset("page.html")).substitute(
        title=escape(report.title),
        subtitle=escape(report.subtitle),
        style=_asset("style.css"),
        summary=_summary(report, claims),
        notes=_notes(notes),
        navigation=_navigation(report),
        sections=sections,
        facts=_facts(report.facts),
        constants=script_json(constants),
        data="\n".join(f'<script type="text/plain" id="{name}">{text}</script>' for name, text in data.items()),
        scripts="\n".join(_asset(name) for name in _SCRIPTS),
    )


def _asset(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def _summary(report: Report, claims: Sequence[Claim]) -> str:
    counts = Counter(claim.verdict for claim in claims)
    if not claims:
        return paragraphs(*report.summary)
    badges = "".join(f"<li>{verdict_markup(verdict, counts[verdict])}</li>" for verdict in VERDICTS if counts[verdict])
    shares = "".join(
        f'<span class="{verdict.replace(" ", "-")}" style="flex-grow:{counts[verdict]}"></span>'
        for verdict in VERDICTS
        if counts[verdict]
    )
    return (
        f'<ul class="verdicts" aria-label="Claims by verdict">{badges}</ul>'
        f'<div class="shares" aria-hidden="true">{shares}</div>{paragraphs(*report.summary)}'
    )


def _notes(notes: Sequence[str]) -> str:
    if not notes:
        return ""
    items = "".join(f"<li>{escape(note)}</li>" for note in notes)
    return (
        '<aside class="notes" aria-labelledby="report-notes"><h2 id="report-notes">Before you trust the figures</h2>'
        f"<ul>{items}</ul></aside>"
    )


def _navigation(report: Report) -> str:
    links = []
    for section in report.sections:
        signs = "".join(
            f'<span class="{verdict.replace(" ", "-")}">{sign}{count}</span>'
            for verdict, sign in VERDICTS.items()
            if (count := sum(claim.verdict == verdict for claim in section.claims))
        )
        tally = f'<span class="tally" aria-hidden="true">{signs}</span>' if signs else ""
        links.append(f'<li><a href="#{escape(section.anchor)}">{escape(section.title)}{tally}</a></li>')
    if report.facts:
        links.append('<li><a href="#report-facts">How it was made</a></li>')
    return "".join(links)


def _section(section: Section, blocks: str) -> str:
    anchor = escape(section.anchor)
    claims = claims_markup(section.claims, f"Claims: {section.title}") if section.claims else ""
    return (
        f'<section class="part" id="{anchor}" aria-labelledby="{anchor}-title">'
        f'<h2 id="{anchor}-title">{escape(section.title)}</h2>{paragraphs(*section.text)}{claims}{blocks}</section>'
    )


def _facts(facts: dict[str, str]) -> str:
    if not facts:
        return ""
    rows = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{escape(value)}</td></tr>' for name, value in facts.items()
    )
    return (
        '<section class="part" id="report-facts" aria-labelledby="report-facts-title">'
        '<h2 id="report-facts-title">How it was made</h2>'
        f'<table class="facts"><tbody>{rows}</tbody></table></section>'
    )
