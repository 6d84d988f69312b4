"""Damaged maps: read, or refused in one line; no crash, no hang, no traceback, and no more memory than allowed."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.fuzz.damage import damaged, sound_files
from tests.helpers import run

SECONDS = 10.0
"""For each file. It only ends what hangs."""
ROOT = Path(__file__).parents[2]


def failures(folder: Path, first: int, last: int) -> list[str]:
    """What goes wrong with the damaged maps of these numbers, each of which is read by a process of its own."""
    found = []
    while first < last:
        command = [sys.executable, "-m", "tests.fuzz.worker", str(folder), str(first), str(last)]
        path = os.pathsep.join([str(ROOT), str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
        with subprocess.Popen(
            command, cwd=ROOT, env={**os.environ, "PYTHONPATH": path}, stdout=subprocess.PIPE, text=True, bufsize=1
        ) as process:
            assert process.stdout is not None
            limit = 120.0  # until it has begun
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
                limit = SECONDS
                if wrong:
                    found.append(line.strip())
                if number.isdigit():
                    first = int(number) + 1
                elif number == "memory":
                    limit = 120.0
    return found


def test_sound_files_are_sound(tmp_path: Path) -> None:
    """Or the damaged ones would all be refused for nothing."""
    from stratalux.images.reader import Reader
    from stratalux.images.reading import read_image

    files = sound_files(tmp_path / "sound")
    with Reader() as reader:
        for name, content in files.items():
            path = tmp_path / name
            path.write_bytes(content)
            if name != "deep.exr":
                assert read_image(path, reader=reader).pixels.size
    assert len(files) > 100
    assert damaged(files["zip-half.exr"], 5) == damaged(files["zip-half.exr"], 5) != damaged(files["zip-half.exr"], 6)


def test_damaged_maps(tmp_path: Path) -> None:
    assert failures(tmp_path, 0, 2000) == []


@pytest.mark.slow
@pytest.mark.parametrize("part", range(5))
def test_many_damaged_maps(tmp_path: Path, part: int) -> None:
    assert failures(tmp_path, 10_000 * (part + 1), 10_000 * (part + 2)) == []


@pytest.mark.parametrize("name", ["zip-half.exr", "new.hdr", "float.pfm", "uint8.png"])
def test_the_command_says_it_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    content = sound_files(tmp_path / "sound")[name]
    path = tmp_path / name
    path.write_bytes(content[: len(content) // 2])
    assert run(monkeypatch, "stratify", str(path), "-n", "4", "-o", str(tmp_path / "a.png")) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.startswith(f"stratalux: error: {path}: ") and err.count("\n") == 1
