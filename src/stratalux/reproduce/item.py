"""What an item of the reproduction is: a figure of the paper, or its timings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..comparison.study import Study
from ..report.model import Section
from .scenes import Workbench
from .settings import Settings


@dataclass(frozen=True)
class Item:
    """``work``: of its steps, about seconds on two cores, by name; of a name that items share, it is done once.

    ``assets``: names of the files that it needs.
    """

    name: str
    title: str
    assets: tuple[str, ...]
    work: Callable[[Settings], dict[str, float]]
    run: Callable[[Study, Workbench], Section]
