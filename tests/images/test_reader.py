"""The process that reads: what ends it, or never ends, is one line."""

from __future__ import annotations

import os
import signal
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from stratalux import InputError
from stratalux.images import reader as reader_module
from stratalux.images.reader import Reader, ReadError
from stratalux.images.reading import read_image
from stratalux.images.room import Room
from tests.images.make import card, write


@pytest.mark.parametrize(
    ("program", "message"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", r"ended the reader \(SIGSEGV\); copy it again"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGABRT)", "SIGABRT"),
        ("import sys; sys.exit(3)", "exit code 3"),
        ("import os; os.write(1, b'What?' * 9); input()", "ended the reader"),
        ("import os; os.write(1, b'J' + b'\\xff' * 8); input()", "ended the reader"),
        ("input(); input()", "given up after"),
    ],
)
def test_a_reader_that_dies_or_hangs_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, program: str, message: str
) -> None:
    path = write(tmp_path / "a.exr", card())
    with Reader() as reader:
        with monkeypatch.context() as patch:
            (tmp_path / "program.py").write_text(program)
            patch.setattr(reader_module, "_PROGRAM", tmp_path / "program.py")
            patch.setattr(reader_module, "_SECONDS", 0.2 if "given up" in message else 60)
            with pytest.raises(InputError, match=f"^{path}: damaged.*{message}") as error:
                read_image(path, reader=reader)
        assert "\n" not in str(error.value)
        np.testing.assert_array_equal(read_image(path, reader=reader).pixels, card())  # the next one starts


def test_an_answer_is_read_to_its_end_before_the_next(tmp_path: Path) -> None:
    """After pixels that are cut off in the middle, the same process reads on."""
    good = write(tmp_path / "a.exr", card(200, 100), compression="none")
    content = good.read_bytes()
    bad = tmp_path / "b.exr"
    bad.write_bytes(content[: len(content) // 2])
    with Reader() as reader:
        for _ in range(3):
            with pytest.raises(InputError, match="cannot be read"):
                read_image(bad, reader=reader)
            np.testing.assert_array_equal(read_image(good, reader=reader).pixels, card(200, 100))


@pytest.mark.skipif(sys.platform != "linux", reason="macOS does not limit the memory of a process")
def test_memory_is_limited(tmp_path: Path) -> None:
    """A header that says tiles of 6 GB."""
    path = write(tmp_path / "a.exr", card(), tile=16)
    content = bytearray(path.read_bytes())
    place = content.find(b"tiles\0tiledesc\0") + len(b"tiles\0tiledesc\0") + 4
    content[place : place + 8] = struct.pack("<2I", 25_600, 20_000)
    path.write_bytes(content)
    with Reader() as reader:
        part = reader.parts(path)[0]
        assert part["tile"] == [25_600, 20_000]
        with pytest.raises(ReadError):
            reader.pixels(path, part, 0, [0, 1, 2], (0, 32), (0, 16))
        with pytest.raises(InputError, match="tiles of 25600x20000 in an image of 32x16"):
            read_image(path, reader=reader)


def test_nothing_of_the_reader_is_left(tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", card())
    with Reader() as reader:
        read_image(path, reader=reader)
        process = reader._process
        assert process is not None and process.poll() is None
    assert process.returncode == -signal.SIGKILL
    before = len(os.listdir("/proc/self/fd")) if Path("/proc/self/fd").exists() else 0
    for _ in range(3):
        read_image(path)
    assert len(os.listdir("/proc/self/fd")) == before if before else True


@pytest.mark.skipif(not Room.there(), reason="the system has no memory without a file")
def test_pixels_in_memory_that_is_shared(tmp_path: Path) -> None:
    """In the middle of it, and nowhere else; what does not fit is refused, and the array outlives the room."""
    codes = np.random.default_rng(1).integers(0, 256, (300, 70, 3), dtype=np.uint8)
    write(tmp_path / "a.png", codes)
    size, at = codes.size, 5001
    with Room() as room, Reader(room) as reader:
        shared = room.array(at + size + 10)
        part = reader.parts(tmp_path / "a.png")[0]
        into = shared[at : at + size].reshape(codes.shape)
        ask = (tmp_path / "a.png", part, 0, [0, 1, 2], (0, 70), (0, 300))
        assert reader.pixels(*ask, into, at) is into
        np.testing.assert_array_equal(into, codes)
        for rows, message in ((into[:-1], "more pixels than expected"), (np.empty((301, 70, 3), np.uint8), "missing")):
            with pytest.raises((ReadError, InputError), match=message if rows is not into else ""):
                reader.pixels(*ask, rows, 0)
        shared[at : at + size] = 0
        reader.pixels(*ask, into, at)
    np.testing.assert_array_equal(into, codes)
    assert not shared[at + size :].any()
