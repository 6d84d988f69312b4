"""Is the default estimator ahead of Mitsuba's own at equal time? The benchmark that decides it.

The figure is the speed-up at equal error: the seconds that the best of Mitsuba's ``direct`` needs to reach our error,
over ours. What "the best" is gets searched for in every case, among all samplers, splits and settings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .benchmark import run, run_suite
    from .cases import FULL, QUICK, SUITES, Case, Suite
    from .results import BenchResult
    from .settings import BenchSettings

__all__ = ["FULL", "QUICK", "SUITES", "BenchResult", "BenchSettings", "Case", "Suite", "run", "run_suite"]

__getattr__ = lazily(
    __name__,
    {
        **dict.fromkeys(("FULL", "QUICK", "SUITES", "Case", "Suite"), ".cases"),
        **dict.fromkeys(("run", "run_suite"), ".benchmark"),
        "BenchResult": ".results",
        "BenchSettings": ".settings",
    },
)
