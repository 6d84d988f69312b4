"""Where this user's caches are. Deleting them is always safe."""

from __future__ import annotations

import os
from pathlib import Path


def cache_folder() -> Path:
    """``$STRATALUX_CACHE``, else ``$XDG_CACHE_HOME/stratalux``, else ``~/.cache/stratalux``."""
    if folder := os.environ.get("STRATALUX_CACHE"):
        return Path(folder)
    base = os.environ.get("XDG_CACHE_HOME")
    return Path(base) / "stratalux" if base else Path.home() / ".cache" / "stratalux"
