"""The time that is left."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from stratalux.cli.left import TimeLeft, said


def test_it_follows_from_the_later_half() -> None:
    """A slow beginning, as launches are small there, then a constant speed; and a speed that changes for good."""
    left = TimeLeft()

    def after(share: float, seconds: float) -> float | None:
        return left.after({"": (share, 1.0)}, seconds)

    assert after(0.01, 5) == pytest.approx(5 / 0.01 * 0.99)
    assert after(0.02, 6) == pytest.approx(1 / 0.01 * 0.98)
    for k in range(3, 21):
        last = after(k / 100, 4 + k)
    assert last == pytest.approx(80)
    assert after(0.4, 64) == pytest.approx(120)
    assert after(0.4, 64) == pytest.approx(120) and TimeLeft().after({"": (0, 1.0)}, 1) is None


ALL = {"direct/pilot": 8.0, "direct/later": 56.0, "paths/pilot": 64.0, "paths/later": 192.0}
EACH = {"direct/pilot": 0.11, "direct/later": 0.09, "paths/pilot": 0.08, "paths/later": 0.1}
"""Seconds that a sample takes."""


def turns() -> Iterator[tuple[dict[str, float], float]]:
    """A render by a made-up clock: what is done of each kind, and the seconds. The part that is behind has its turn."""
    done, seconds = dict.fromkeys(ALL, 0.0), 0.0
    order = {part: [kind for kind in ALL if kind.startswith(part)] for part in ("direct", "paths")}
    while any(done[kind] < ALL[kind] for kind in ALL):
        shares = {part: sum(done[k] for k in kinds) / sum(ALL[k] for k in kinds) for part, kinds in order.items()}
        kind = next(k for k in order[min(shares, key=lambda part: shares[part])] if done[k] < ALL[k])
        # Of each kind, the first are small; each has something to do besides
        more = min(max(done[kind], 4.0), 32.0, ALL[kind] - done[kind])
        done[kind] += more
        seconds += more * EACH[kind] + 0.1
        yield dict(done), seconds


def test_kinds_of_launches_that_take_turns() -> None:
    """From a tenth of the work on, it is told within a fifth, though three kinds have yet to show how fast they are."""
    passes = list(turns())
    whole, left = passes[-1][1], TimeLeft()
    told = [left.after({kind: (done[kind], ALL[kind]) for kind in ALL}, seconds) for done, seconds in passes]
    for (_, seconds), ahead in zip(passes[:-1], told[:-1], strict=True):
        if seconds > 0.1 * whole:
            assert ahead == pytest.approx(whole - seconds, rel=0.2)
    assert told[-1] == 0


def test_a_kind_that_nobody_has_seen_takes_as_long_as_its_pilot() -> None:
    """And the first small launch of it has little weight."""
    left = TimeLeft()
    assert left.after({"a/pilot": (10, 10), "a/later": (0, 160)}, 20) == pytest.approx(2 * 160)
    each = (0.25 * 10 * 20 + 2 * 10) / (0.25 * 10**2 + 2**2)
    assert left.after({"a/pilot": (10, 10), "a/later": (2, 160)}, 30) == pytest.approx(each * 158)


@pytest.mark.parametrize(("seconds", "text"), [(None, "-:--:--"), (0.4, "0:00:00"), (3599.6, "1:00:00")])
def test_as_it_is_told(seconds: float | None, text: str) -> None:
    assert said(seconds) == text
