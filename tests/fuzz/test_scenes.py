"""Damaged scenes: rendered, or refused in one line; no crash, no hang, no traceback, and no picture without numbers."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import pytest

from stratalux import load_scene
from tests.fuzz.processes import failures
from tests.fuzz.scenes import damaged_scene, make_files, sound_scene


@pytest.mark.filterwarnings("ignore::stratalux.errors.SceneWarning")
def test_sound_scenes_are_sound(tmp_path: Path) -> None:
    """Or the damaged ones would all be refused for nothing."""
    make_files(tmp_path)
    loaded = 0
    for number in range(40):
        path = tmp_path / "scene.xml"
        path.write_text(sound_scene(number))
        try:
            loaded += isinstance(load_scene(path), mi.Scene)
        except ValueError as error:  # two maps, no camera, a film of spectra
            assert any(word in str(error) for word in ("Only one environment", "no sensor", "spectral", "shapegroup"))
    assert loaded > 30
    assert damaged_scene(5) == damaged_scene(5) != damaged_scene(6)


def test_damaged_scenes(tmp_path: Path) -> None:
    assert failures("scene_worker", tmp_path, 0, 90) == []


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_many_damaged_scenes(tmp_path: Path, part: int) -> None:
    assert failures("scene_worker", tmp_path, 1000 * part, 1000 * (part + 1)) == []
