"""The one progress bar of all commands."""

from __future__ import annotations

import sys
from typing import Any


def progress_bar(*columns: Any, quiet: bool = False, **options: Any) -> Any:
    """A bar on standard error, shown where that is a terminal."""
    from rich.console import Console  # not before --help
    from rich.progress import Progress

    return Progress(*columns, console=Console(stderr=True), disable=quiet or not sys.stderr.isatty(), **options)


def share_of_work(what: str, *, quiet: bool, **options: Any) -> tuple[Any, Any]:
    """A bar for work of which the share that is done is known, and the function that is told it."""
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    bar = progress_bar(
        TextColumn(what),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
        quiet=quiet,
        **options,
    )
    task = bar.add_task("", total=1.0)
    return bar, lambda done, what: bar.update(task, completed=done, description=what)


def console(width: int | None = None, **options: Any) -> Any:
    """Standard output, ``width`` columns wide where it is no terminal."""
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else width, highlight=False, **options)
