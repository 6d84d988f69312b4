"""The time that is left."""

from __future__ import annotations

import pytest

from stratalux.cli.left import TimeLeft, said


def test_it_follows_from_the_later_half() -> None:
    """A slow beginning, as launches are small there, then a constant speed; and a speed that changes for good."""
    left = TimeLeft()
    assert left.after(0.01, 5) == pytest.approx(5 / 0.01 * 0.99)
    assert left.after(0.02, 6) == pytest.approx(1 / 0.01 * 0.98)
    for k in range(3, 21):
        last = left.after(k / 100, 4 + k)
    assert last == pytest.approx(80)
    assert left.after(0.4, 64) == pytest.approx(120)
    assert left.after(0.4, 64) == pytest.approx(120) and TimeLeft().after(0, 1) is None


@pytest.mark.parametrize(("seconds", "text"), [(None, "-:--:--"), (0.4, "0:00:00"), (3599.6, "1:00:00")])
def test_as_it_is_told(seconds: float | None, text: str) -> None:
    assert said(seconds) == text
