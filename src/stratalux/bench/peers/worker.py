"""The near side of :mod:`.serve`: starts the process of a renderer, tells it what to render, and outlives it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .serve import MARK

PEERS = {"Cycles": ("cycles", "bpy"), "LuxCore": ("luxcore", "pyluxcore")}
"""The file beside this one and the package of each renderer."""
SERVER = Path(__file__).with_name("serve.py")
_PROBE = """
import json, sys
from importlib.metadata import PackageNotFoundError, version
found = {}
for name in sys.argv[1:]:
    try:
        found[name] = version(name)
    except PackageNotFoundError:
        found[name] = None
print(json.dumps(found))
"""
_PATIENCE = 10.0
"""Seconds that a process has to end by itself."""


class PeerError(Exception):
    """A renderer has failed; the message is one line."""


@dataclass(frozen=True)
class PeerShot:
    """One rendering: samples per pixel taken, seconds of it alone and of what came before, pixels (H, W, 3)."""

    spp: float
    seconds: float
    setup_seconds: float
    image: NDArray[np.float32]


def find_peers(python: str | None = None) -> dict[str, str]:
    """Versions of the packages of all renderers, as the interpreter ``python`` (by default, this one) has them.

    Raises :class:`InputError`, saying what to type, if one is missing.
    """
    python = python or sys.executable
    packages = [package for _, package in PEERS.values()]
    try:
        answer = subprocess.run([python, "-c", _PROBE, *packages], capture_output=True, text=True, check=True).stdout
        found: dict[str, str | None] = json.loads(answer)
    except (OSError, subprocess.SubprocessError, ValueError):
        raise InputError(f"{python}: is no Python interpreter that works; give another with --peers-python") from None
    missing = [f"{package} ({name})" for name, (_, package) in PEERS.items() if found[package] is None]
    if missing:
        raise InputError(
            f"--peers needs {' and '.join(missing)}, which {python} does not have; type: {python} -m pip install "
            "'stratalux[peers]', with Python 3.11 or 3.13, or name an interpreter that has them with --peers-python"
        )
    return {name: str(version) for name, version in found.items()}


class Peer:
    """A renderer with the scene in ``folder``, in a process of the interpreter ``python``; use it in a ``with``."""

    def __init__(self, name: str, folder: Path, python: str | None = None) -> None:
        self.name, self.folder = name, folder
        self._errors = (folder / f"{PEERS[name][0]}.log").open("w", encoding="utf-8")
        self._process = subprocess.Popen(
            [python or sys.executable, str(SERVER), PEERS[name][0], str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
        )
        try:
            about = self._answer()
        except PeerError:
            self.close()
            raise
        self.version: str = about["version"]
        self.configurations: dict[str, dict[str, Any]] = about["configurations"]
        self.load_seconds: float = about["load_seconds"]

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def render(self, configuration: str, spp: int, seed: int) -> PeerShot:
        """Raises :class:`PeerError` if the renderer fails, and ever after."""
        job = {"settings": self.configurations[configuration], "spp": spp, "seed": seed}
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(job) + "\n")
            self._process.stdin.flush()
        except OSError:
            raise self._failure() from None
        return PeerShot(**self._answer(), image=np.load(self.folder / "image.npy"))

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            self._process.stdin.close()
            self._process.wait(_PATIENCE)
        except (OSError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()
        self._errors.close()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith(MARK):
                content: dict[str, Any] = json.loads(line[len(MARK) :])
                return content
        raise self._failure()

    def _failure(self) -> PeerError:
        code = self._process.wait()
        how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with status {code}"
        lines = (self.folder / f"{PEERS[self.name][0]}.log").read_text(encoding="utf-8", errors="replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")
        return PeerError(f"{self.name} {how}: {last}")
