"""Is the default estimator ahead of Mitsuba's own at equal time? The benchmark that decides it.

The figure is the speed-up at equal error: the seconds that the best of Mitsuba's ``direct`` needs to reach our error,
over ours. What "the best" is gets searched for in every case, among all samplers, splits and settings.
"""

from __future__ import annotations

from .cases import FULL, QUICK, SUITES, Case, Suite
from .results import BenchResult
from .run import run

__all__ = ["FULL", "QUICK", "SUITES", "BenchResult", "Case", "Suite", "run"]
