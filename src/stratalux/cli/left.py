"""The time that is left, from what has been done."""

from __future__ import annotations


class TimeLeft:
    """Follows from how long the later half of what is done has taken, without compilation: what comes first is made in
    smaller launches, and of other kinds."""

    def __init__(self) -> None:
        self._seen = [(0.0, 0.0)]

    def after(self, share: float, seconds: float) -> float | None:
        """Seconds, when this share of the whole is done and that has taken so many; None if nobody knows."""
        self._seen.append((share, seconds))
        before, then = max(one for one in self._seen if one[0] <= share / 2)
        return (seconds - then) / (share - before) * (1 - share) if share > before else None


def said(seconds: float | None) -> str:
    """As the bar has it."""
    if seconds is None:
        return "-:--:--"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
