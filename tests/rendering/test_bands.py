"""A film that has no room at once is rendered in bands, and the picture is as right as in one."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import stratalux
from stratalux import InputError
from stratalux.errors import SceneWarning
from stratalux.integrators import memory
from stratalux.integrators.memory import NoRoom, samples_at_once
from stratalux.rendering.bands import bands, number
from stratalux.rendering.checkpoint import Checkpoint
from tests.helpers import assert_same_mean, scene_dict

TECHNIQUES = {
    "automatic": {"technique": "stratified"},
    "paths": {"technique": "path-stratified:max_depth=3"},
    "pinned": {"strata": 4},
}
_ROWS = 18
"""Of a band, about; the film has 48."""
SOME = pytest.mark.filterwarnings("ignore:memory. a film of .* bands:stratalux.errors.SceneWarning")


def film(rfilter: str = "gaussian") -> mi.Scene:
    """A small one."""
    description = scene_dict("roughplastic", size=(24, 48))
    description["sensor"]["film"]["rfilter"] = {"type": rfilter}
    return mi.load_dict(description)


@pytest.fixture
def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    """There is memory for some rows alone."""

    def no_room(limit: int | None, size: tuple[int, int], per_pixel: int, per_sample: int, least: int) -> int:
        width, height = size
        if height > 2 * _ROWS:
            room, each = 16 * width * height, per_pixel + per_sample
            raise NoRoom("no room", room + 2 * _ROWS * width * each, 1 << 40, each)
        return samples_at_once(limit, size, per_pixel, per_sample, least)

    for user in ("integrators.automatic.image", "rendering.steps"):
        monkeypatch.setattr(f"stratalux.{user}.samples_at_once", no_room)


@given(st.integers(1, 3000), st.integers(1, 60), st.integers(0, 3))
def test_bands_cover_a_film_once(height: int, count: int, reach: int) -> None:
    cut = bands(height, min(count, height), reach)
    assert [row for band in cut for row in range(band.top, band.bottom)] == list(range(height))
    for band in cut:
        assert band.first == max(0, band.top - reach) and band.last == min(height, band.bottom + reach)


@SOME
@pytest.mark.usefixtures("narrow")
@pytest.mark.parametrize(("name", "rfilter"), [("automatic", "gaussian"), ("paths", "box"), ("pinned", "gaussian")])
def test_the_mean_is_that_of_the_whole(name: str, rfilter: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of every pixel: also where two bands meet."""
    scene = film(rfilter)
    asked = {"spp": 16, **TECHNIQUES[name]}
    in_bands = [stratalux.render(scene, seed=k, **asked) for k in range(24)]
    monkeypatch.undo()
    whole = [stratalux.render(scene, seed=1000 + k, **asked) for k in range(24)]
    assert in_bands[0].parts == 3 and whole[0].parts == 1
    assert {r.spp for r in in_bands} <= {15, 16, 17}  # where they follow the error
    assert_same_mean(*(np.stack([r.image for r in side]).astype(np.float64) for side in (in_bands, whole)))


@SOME
@pytest.mark.usefixtures("narrow")
@pytest.mark.parametrize("name", TECHNIQUES)
def test_what_goes_on_ends_as_what_was_not_stopped(name: str, tmp_path: Path) -> None:
    """From every pass, through a file; where nothing is left to do, too."""
    scene, files, last = film(), [], None
    for k, last in enumerate(stratalux.render_passes(scene, spp=8, seed=3, **TECHNIQUES[name])):
        files.append(tmp_path / f"{k}.checkpoint")
        last.checkpoint().save(files[-1])
        assert last.image[last.rows].any() and not last.image[last.rows.stop :].any()
    assert last is not None and last.parts == 3 <= len(files)
    for path in files:
        again = stratalux.render(scene, spp=8, seed=3, resume=path, **TECHNIQUES[name])
        assert again.spp == last.spp and again.parts == 3
        if name == "pinned":
            np.testing.assert_allclose(again.image, last.image, rtol=1e-4, atol=1e-6)
        else:
            np.testing.assert_array_equal(again.image, last.image)
    assert "bands" in Checkpoint.load(files[-1]).memory


@SOME
@pytest.mark.usefixtures("narrow")
def test_every_band_has_its_share(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the time, and the error that was asked for."""
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", 2000)
    scene, ended = film(), {}
    for result in stratalux.render_passes(scene, seed=3, target_error=0.05, direct=True):
        ended[result.part] = result
    assert list(ended) == [0, 1, 2]
    last = ended[2]
    for result in ended.values():
        noise, image = last.noise[result.rows], last.image[result.rows]  # type: ignore[index]
        known = np.isfinite(noise)
        assert result.enough and known.any()
        assert np.sqrt(np.square(noise[known]).mean()) <= 0.05 * image[known].mean()
    assert last.error is not None and last.error <= 0.05

    seconds = [r.part for r in stratalux.render_passes(scene, seed=3, time=1e-3, direct=True)]
    assert seconds == [0, 1, 2]  # the first pass of each is one too many


@SOME
@pytest.mark.usefixtures("narrow")
def test_how_much_is_done() -> None:
    results = list(stratalux.render_passes(film(), spp=8, seed=3, direct=True))
    shares = [r.share for r in results]
    assert shares == sorted(shares) and shares[-1] == 1.0
    for done, whole in results[-1].work.values():
        assert done == pytest.approx(whole)
    assert results[-1].spp == 8 and results[0].spp < 8


@pytest.mark.usefixtures("narrow")
def test_it_is_told() -> None:
    with pytest.warns(SceneWarning, match="memory: a film of 24x48 pixels has no room at once; it is rendered in 3 b"):
        stratalux.render(film(), spp=1)


def test_where_the_picture_itself_has_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    small, enough = mi.load_dict({"type": "hdrfilm", "width": 1000, "height": 1000}), 40_000_000
    assert number(NoRoom("no room", 16_000_000 + 2 * 1000 * 100 * 1000, enough, 1000.0), small) == 10
    # No room beside the picture; bands of ten rows, which would be mostly edges; no room for its files
    for room, most in ((15_000_000, enough), (16_000_000 + 2 * 1000 * 10 * 1000, enough), (1 << 30, enough - 1)):
        with pytest.raises(InputError, match="no room"):
            number(NoRoom("no room", room, most, 1000.0), small)
    monkeypatch.setattr(memory, "default_memory", lambda: 1 << 20)
    with pytest.raises(InputError, match=r"memory: a film of 600x400 pixels needs \d+M with its scene and map"):
        stratalux.render("demo", size=(600, 400), spp=1)


def test_what_was_begun_as_a_whole_stays_one(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """With less memory, it cannot go on; nothing of it is lost."""
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", 2000)
    scene, asked = film(), {"spp": 8, "seed": 3, "direct": True}
    first = next(stratalux.render_passes(scene, **asked))
    request.getfixturevalue("narrow")
    with pytest.raises(InputError, match="no room"):
        stratalux.render(scene, **asked, resume=first.checkpoint())
    assert pickle.loads(pickle.dumps(NoRoom("no room", 1, 2, 3.0))).each == 3.0  # from a worker


@SOME
@pytest.mark.usefixtures("narrow")
def test_the_camera_is_as_before() -> None:
    scene = film()
    passes: Any = stratalux.render_passes(scene, spp=4)
    for _ in passes:
        own = scene.sensors()[0].film()
        assert tuple(own.crop_size()) == (24, 48) and tuple(own.crop_offset()) == (0, 0)
