"""Numbers of a document that mean something to the eye: as many as there must be, finite, and in their range."""

from __future__ import annotations

import math
from typing import Any

from .extensions import LeftOut


class Numbers:
    """The numbers of an object of a document by their names. `left_out` hears of those that are out of range.

    Raises ValueError for what is no number, or for too many or too few.
    """

    def __init__(self, values: dict[str, Any], left_out: LeftOut) -> None:
        self._values, self._left_out = values, left_out

    def one(self, name: str, default: float, low: float = -math.inf, high: float = math.inf) -> float:
        """A single number, clamped to its range."""
        return self.some(name, (default,), low, high)[0]

    def some(
        self, name: str, default: tuple[float, ...], low: float = -math.inf, high: float = math.inf
    ) -> tuple[float, ...]:
        """As many numbers as the `default` has, clamped to their range."""
        given = self._values.get(name)
        if given is None:
            return default
        found = given if isinstance(given, list) else [given]
        if len(found) != len(default) or not all(isinstance(x, (int, float)) and math.isfinite(x) for x in found):
            what = "a number" if len(default) == 1 else f"{len(default)} numbers"
            raise ValueError(f"{name} is {str(given)[:40]}, not {what}")
        clamped = tuple(min(max(float(x), low), high) for x in found)
        if max(found) > high:
            self._left_out.add(f"{name} above {high:g}")
        if min(found) < low:
            self._left_out.add(f"{name} below {low:g}")
        return clamped

    def colour(self, name: str, default: float, high: float = 1.0) -> tuple[float, float, float]:
        """Three numbers, of 0 or more."""
        red, green, blue = self.some(name, (default,) * 3, 0.0, high)
        return red, green, blue
