"""The time that is left, from what has been done."""

from __future__ import annotations

from collections.abc import Mapping

_PILOT, _LATER = "/pilot", "/later"
"""How the names of kinds end, where there are two of a part of the picture."""
_DOUBT = 1 / 16
"""Of a later kind: the speed of its pilot weighs as much as so many of it. Its first launches are small, and each has
something to do besides."""


class TimeLeft:
    """Follows from how long each kind of launches has taken, without compilation: the later half of what is done, as
    what comes first is made in smaller launches."""

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
            speed = self._seconds_each(kind, whole)
            known |= speed is not None
            left += (speed or 0.0) * max(0.0, whole - done)
        return left if known else None

    def _seconds_each(self, kind: str, whole: float) -> float | None:
        """Of a kind, of which there are so many in the whole."""
        seen = self._seen[kind]
        done, seconds = seen[-1]
        before, then = max(one for one in seen if one[0] <= done / 2)
        done, seconds = done - before, seconds - then
        if kind.endswith(_LATER) and (expected := self._seconds_each(kind.removesuffix(_LATER) + _PILOT, whole)):
            doubt = _DOUBT * whole
            return (expected * doubt + seconds) / (doubt + done) if doubt + done else None
        return seconds / done if done else None


def said(seconds: float | None) -> str:
    """As the bar has it."""
    if seconds is None:
        return "-:--:--"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
