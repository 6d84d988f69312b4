"""From figures to verdicts, by rules that were fixed before the figures were known."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

from ..report.model import Verdict

RULE_OF_RATIOS = "holds if every rendering's ratio is on the paper's side of {bound:g}, partly if only their median is"
SIGMAS = 3.0
"""A bias counts as seen, and a mean as off, beyond so many standard errors."""


def by_spread(ratios: Sequence[float], bound: float = 1.0) -> Verdict:
    """For ratios that the paper has above ``bound``: ``holds`` if all are, ``partly`` if their median is."""
    if min(ratios) > bound:
        return "holds"
    return "partly" if median(ratios) > bound else "fails"


def by_size(ratios: Sequence[float], bound: float) -> Verdict:
    """Of what the paper calls large: ``holds`` if all are above ``bound``, ``partly`` if their median is over 1."""
    if min(ratios) > bound:
        return "holds"
    return "partly" if median(ratios) > 1 else "fails"


def all_of(verdicts: Sequence[Verdict]) -> Verdict:
    """One verdict for a claim of several cases: ``holds`` if all do, ``fails`` if all do, otherwise ``partly``."""
    kinds = set(verdicts)
    if kinds == {"holds"}:
        return "holds"
    return "fails" if kinds == {"fails"} else "partly"


def when(condition: bool) -> Verdict:
    """``holds`` or ``fails``."""
    return "holds" if condition else "fails"
