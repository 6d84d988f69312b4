"""Workers in processes of their own: what ends them or hangs is found, and the next takes over."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
from pathlib import Path

from tests.helpers import PATIENCE

ROOT = Path(__file__).parents[2]
SECONDS = 60.0
"""For each input. It only ends what hangs."""
_BEGIN = PATIENCE
"""Until a worker has begun."""


def failures(worker: str, folder: Path, first: int, last: int, seconds: float = SECONDS) -> list[str]:
    """What goes wrong with the inputs of these numbers in ``worker``, a module of this folder.

    It prints "begun", and then a line for each: its number, and what has gone wrong, if anything.
    """
    found = []
    while first < last:
        command = [sys.executable, "-m", f"tests.fuzz.{worker}", str(folder), str(first), str(last)]
        path = os.pathsep.join([str(ROOT), str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
        with subprocess.Popen(
            command, cwd=ROOT, env={**os.environ, "PYTHONPATH": path}, stdout=subprocess.PIPE, text=True, bufsize=1
        ) as process:
            assert process.stdout is not None
            limit = _BEGIN
            while True:
                start = time.monotonic()
                line = process.stdout.readline() if select.select([process.stdout], [], [], limit)[0] else "hang"
                if line == "hang" or time.monotonic() - start > limit:
                    process.kill()
                    found.append(f"{first}: took longer than {limit} s")
                    first += 1
                    break
                number, _, wrong = line.strip().partition(" ")
                if not line:
                    if process.wait():
                        found.append(f"{first}: ended the process ({process.returncode})")
                    first = last if process.returncode == 0 else first + 1
                    break
                limit = seconds
                if wrong:
                    found.append(line.strip())
                if number.isdigit():
                    first = int(number) + 1
                elif number == "memory":
                    limit = _BEGIN
    return found
