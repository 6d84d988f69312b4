"""The figures and numbers of the paper, computed again on its own data, each claim with a verdict."""

from __future__ import annotations

from .items import ITEMS
from .run import reproduce
from .settings import FULL, QUICK, TINY, Settings

__all__ = ["FULL", "ITEMS", "QUICK", "TINY", "Settings", "reproduce"]
