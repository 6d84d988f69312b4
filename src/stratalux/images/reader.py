"""A process of its own that reads image files: whatever a damaged one does there, it does not do here.

Half a million damaged files have not crashed OpenImageIO 3.2, but have made it take minutes and gigabytes: for tiles
that a header says are of 25,600 x 65,280 pixels, for instance. Nor will it be the only release that there is. So each
file is read by a process with a limit to its memory, which is ended when it takes too long. That costs a tenth of a
second, most of it to import NumPy.
"""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import select
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .room import Room

_PROGRAM = Path(__file__).with_name("reader_process.py")
_SECONDS = 9.0
"""For a small file."""
_FILE_BYTES_PER_SECOND, _BYTES_PER_SECOND = 2e6, 1e7
"""How slowly a large one may be read, and decoded, before it counts as hung."""
_MEMORY = 1 << 30
"""Bytes that decoding may take, and :data:`_COPIES` times the pixels: some formats are decoded as a whole."""
_COPIES = 4
_KEEP = {"MALLOC_MMAP_THRESHOLD_": str(1 << 25), "MALLOC_TRIM_THRESHOLD_": str(1 << 27)}
"""Lets glibc use the memory of rows for the next ones: pages that are new to a process cost more than decoding does."""
_PIPE = 1 << 20
_MESSAGE = struct.Struct("<cQ")
_LONGEST_TEXT = 1 << 24


class ReadError(Exception):
    """Why a file cannot be read, in the words of the library that was to read it."""


class Reader:
    """Reads the files of one caller, one after the other, and is started again after one that it did not survive.

    A context manager. Methods raise :class:`ReadError` with the message of the library, and :class:`InputError` if the
    process ended or had to be ended. ``room``: memory that it shares with this process.
    """

    def __init__(self, room: Room | None = None) -> None:
        self._room = room
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Reader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for pipe in (self._process.stdin, self._process.stdout):
                assert pipe is not None
                with contextlib.suppress(BrokenPipeError):
                    pipe.close()
            self._process = None

    def parts(self, path: Path) -> list[dict[str, Any]]:
        """A description of each image in the file, as :func:`.reader_process.parts` makes it."""
        answer = self._ask(path, {"what": "parts"}, np.empty(0, dtype=np.float32))
        found: list[dict[str, Any]] = answer["parts"]
        return found

    def pixels(
        self,
        path: Path,
        part: dict[str, Any],
        number: int,
        channels: Sequence[int | None],
        columns: tuple[int, int],
        rows: tuple[int, int],
        into: NDArray[np.uint8 | np.uint16 | np.float16 | np.float32] | None = None,
        at: int | None = None,
    ) -> NDArray[Any]:
        """Pixels (rows, columns, channels) of the part with that ``number``, float32.

        ``columns`` and ``rows``: the first one, and the one after the last, in the coordinates of the file. ``into``:
        an array for them, of float32, or of the type of whole numbers or half floats that the file has; ``at``: the
        byte of the room where it begins, if it is there. A channel of None is as large as can be.
        """
        pixels: NDArray[Any] = (
            np.empty((rows[1] - rows[0], columns[1] - columns[0], len(channels)), np.float32) if into is None else into
        )
        wide = any(part["types"][c] in ("uint", "uint32") for c in channels if c is not None)
        request = {
            "what": "pixels",
            "core": part["core"],
            "part": number,
            "type": str(into.dtype) if into is not None else "uint" if wide else "float",
            "channels": list(channels),
            "columns": columns,
            "rows": rows,
        }
        if at is not None and self._room is not None:
            request["room"] = (self._room.descriptor, at, pixels.nbytes)
        self._ask(path, request, pixels)
        return pixels

    def _ask(self, path: Path, request: dict[str, Any], pixels: NDArray[Any]) -> dict[str, Any]:
        """The answer to ``request``; what pixels there are in it go to ``pixels``."""
        process = self._process or self._start(() if self._room is None else (self._room.descriptor,))
        self._process = process
        assert process.stdin is not None
        seconds = _SECONDS + os.path.getsize(path) / _FILE_BYTES_PER_SECOND + 4 * pixels.size / _BYTES_PER_SECOND
        request |= {"path": os.path.abspath(path), "memory": _MEMORY + _COPIES * 4 * pixels.size}
        left = memoryview(b"" if "room" in request else pixels.reshape(-1).view(np.uint8).data)
        deadline = time.monotonic() + seconds
        try:
            process.stdin.write(json.dumps(request).encode() + b"\n")
            process.stdin.flush()
            while True:
                header = bytearray(_MESSAGE.size)
                self._receive(memoryview(header), deadline)
                kind, length = _MESSAGE.unpack(header)
                if kind == b"P" and length <= len(left):
                    self._receive(left[:length], deadline)
                    left = left[length:]
                    continue
                if kind != b"J" or length > _LONGEST_TEXT:
                    raise EOFError
                text = bytearray(length)
                self._receive(memoryview(text), deadline)
                answer: dict[str, Any] = json.loads(text)
                break
        except TimeoutError:
            self.close()
            raise InputError(
                f"{path}: damaged, or the disk is slow: reading it was given up after {seconds:.0f} s; copy it again"
            ) from None
        except (EOFError, BrokenPipeError):
            raise InputError(f"{path}: damaged: reading it ended the reader ({self._end()}); copy it again") from None
        except BaseException:
            self.close()  # in the middle of an answer
            raise
        if "error" in answer:
            raise ReadError(answer["error"])
        if len(left):
            raise ReadError(f"{len(left)} of {pixels.nbytes} bytes are missing")
        return answer

    def _receive(self, into: memoryview, deadline: float) -> None:
        assert self._process is not None and self._process.stdout is not None
        pipe, poll = self._process.stdout.fileno(), select.poll()
        poll.register(pipe, select.POLLIN)
        while len(into):
            if not poll.poll(1000 * max(deadline - time.monotonic(), 0)):
                raise TimeoutError
            count = os.readv(pipe, [into])
            if count == 0:
                raise EOFError
            into = into[count:]

    def _end(self) -> str:
        """How the process ended, in a word or two."""
        assert self._process is not None
        try:
            code = self._process.wait(1)
        except subprocess.TimeoutExpired:
            code = 0
        self.close()
        if code < 0:
            return signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        return f"exit code {code}"

    @staticmethod
    def _start(inherited: Sequence[int]) -> subprocess.Popen[bytes]:
        folders = []
        for library in ("numpy", "OpenImageIO"):
            spec = importlib.util.find_spec(library)
            if spec is None or spec.origin is None:
                raise InputError(f"image files cannot be read without {library}: pip install {library}")
            folders.append(str(Path(spec.origin).parent.parent))
        process = subprocess.Popen(
            # Neither the user's own modules nor those of site-packages that run by themselves at every start.
            [sys.executable, "-I", "-S", str(_PROGRAM), *dict.fromkeys(folders)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=0,
            pass_fds=inherited,
            # Of numbers nothing is computed there; and what allocators reserve for each thread counts as memory.
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2", **_KEEP},
        )
        _widen(process)
        return process


def _widen(process: subprocess.Popen[bytes]) -> None:
    """Let the pipe hold more than 64 KiB, where it can: fewer turns between the two processes."""
    assert process.stdout is not None
    try:
        import fcntl

        fcntl.fcntl(process.stdout.fileno(), fcntl.F_SETPIPE_SZ, _PIPE)
    except (AttributeError, OSError):
        pass  # not on macOS, nor where the user has no more room for pipes
