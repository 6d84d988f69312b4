"""The process that reads a stage, and writes what it holds to its standard output; the package starts it.

The answer is pickled: what it is ("model", "refused" or "failed"), the model or the reason, the warnings, and the files
that were read.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import resource
import warnings
from pathlib import Path
from typing import Any

from ....errors import InputError
from ...sources import sources

_LEAST = 4 << 30
"""Bytes of addresses that it may take in any case; otherwise, they are half of the memory that is free."""


def main(path: str) -> None:
    """Read the file, and write the answer."""
    # Libraries print to the standard output what they have to say.
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        _limit_memory()
        pickle.dump(answer(Path(path)), answers, protocol=5)


def answer(path: Path) -> tuple[str, Any, list[str], list[Path]]:
    """What is in the file, what is to be told of it, and what else was read."""
    kind, found = "model", None  # type: str, Any
    with warnings.catch_warnings(record=True) as caught, sources() as read:
        warnings.simplefilter("always")
        try:
            from .stage import read_stage

            found = read_stage(path)
        except InputError as error:
            kind, found = "refused", str(error)
        except MemoryError:
            kind, found = "refused", f"{path}: its data do not fit into memory; export it again, or less of it"
        except Exception as error:  # of whatever kind: there is nobody else to tell
            kind, found = "failed", f"{type(error).__name__}: {error}"
    return kind, found, [str(each.message) for each in caught if issubclass(each.category, UserWarning)], list(read)


def _limit_memory() -> None:
    with contextlib.suppress(OSError, ValueError, StopIteration):  # not on macOS
        with open("/proc/meminfo") as lines:
            free = next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
        resource.setrlimit(resource.RLIMIT_AS, (max(_LEAST, free // 2), resource.getrlimit(resource.RLIMIT_AS)[1]))
