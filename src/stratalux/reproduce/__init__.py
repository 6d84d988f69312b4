"""The figures and numbers of the paper, computed again on its own data, each claim with a verdict."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .items import ITEMS
    from .run import reproduce
    from .settings import FULL, QUICK, TINY, Settings

__all__ = ["FULL", "ITEMS", "QUICK", "TINY", "Settings", "reproduce"]

__getattr__ = lazily(
    __name__,
    {
        "ITEMS": ".items",
        "reproduce": ".run",
        **dict.fromkeys(("FULL", "QUICK", "TINY", "Settings"), ".settings"),
    },
)
