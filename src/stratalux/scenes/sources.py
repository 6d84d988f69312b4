"""Which files a scene is read from: whoever finds one says so, and whoever has to take them elsewhere listens."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

_listening: ContextVar[dict[Path, None] | None] = ContextVar("listening", default=None)


@contextmanager
def sources() -> Iterator[dict[Path, None]]:
    """The files, by their absolute names, in the order in which they are found meanwhile."""
    found: dict[Path, None] = {}
    token = _listening.set(found)
    try:
        yield found
    finally:
        _listening.reset(token)


def source(path: Path) -> Path:
    """The same path, which is read from."""
    found = _listening.get()
    if found is not None:
        found[path.absolute()] = None
    return path
