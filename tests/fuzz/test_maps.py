"""Damaged maps: read, or refused in one line; no crash, no hang, no traceback, and no more memory than allowed."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.damage import damaged, sound_files
from tests.fuzz.processes import failures
from tests.helpers import run


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
    assert failures("worker", tmp_path, 0, 2000) == []


@pytest.mark.slow
@pytest.mark.parametrize("part", range(5))
def test_many_damaged_maps(tmp_path: Path, part: int) -> None:
    assert failures("worker", tmp_path, 10_000 * (part + 1), 10_000 * (part + 2)) == []


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
