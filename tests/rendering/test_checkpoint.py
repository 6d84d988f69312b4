"""A picture in the making, kept in a file."""

from __future__ import annotations

import os
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import stratalux
from stratalux import InputError
from stratalux.rendering.checkpoint import Checkpoint
from tests.helpers import scene_dict

SAMPLING = {
    "automatic": {"technique": "stratified"},
    "paths": {"technique": "path-stratified:max_depth=3"},
    "pinned": {"strata": 4},
    "in one": {"technique": "path-stratified:max_depth=3"},
    "shared": {"technique": "path-stratified:max_depth=3"},
}
PLACES = {"in one": ("indirect.whole.FEW", 1 << 30), "shared": ("indirect.sharing.ENCLOSED", -1)}
"""What makes paths be of that kind, whatever the scene."""


@pytest.mark.parametrize("name", SAMPLING)
def test_what_goes_on_ends_as_what_was_not_stopped(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """From every pass, through a file; bit for bit where the film is ours, to rounding where it is Mitsuba's."""
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", 1500)
    monkeypatch.setattr("stratalux.integrators.indirect.tiles.ROOM", 1500)
    monkeypatch.setattr("stratalux.rendering.steps._SAMPLES_PER_PASS", 4 * 18 * 12 * 4)
    if name in PLACES:
        place, value = PLACES[name]
        monkeypatch.setattr(f"stratalux.integrators.{place}", value)
    scene, files, last = mi.load_dict(scene_dict("roughplastic")), [], None
    for k, last in enumerate(stratalux.render_passes(scene, spp=32, seed=3, **SAMPLING[name])):
        files.append(tmp_path / f"{k}.checkpoint")
        last.checkpoint().save(files[-1])
    assert last is not None and len(files) > 4
    for path in files[:: max(1, len(files) // 4)]:
        again = stratalux.render(scene, spp=32, seed=3, resume=path, **SAMPLING[name])
        assert again.spp == last.spp and again.earlier_seconds > 0
        if name == "pinned":
            np.testing.assert_allclose(again.image, last.image, rtol=1e-4, atol=1e-6)
        else:
            np.testing.assert_array_equal(again.image, last.image)


def test_another_picture_is_refused_by_what_differs(tmp_path: Path) -> None:
    path = tmp_path / "a.checkpoint"
    scene = mi.load_dict(scene_dict())
    result = next(stratalux.render_passes(scene, spp=4, seed=3))
    result.checkpoint().save(path)
    stratalux.render(scene, spp=4, seed=3, resume=path, time=100)  # what may differ
    with pytest.raises(InputError, match="seed was 3 and is 4; spp was 4 and is 8"):
        stratalux.render(scene, spp=8, seed=4, resume=path)
    with pytest.raises(InputError, match="another picture: the scene is another one$"):
        stratalux.render(mi.load_dict(scene_dict("roughconductor")), spp=4, seed=3, resume=path)
    params = mi.traverse(scene)
    key = next(name for name in params.keys() if name.endswith("data"))  # noqa: SIM118
    params[key] = params[key] * 2
    params.update()
    with pytest.raises(InputError, match="another picture: the map is another one$"):
        stratalux.render(scene, spp=4, seed=3, resume=path)


def test_what_is_no_parameter_is_compared(tmp_path: Path) -> None:
    """A filter of the film, and a choice of a material, of a scene that a program made."""

    def described(rfilter: str = "box", visible: bool = True) -> mi.Scene:
        description = scene_dict("roughconductor")
        description["ball"]["bsdf"] = {**description["ball"]["bsdf"], "sample_visible": visible}
        description["sensor"]["film"]["rfilter"] = {"type": rfilter}
        return mi.load_dict(description)

    path = tmp_path / "a.checkpoint"
    next(stratalux.render_passes(described(), spp=1)).checkpoint().save(path)
    stratalux.render(described(), spp=1, resume=path)
    for other in (described("tent"), described(visible=False)):
        with pytest.raises(InputError, match="another picture: the scene is another one$"):
            stratalux.render(other, spp=1, resume=path)


def test_where_a_texture_lies_is_no_difference(tmp_path: Path) -> None:
    """On another machine, for instance."""
    texels = mi.Bitmap(np.full((2, 2, 3), 0.5, dtype=np.float32))

    def textured(folder: str) -> mi.Scene:
        (tmp_path / folder).mkdir()
        texels.write(str(tmp_path / folder / f"{folder}.exr"))
        description = scene_dict()
        texture = {"type": "bitmap", "filename": str(tmp_path / folder / f"{folder}.exr")}
        description["ball"]["bsdf"] = {"type": "diffuse", "reflectance": texture}
        return mi.load_dict(description)

    path = tmp_path / "a.checkpoint"
    next(stratalux.render_passes(textured("here"), spp=1)).checkpoint().save(path)
    stratalux.render(textured("there"), spp=1, resume=path)


def test_versions_are_compared(tmp_path: Path) -> None:
    scene = mi.load_dict(scene_dict())
    kept = next(stratalux.render_passes(scene, spp=4)).checkpoint()
    kept.identity["versions"]["mitsuba"] = "2.0"
    with pytest.raises(InputError, match=f'mitsuba was "2.0" and is "{mi.__version__}"'):
        stratalux.render(scene, spp=4, resume=kept)


@pytest.mark.parametrize("content", [b"", b"nonsense", b"PK\x03\x04 more"])
def test_what_is_no_checkpoint(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.checkpoint"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"a\.checkpoint: is no checkpoint, or a damaged one"):
        Checkpoint.load(path)
    with pytest.raises(InputError, match="cannot be read"):
        Checkpoint.load(tmp_path / "missing.checkpoint")


def test_a_damaged_one_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.checkpoint"
    next(stratalux.render_passes(mi.load_dict(scene_dict()), spp=4)).checkpoint().save(path)
    content = bytearray(path.read_bytes())
    rng = np.random.default_rng(1)
    for _ in range(40):
        damaged = bytearray(content[: rng.integers(len(content))]) if rng.random() < 0.5 else bytearray(content)
        for _ in range(3):
            if damaged:
                damaged[rng.integers(len(damaged))] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        try:
            Checkpoint.load(path)
        except InputError as error:
            assert "a.checkpoint: is no checkpoint, or a damaged one" in str(error)


def test_a_file_appears_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.checkpoint"
    kept = next(stratalux.render_passes(mi.load_dict(scene_dict()), spp=4)).checkpoint()
    kept.save(path)
    before = path.read_bytes()

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        kept.save(path)
    assert path.read_bytes() == before and os.listdir(tmp_path) == ["a.checkpoint"]


def test_a_program_s_own_integrator_has_none() -> None:
    scene, own = mi.load_dict(scene_dict()), mi.load_dict({"type": "direct"})
    result = next(stratalux.render_passes(scene, integrator=own, spp=1))
    assert result.checkpoint is None
    with pytest.raises(InputError, match="resume: an integrator of a program's own"):
        stratalux.render(scene, integrator=own, spp=1, resume=Checkpoint({}, {}, 0.0))
