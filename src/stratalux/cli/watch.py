"""A picture in the making, watched: a bar, signals that end it early, and a checkpoint every minute."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from .left import TimeLeft, said
from .progress import progress_bar

if TYPE_CHECKING:
    from ..rendering.passes import RenderResult

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
_LONG = 120.0
"""Seconds after which a picture is kept in a checkpoint that nobody has asked for."""
_RARELY = 20
"""Times as long as it takes to keep it, at least, until it is kept again: a large one takes many seconds."""


class Keeper:
    """Keeps a picture in a checkpoint at ``path``, every so many seconds; unless it was ``asked`` for, only one that
    takes long, and only as long as it is not complete. ``expected``: nobody need be told of a file that is there."""

    def __init__(self, path: Path, asked: bool, every: float, expected: bool = False) -> None:
        self.path, self._asked, self._every = path, asked, every
        self._begun = self._last = time.monotonic()
        self._took = 0.0
        self._kept = self._failed = False
        if not asked and not expected and path.exists():
            _tell(f"warning: {path} is there, of a picture that was not completed; --resume {path} goes on with it")

    def after(self, result: RenderResult) -> None:
        """A pass is done."""
        now = time.monotonic()
        every = max(self._every, _RARELY * self._took)
        if now - self._last >= every and (self._asked or now - self._begun >= _LONG):
            self._save(result)
            self._last = time.monotonic()
            self._took = self._last - now

    def end(self, result: RenderResult, complete: bool) -> None:
        """It was the last one, and all that was asked for, or not."""
        if complete and not self._asked:
            if self._kept:
                self.path.unlink(missing_ok=True)
        elif self._asked or self._kept or time.monotonic() - self._begun >= _LONG:
            self._save(result)
            if self._kept and not complete:
                _tell(f"the same command goes on with --resume {self.path}")

    def _save(self, result: RenderResult) -> None:
        if result.checkpoint is None:
            return
        try:
            result.checkpoint().save(self.path)
        except OSError as error:
            if not self._failed:
                _tell(f"warning: {self.path}: no checkpoint can be written ({error.strerror or error}); going on")
            self._failed = True
            return
        if not self._kept and not self._asked:
            _tell(f"checkpoint: {self.path}")
        self._kept, self._failed = True, False


@dataclass(frozen=True)
class Watched:
    """The last ``result``, the signal that has ``stopped`` it, or 0, and why it has ``failed``, or nothing."""

    result: RenderResult | None
    stopped: int
    failed: str


def watch(start: Callable[[], Iterator[RenderResult]], keeper: Keeper | None, *, quiet: bool) -> Watched:
    """Run the passes that ``start`` gives. Raises :class:`InputError` as long as there is no result."""
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn

    caught, told = 0, False

    def stop(number: int, _: object) -> None:
        nonlocal caught
        if caught:  # the second time, at once
            raise KeyboardInterrupt
        caught = number

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[spp]}"),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TextColumn("{task.fields[left]}"),
    )
    previous = {number: signal.getsignal(number) for number in _SIGNALS}
    # Where the samples of a pixel follow its error, there may be a few less in the end than asked for.
    result, complete, failed = None, False, ""
    try:
        with progress_bar(*columns, quiet=quiet) as progress:
            task = progress.add_task("loading", total=1.0, spp="", rate="", left=said(None))
            ahead = TimeLeft()
            passes = start()
            for number in _SIGNALS:
                if number != getattr(signal, "SIGHUP", None) or previous[number] is not signal.SIG_IGN:  # as by nohup
                    signal.signal(number, stop)
            progress.update(task, description="rendering")
            for result in passes:
                rate = f"{(result.camera_rays + result.shadow_rays) / max(result.seconds, 1e-9) / 1e6:.1f} M rays/s"
                left = said(ahead.after(result.work, result.seconds))
                progress.update(task, completed=result.share, spp=_said(result), rate=rate, left=left)
                if result.workers and not told and not quiet:
                    _tell(f"cluster: {result.workers}")
                    told = True
                if keeper is not None:
                    keeper.after(result)
                if caught:
                    complete = result.enough or result.spp >= result.spp_total
                    break
            else:
                complete = True
    except InputError as error:
        if result is None:
            raise
        failed = str(error)
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
    if result is not None and keeper is not None:
        keeper.end(result, complete)
    return Watched(result, 0 if complete else caught, failed)


def _said(result: RenderResult) -> str:
    spp = result.picture.sampling.spp if result.picture else result.spp_total
    error = f", error {100 * result.error:.2g} %" if result.error is not None else ""
    band = f", band {result.part + 1}/{result.parts}" if result.parts > 1 else ""
    return f"{result.spp}/{spp} spp{error}{band}" if spp else f"{result.spp} spp{error}{band}"


def _tell(text: str) -> None:
    print(f"stratalux: {os.fsencode(text).decode('utf-8', 'replace')}", file=sys.stderr, flush=True)
