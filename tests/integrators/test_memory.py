"""Samples under way at the same time follow from the memory there is, and the picture does not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import stratalux
from stratalux import InputError
from stratalux.integrators.memory import resident, samples_at_once
from tests.helpers import PATIENCE, scene_dict


@pytest.mark.parametrize("direct", [True, False])
def test_the_picture_is_the_same_in_pieces(direct: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """To rounding: pieces begin and end within pixels."""
    scene = mi.load_dict(scene_dict("diffuse", size=(24, 16)))
    asked = {"spp": 32, "seed": 3, "direct": direct}
    whole = stratalux.render(scene, **asked)
    monkeypatch.setattr("stratalux.integrators.automatic.image.samples_at_once", lambda *_: 1000)
    pieces = stratalux.render(scene, **asked)
    assert pieces.checkpoint is not None
    assert int(pieces.checkpoint().memory["direct"]["most"]) == 1000
    np.testing.assert_allclose(pieces.image, whole.image, rtol=1e-5, atol=1e-7)
    assert np.abs(stratalux.render(scene, **{**asked, "seed": 4}).image - whole.image).max() > 1e-3


def test_what_there_is_room_for() -> None:
    film = (1000, 500)
    room = samples_at_once(resident() + (1 << 30), film, 500, 250, 1)
    assert room & (room - 1) == 0 and (1 << 30) / 4 < room * 250 + 500 * 500_000 <= (1 << 30)
    with pytest.raises(InputError, match=r"max_memory: a film of 1000x500 pixels needs \d+M with .* smaller"):
        samples_at_once(resident() + (200 << 20), film, 500, 250, 1)


def test_a_film_that_is_too_large_is_refused() -> None:
    for technique in ("stratified", "path-stratified", "path"):
        with pytest.raises(InputError, match=r"max_memory: a film of 8000x6000 pixels .* there are 1000M;"):
            stratalux.render("demo", size=(8000, 6000), spp=1, technique=technique, max_memory=1000 << 20)
    with pytest.raises(InputError, match=r"memory: a film of 65536x65536 .*; make the film smaller \(--size\)"):
        samples_at_once(None, (1 << 16, 1 << 16), 1000, 250, 1)


def test_numbers_beyond_32_bits() -> None:
    """Of samples, of a picture and of a pixel; the launches cover them all."""
    from stratalux.integrators.automatic.adaptive import _counts
    from stratalux.integrators.automatic.view import Division

    counts = np.full((30, 20), 1 << 24)
    launches = Division(counts, 20, 30, 1 << 21)
    assert launches.until(len(launches)).sum() == 600 << 24 > 1 << 33
    start, end = launches[len(launches) // 2]
    assert 0 < (end - start).sum() <= 1.1 * (1 << 21)
    wanted = np.zeros((40, 40), dtype=np.int64)
    wanted[20, 20] = 1 << 16
    assert _counts(wanted, 1 << 30, 1 << 26, 2).max() <= 1 << 31


def test_a_million_samples_of_a_pixel_have_the_right_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    """The mean of those that are taken is that of the picture: two launches in, of thousands."""
    scene = mi.load_dict(scene_dict("diffuse", size=(6, 4)))
    few = stratalux.render(scene, spp=4096, seed=1, direct=True).image
    passes = stratalux.render_passes(scene, spp=10**6, seed=2, direct=True)
    result = next(passes)
    result = next(passes)
    assert result.spp_total == 10**6
    np.testing.assert_allclose(result.image, few, rtol=0.02, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "words"),
    [
        ("1000x800", ("-s", "32", "--direct", "--max-memory", "1400M")),
        ("1000x800", ("-s", "16", "--max-memory", "1950M")),
        ("2000x1500", ("-s", "2", "--max-memory", "1G", "-t", "importance:samples=2")),
        ("3000x2000", ("-s", "1", "--max-memory", "1500M", "--direct")),
    ],
)
def test_the_limit_holds(size: str, words: tuple[str, ...], tmp_path: Path) -> None:
    """Of the memory that the process has had, at most, from its start to its end: within 10 %."""
    program = (
        "import atexit, resource; atexit.register(lambda: print(resource.getrusage(0).ru_maxrss)); "
        "from stratalux.cli import main; main()"
    )
    command = [sys.executable, "-c", program, "render", "demo", "--size", size, *words, "-o", str(tmp_path / "a.exr")]
    done = subprocess.run([*command, "-q"], capture_output=True, text=True, timeout=PATIENCE, check=True)
    unit = 1 if sys.platform == "darwin" else 1 << 10
    limit = {"M": 1 << 20, "G": 1 << 30}[words[words.index("--max-memory") + 1][-1]]
    limit *= int(words[words.index("--max-memory") + 1][:-1])
    assert int(done.stdout.split()[-1]) * unit <= 1.1 * limit
