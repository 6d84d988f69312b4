"""Who is ahead at equal error: curves of error against time, their lower envelope, and the speed-up between two sides.

Pure arithmetic on seconds and errors; both are > 0, and all interpolation is along straight lines in log-log.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np


@dataclass(frozen=True)
class Reach:
    """The ``seconds`` in which an error is reached, and whether they lie ``outside`` of what was measured."""

    seconds: float
    outside: bool


@dataclass(frozen=True)
class Curve:
    """Error against time as measured: ``points`` (seconds, error), in any order, no two alike."""

    points: tuple[tuple[float, float], ...]

    @property
    def front(self) -> tuple[tuple[float, float], ...]:
        """The points that no other beats in both time and error, by time: along them the error falls."""
        front: list[tuple[float, float]] = []
        for seconds, error in sorted(self.points):
            if not front or error < front[-1][1]:
                front.append((seconds, error))
        return tuple(front)

    def reach(self, error: float) -> Reach:
        """The time at which the curve gets down to ``error``.

        Outside of the range measured, the curve is continued along its last segment, though never more slowly than
        independent samples converge (error ∝ 1 / time) towards lower errors, nor faster towards higher ones: where the
        last segment is noise, it does not make this side look slower than it is.
        """
        front = self.front
        if not front:
            raise ValueError("a curve needs at least one point")
        if error > front[0][1]:
            slope = min(_slope(*front[:2]), 1.0) if len(front) > 1 else 1.0
            return Reach(_along(front[0], slope, error), True)
        for left, right in pairwise(front):
            if error >= right[1]:
                return Reach(_along(left, _slope(left, right), error), False)
        if error == front[-1][1]:
            return Reach(front[-1][0], False)
        slope = max(_slope(*front[-2:]), 1.0) if len(front) > 1 else 1.0
        return Reach(_along(front[-1], slope, error), True)


@dataclass(frozen=True)
class Duel:
    """One budget of ours against the best of theirs: its ``seconds`` and ``error``, and ``theirs`` for that error.

    ``winner``: whose curve is lowest there. ``outside``: that curve was continued beyond what was measured.
    """

    seconds: float
    error: float
    theirs: float
    winner: str
    outside: bool

    @property
    def ratio(self) -> float:
        """Speed-up at equal error: above 1, we are ahead."""
        return self.theirs / self.seconds


@dataclass(frozen=True)
class Verdict:
    """The duels of a case, by time."""

    duels: tuple[Duel, ...]

    @property
    def ratio(self) -> float:
        """Geometric mean over the budgets."""
        return geometric_mean([duel.ratio for duel in self.duels])

    @property
    def lowest(self) -> float:
        return min(duel.ratio for duel in self.duels)

    @property
    def highest(self) -> float:
        return max(duel.ratio for duel in self.duels)

    @property
    def outside(self) -> bool:
        return any(duel.outside for duel in self.duels)

    @property
    def winners(self) -> tuple[str, ...]:
        """Theirs, in the order of the budgets, each once."""
        return tuple(dict.fromkeys(duel.winner for duel in self.duels))


def envelope(curves: Mapping[str, Curve], error: float) -> tuple[str, Reach]:
    """Which of ``curves`` reaches ``error`` first, and when."""
    reaches = {name: curve.reach(error) for name, curve in curves.items()}
    winner = min(reaches, key=lambda name: (reaches[name].seconds, reaches[name].outside))
    return winner, reaches[winner]


def race(ours: Sequence[tuple[float, float]], theirs: Mapping[str, Curve]) -> Verdict | None:
    """Every point (seconds, error) of ours against the lower envelope of their curves; None if a side has no point."""
    theirs = {name: curve for name, curve in theirs.items() if curve.points}
    if not ours or not theirs:
        return None
    duels = []
    for seconds, error in sorted(ours):
        winner, reach = envelope(theirs, error)
        duels.append(Duel(seconds, error, reach.seconds, winner, reach.outside))
    return Verdict(tuple(duels))


def geometric_mean(values: Sequence[float]) -> float:
    """exp of the mean logarithm; NaN for no value."""
    return float(np.exp(np.mean(np.log(values)))) if len(values) else math.nan


def _slope(left: tuple[float, float], right: tuple[float, float]) -> float:
    """s of error ∝ time^−s between two points of a front, the first with the higher error."""
    if right[0] == left[0]:
        return math.inf
    return math.log(left[1] / right[1]) / math.log(right[0] / left[0])


def _along(point: tuple[float, float], slope: float, error: float) -> float:
    return float(point[0] * (point[1] / error) ** (1 / slope))
