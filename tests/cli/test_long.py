"""Long renders: ended by signals, killed, gone on with, and written elsewhere where their place has gone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import PATIENCE
from tests.helpers import run as command

PICTURE = ("demo", "--size", "64x48", "--direct", "--spp", "768", "--float32")
"""Several launches; seconds."""
ENDLESS = ("demo", "--size", "64x48", "--direct", "--time", "10m")


def start(folder: Path, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "stratalux", "render", *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, cwd=folder, text=True, preexec_fn=heed_signals, **pipes)  # noqa: PLW1509


def heed_signals() -> None:
    """Those that whoever runs the tests ignores, too, as nohup does."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        signal.signal(getattr(signal, name), signal.SIG_DFL)


def run(folder: Path, *words: str) -> tuple[int, str]:
    with start(folder, *words) as process:
        out, err = process.communicate(timeout=PATIENCE)
    assert "Traceback" not in err
    return process.returncode, out + err


def wait_for(path: Path, process: subprocess.Popen[str]) -> None:
    """Until the file is there; a generous limit ends what hangs."""
    for _ in range(int(PATIENCE / 0.01)):
        if path.exists():
            return
        assert process.poll() is None, process.communicate()
        try:
            process.wait(0.01)
        except subprocess.TimeoutExpired:
            continue
    raise AssertionError(f"{path} did not appear")


def pixels(path: Path) -> np.ndarray:
    return np.array(mi.Bitmap(str(path)))


@pytest.mark.slow
def test_killed_and_gone_on_with_it_is_the_same_picture(tmp_path: Path) -> None:
    """Bit for bit. Killed twice: in the beginning, and after it went on."""
    assert run(tmp_path, *PICTURE, "-o", "whole.exr")[0] == 0
    kept = tmp_path / "c.checkpoint"
    keeping = ("--checkpoint", kept.name, "--checkpoint-every", "0", "-o", "killed.exr")
    for resume in ((), ("--resume", kept.name)):
        before = kept.stat().st_mtime_ns if resume else 0
        with start(tmp_path, *PICTURE, *keeping, *resume) as process:
            wait_for(kept, process)
            while resume and process.poll() is None and kept.stat().st_mtime_ns == before:
                time.sleep(0.01)  # until it is another file
            process.send_signal(signal.SIGKILL)
        assert not (tmp_path / "killed.exr").exists()
    code, said = run(tmp_path, *PICTURE, "--resume", kept.name, "-o", "killed.exr")
    assert code == 0, said
    np.testing.assert_array_equal(pixels(tmp_path / "killed.exr"), pixels(tmp_path / "whole.exr"))


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_keeps_what_is_done(name: str, tmp_path: Path) -> None:
    number = getattr(signal, name)
    with start(tmp_path, *ENDLESS, "--checkpoint", "c.checkpoint", "--checkpoint-every", "0", "-o", "a.exr") as process:
        wait_for(tmp_path / "c.checkpoint", process)
        process.send_signal(number)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 128 + number and "Traceback" not in err
    assert "the same command goes on with --resume c.checkpoint" in err
    assert pixels(tmp_path / "a.exr").mean() > 0


def test_another_picture_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    small = ("render", "demo", "--size", "8x6", "--direct", "-o", "a.exr")
    assert command(monkeypatch, *small, "--spp", "4", "--checkpoint", "c.checkpoint") == 0
    assert command(monkeypatch, *small, "--spp", "8", "--resume", "c.checkpoint") == 2
    assert "c.checkpoint: belongs to another picture: spp was 4 and is 8" in capfd.readouterr().err
    assert command(monkeypatch, *small, "--spp", "8", "--resume", "missing.checkpoint") == 2
    assert "missing.checkpoint: cannot be read" in capfd.readouterr().err


def test_where_the_place_has_gone_the_image_is_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home, gone = tmp_path / "home", tmp_path / "gone"
    home.mkdir()
    gone.mkdir()
    monkeypatch.setenv("HOME", str(home))
    words = (*ENDLESS, "--checkpoint", "c.checkpoint", "--checkpoint-every", "0", "-o", "gone/a.exr", "-o", "b.exr")
    with start(tmp_path, *words) as process:
        wait_for(tmp_path / "c.checkpoint", process)
        gone.rmdir()
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=PATIENCE)
    (folder,) = [path for path in home.iterdir() if path.name.startswith("stratalux-")]
    assert process.returncode == 2 and f"the image is in {folder / 'a.exr'}" in err and "Traceback" not in err
    assert pixels(folder / "a.exr").mean() > 0 and (tmp_path / "b.exr").exists()


def test_an_early_end_is_one_line(tmp_path: Path) -> None:
    """Ctrl-C while Python imports."""
    with start(tmp_path, *ENDLESS, "-o", "a.exr") as process:
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode in (130, -signal.SIGINT) and "Traceback" not in err) or "stratalux" not in err


@pytest.mark.slow
def test_killed_at_fifty_moments(tmp_path: Path) -> None:
    """Each some launches further; the last run goes on to the end."""
    assert run(tmp_path, *PICTURE, "-o", "whole.exr")[0] == 0
    kept = tmp_path / "c.checkpoint"
    rng = np.random.default_rng(1)
    for moment in range(50):
        if moment % 10 == 0:
            kept.unlink(missing_ok=True)
        resume = ("--resume", kept.name) if kept.exists() else ()
        keeping = ("--checkpoint", kept.name, "--checkpoint-every", "0", "-o", "killed.exr")
        with start(tmp_path, *PICTURE, *keeping, *resume) as process:
            try:
                process.wait(float(rng.uniform(0.5, 8)))  # any moment will do
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
        if kept.exists() and moment % 10 == 9:
            assert run(tmp_path, *PICTURE, "--resume", kept.name, "-o", "killed.exr")[0] == 0
            np.testing.assert_array_equal(pixels(tmp_path / "killed.exr"), pixels(tmp_path / "whole.exr"))
            os.unlink(tmp_path / "killed.exr")


def test_what_takes_long_to_keep_is_kept_rarely(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten seconds for each checkpoint: the next one comes after twenty times that, and not every minute."""
    from types import SimpleNamespace

    from stratalux.cli.watch import Keeper

    now, kept = 0.0, []

    def save(path: Path) -> None:
        nonlocal now
        kept.append(now)
        now += 10.0

    monkeypatch.setattr("stratalux.cli.watch.time.monotonic", lambda: now)
    result: Any = SimpleNamespace(checkpoint=lambda: SimpleNamespace(save=save))
    keeper = Keeper(tmp_path / "a.checkpoint", True, 60.0)
    while now < 700:
        now += 5.0
        keeper.after(result)
    assert kept == [60.0, 270.0, 480.0, 690.0]
