"""Large pictures, a strip at a time: what is made of one takes several times its memory."""

from __future__ import annotations

from collections.abc import Iterator

AT_ONCE = 1 << 22
"""Pixels of a strip, about."""


def strips(height: int, width: int) -> Iterator[slice]:
    """Rows of a picture of that size; one strip where it is small."""
    step = max(1, AT_ONCE // max(1, width))
    for top in range(0, height, step):
        yield slice(top, min(top + step, height))
