"""Independent parts of what is measured, each on a machine of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from ...errors import InputError
from . import LOCAL
from .client import cluster
from .worker import RESOURCE, in_turn

Part = TypeVar("Part")


def timed(
    where: str, variant: str, function: Callable[[Part], Any], parts: Sequence[Part]
) -> Iterator[tuple[Part, Any]]:
    """``function`` of each of the ``parts``, by workers of the cluster at the address ``where``, as they come.

    One at a time on each machine, whatever workers it has, as times are taken. A part whose worker is lost is begun
    again by another. Raises :class:`InputError` for ``local:N``, whose processes share one machine.
    """
    if where.startswith(LOCAL):
        raise InputError(
            f"cluster: times are taken, and the processes of {where} would share a machine; give a scheduler's address"
        )
    with cluster(where, variant) as workers:
        chosen = workers.one_of_each_machine()
        options = {"resources": {RESOURCE: 1}, "workers": chosen, "retries": 3}
        futures = {workers.submit(in_turn, function, part, **options): part for part in parts}
        for future in workers.as_they_come(list(futures)):
            yield futures[future], future.result()


def files_of(make: Callable[[Path], Any], below: str) -> dict[str, bytes]:
    """What ``make`` leaves in the folder ``below`` of one that it is given, by name."""
    with TemporaryDirectory(prefix="stratalux-") as folder:
        make(Path(folder))
        return {path.name: path.read_bytes() for path in (Path(folder) / below).iterdir()}
