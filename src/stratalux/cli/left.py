"""The time that is left, from what has been done."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

_PILOT, _LATER = "/pilot", "/later"
"""How the names of kinds end, where there are two of a part of the picture."""
_BEFORE = 0.25
"""Weight of what a pilot has shown, where launches of the later kind have shown something."""


class TimeLeft:
    """Follows from how long each kind of launches has taken, without compilation: the later half of what is done.

    Seconds are proportional to samples, by least squares: so small launches, which come first and have other things to
    do besides, weigh little, as most of what is to come is made in large ones."""

    def __init__(self) -> None:
        self._before = 0.0
        self._seen: dict[str, list[tuple[float, float]]] = {}

    def after(self, work: Mapping[str, tuple[float, float]], seconds: float) -> float | None:
        """Seconds, when all has taken so many; None if nobody knows. ``work``: what is done of each kind, and of how
        much, see :attr:`~..rendering.passes.RenderResult.work`."""
        took, self._before = seconds - self._before, seconds
        begun = {kind: self._seen.setdefault(kind, [(0.0, 0.0)])[-1] for kind in work}
        more = {kind: max(0.0, done - begun[kind][0]) for kind, (done, _) in work.items()}
        for kind, (done, _) in work.items():
            if more[kind]:  # of several kinds at once, nobody knows which one has taken how much of the time
                self._seen[kind].append((done, begun[kind][1] + took * more[kind] / sum(more.values())))
        left, known = 0.0, False
        for kind, (done, whole) in work.items():
            seconds_by, squares = self._shown(kind)
            if kind.endswith(_LATER):
                before = self._shown(kind.removesuffix(_LATER) + _PILOT)
                seconds_by, squares = seconds_by + _BEFORE * before[0], squares + _BEFORE * before[1]
            if squares:
                known = True
                left += seconds_by / squares * max(0.0, whole - done)
        return left if known else None

    def _shown(self, kind: str) -> tuple[float, float]:
        """Sums of what launches of a kind have done, times their seconds, and of its square."""
        seen = self._seen.get(kind, [(0.0, 0.0)])
        first = max(k for k, (done, _) in enumerate(seen) if done <= seen[-1][0] / 2)
        launches = [(b - a, then - before) for (a, before), (b, then) in pairwise(seen[first:])]
        return sum(done * seconds for done, seconds in launches), sum(done * done for done, _ in launches)


def said(seconds: float | None) -> str:
    """As the bar has it."""
    if seconds is None:
        return "-:--:--"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
