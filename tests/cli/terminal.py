"""A command with a terminal for its progress, and what is to be seen there."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
from pathlib import Path
from types import TracebackType

from tests.helpers import PATIENCE


class Terminal:
    """``stratalux`` with ``arguments``, as another process; what it prints on standard output is left in ``out``."""

    def __init__(self, folder: Path, *arguments: str, **environment: str) -> None:
        self.seen, self.out = "", folder / "stdout.txt"
        self._terminal, end = os.openpty()
        with self.out.open("w") as out:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "stratalux", *arguments],
                cwd=folder,
                stdout=out,
                stderr=end,
                env={**os.environ, "COLUMNS": "120", "TERM": "xterm", **environment},
                # Where the tests run in a shell's background, the signal is ignored, which a child would inherit.
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509
            )
        os.close(end)

    def __enter__(self) -> Terminal:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._terminal)

    def wait_for(self, pattern: str) -> None:
        """Read until ``pattern``, a regular expression, is to be seen."""
        while not re.search(pattern, self.seen):
            assert self._read(), f"ended before {pattern!r} was to be seen:\n{self.seen}"

    def finish(self) -> int:
        """Read until the command has ended; its exit code."""
        while self._read():
            pass
        return self.process.wait(PATIENCE)

    def _read(self) -> bool:
        """A little more of what is to be seen; false where nothing more comes."""
        ready, _, _ = select.select([self._terminal], [], [], PATIENCE)
        assert ready, f"nothing happens:\n{self.seen}"
        try:
            chunk = os.read(self._terminal, 4096)
        except OSError:  # Linux's way to say that the other end is closed
            return False
        self.seen += chunk.decode(errors="replace")
        return bool(chunk)
