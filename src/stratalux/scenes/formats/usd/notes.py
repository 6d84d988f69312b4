"""What a stage says and is not shown: one line for all of it."""

from __future__ import annotations

import warnings
from pathlib import Path

from ....errors import SceneWarning

_NAMED = 3


class Notes:
    """Collects what is to be told of a file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._names: dict[str, dict[str, None]] = {}

    def add(self, what: str, name: object = "") -> None:
        """Tell `what`, with the names of all that it is true of."""
        self._names.setdefault(what, {})[str(name)] = None

    def tell(self) -> None:
        """Warn, if there is anything to tell."""
        lines = []
        for what, found in self._names.items():
            names = [name for name in found if name]
            more = f" and {len(names) - _NAMED} others" if len(names) > _NAMED else ""
            lines.append(f"{what} ({', '.join(names[:_NAMED])}{more})" if names else what)
        if lines:
            warnings.warn(f"{self._path}: {'; '.join(lines)}", SceneWarning, stacklevel=4)
