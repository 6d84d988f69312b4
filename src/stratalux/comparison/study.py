"""A run that can be interrupted: every step's result is kept in a folder, and is not computed again."""

from __future__ import annotations

import hashlib
import json
import warnings
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import CacheWarning
from ..images.files import write_atomically

Result = dict[str, Any]
"""Arrays by name, and plain JSON values (numbers, strings, lists, dictionaries) by name."""
Progress = Callable[[float, str], None]
"""Told the fraction of the run that is done, and what is going on."""
Fraction = Callable[[float], None]
"""Told by a step which fraction of it is done."""


class Study:
    """The steps of a run. ``folder``: of their results. ``total``: work of all steps, about seconds on two cores.

    ``common``: what every result depends on (versions, variant, sizes of the assets), part of every step's key.
    """

    def __init__(self, folder: Path, common: Mapping[str, Any], total: float, progress: Progress | None = None) -> None:
        self.folder, self.common, self.total, self.progress = folder, dict(common), total, progress
        self.done = 0.0
        self.resumed = 0
        """Steps whose results were found."""
        self._taken: set[Path] = set()
        self.numbers: dict[str, Result] = {}
        """What the steps so far have found, by name, without the arrays."""

    def step(
        self, name: str, settings: Mapping[str, Any], work: float, compute: Callable[[Fraction], Result]
    ) -> Result:
        """The result of ``compute``, or the one kept from an earlier run with the same ``settings``.

        ``compute`` is given a function to report its own progress to. A damaged file counts as none, with a
        :class:`CacheWarning`. ``work`` counts once for a step that several parts of the run share.
        """
        key = hashlib.sha256(json.dumps([name, self.common, settings], sort_keys=True, default=str).encode())
        path = self.folder / f"{name}-{key.hexdigest()[:16]}.npz"
        work = 0.0 if path in self._taken else work
        self._taken.add(path)
        result = _read(path)
        if result is None:
            self._show(0.0, name)
            result = compute(lambda fraction: self._show(fraction * work, name))
            _write(path, result)
        else:
            self.resumed += 1
        self.numbers[name] = {key: value for key, value in result.items() if not isinstance(value, np.ndarray)}
        self.done += work
        self._show(0.0, name)
        return result

    def _show(self, more: float, name: str) -> None:
        if self.progress is not None:
            self.progress(min(1.0, (self.done + more) / self.total) if self.total else 1.0, name)


def _read(path: Path) -> Result | None:
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as stored:
            plain = json.loads(str(stored["plain"]))
            return plain | {name[1:]: stored[name] for name in stored.files if name.startswith("_")}
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
        warnings.warn(f"{path}: damaged ({error}); this step is computed again", CacheWarning, stacklevel=3)
        return None


def _write(path: Path, result: Result) -> None:
    arrays: dict[str, Any] = {f"_{k}": v for k, v in result.items() if isinstance(v, np.ndarray)}
    plain = {k: v for k, v in result.items() if not isinstance(v, np.ndarray)}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, lambda name: np.savez(name, plain=json.dumps(plain), **arrays))
