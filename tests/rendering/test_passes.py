"""Passes, metadata and the image at the end."""

from __future__ import annotations

import itertools
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import stratalux
from stratalux import InputError
from stratalux.images.writing import write_image
from tests.helpers import scene_dict


def scene(**film: object) -> mi.Scene:
    description = scene_dict("diffuse")
    description["sensor"]["film"].update(film)
    return mi.load_dict(description)


@pytest.mark.parametrize("pixel_format", ["rgb", "rgba", "luminance"])
def test_passes_add_up_to_one_image(monkeypatch: pytest.MonkeyPatch, pixel_format: str) -> None:
    gaussian = scene(rfilter={"type": "gaussian"}, pixel_format=pixel_format)
    whole = stratalux.render(gaussian, strata=8, spp=8, seed=3)
    assert whole.spp == whole.spp_total == 8
    monkeypatch.setattr("stratalux.rendering.steps._SAMPLES_PER_PASS", 2 * 8 * 18 * 12)
    passes = list(stratalux.render_passes(gaussian, strata=8, spp=7, seed=3))
    assert [p.spp for p in passes] == [1, 2, 4, 6, 7]  # the first are smaller
    # The same film, fed by hand with the same seeds.
    integrator = mi.load_dict({"type": "direct_stratified", "strata": 8})
    sums = 0
    film = gaussian.sensors()[0].film()
    seeds = [3, *((3 * 0x9E3779B1 + k) % (1 << 32) for k in range(1, 5))]
    for count, pass_seed in zip((1, 1, 2, 2, 1), seeds, strict=True):
        integrator.render(gaussian, gaussian.sensors()[0], seed=pass_seed, spp=count, develop=False, evaluate=True)
        sums = sums + np.array(film.develop(raw=True))
    weight = sums[..., -1:]
    expected = (sums / weight)[..., :-1]
    if pixel_format == "luminance":
        expected = expected[..., :3] @ [[0.212671], [0.715160], [0.072169]]
    np.testing.assert_allclose(passes[-1].image.reshape(expected.shape), expected, rtol=1e-3, atol=1e-5)


def test_the_same_seed_gives_the_same_image() -> None:
    first, again = (stratalux.render(scene(), strata=8, spp=4, seed=5).image for _ in range(2))
    np.testing.assert_allclose(first, again, rtol=1e-5, atol=1e-6)
    other = stratalux.render(scene(), strata=8, spp=4, seed=6).image
    assert np.abs(first - other).max() > 1e-3


def test_leaving_the_loop_keeps_what_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stratalux.rendering.steps._SAMPLES_PER_PASS", 1)
    for result in stratalux.render_passes(scene(), strata=4, spp=5):
        if result.spp == 2:
            break
    assert result.spp == 2 and result.spp_total == 5
    assert np.isfinite(result.image).all() and result.image.mean() > 0


def test_counts_and_times() -> None:
    result = stratalux.render(scene(), strata=8, proposals=2, spp=4)
    assert result.camera_rays == 18 * 12 * 4
    assert result.shadow_rays == 18 * 12 * 4 * 8
    assert result.seconds > 0 and result.preparation_seconds > 0 and result.compile_seconds >= 0


def test_the_scene_decides_the_samples_unless_told() -> None:
    assert stratalux.render(scene(), strata=4).spp == 4


def test_any_integrator_can_take_part() -> None:
    result = stratalux.render(scene(), integrator=mi.load_dict({"type": "direct"}), spp=4)
    assert result.image.shape == (12, 18, 3)


def test_metadata_is_in_the_file(tmp_path: Path) -> None:
    result = stratalux.render(scene(), strata=8, proposals=2, spp=4, seed=9)
    result.write(tmp_path / "a.exr")
    metadata = mi.Bitmap(str(tmp_path / "a.exr")).metadata()
    assert [metadata[key] for key in ("strata", "proposals", "spp", "seed")] == [8, 2, 4, 9]
    assert metadata["seconds"] == pytest.approx(result.seconds, rel=1e-5)
    assert stratalux.__version__ in metadata["version"]
    np.testing.assert_allclose(np.array(mi.Bitmap(str(tmp_path / "a.exr"))), result.image, rtol=1e-6)


def test_bad_requests() -> None:
    with pytest.raises(InputError, match=r"camera '3': there is none; give one of 0 \('sensor'\)"):
        stratalux.render(scene(), camera=3)
    with pytest.raises(InputError, match="strata: -1 is too small"):
        stratalux.render(scene(), strata=-1)
    mi.set_variant("scalar_rgb")
    with pytest.raises(InputError, match="vectorised"):
        stratalux.render(mi.load_dict({"type": "scene"}))


@pytest.mark.parametrize(("reflectance", "stops"), [(0.18, -1.0), (0.002, 0.0)])
def test_the_automatic_exposure_knows_the_light(reflectance: float, stops: float, tmp_path: Path) -> None:
    """Under an even light of 2: a grey card becomes middle grey, and a black one, before black, no more than dark."""
    card = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nusemtl card\nf 1 3 2\nf 1 4 3\n"
    (tmp_path / "card.obj").write_text(f"mtllib card.mtl\n{card}", encoding="utf-8")
    (tmp_path / "card.mtl").write_text(f"newmtl card\nKd{3 * f' {reflectance}'}\nillum 1\n", encoding="utf-8")
    write_image(tmp_path / "even.exr", np.full((8, 16, 3), 2, dtype=np.float32))
    result = stratalux.render(
        tmp_path / "card.obj",
        environment=tmp_path / "even.exr",
        orbit="0,89",
        background="black",
        ground="none",
        size=(16, 16),
        spp=16,
    )
    assert result.exposure == pytest.approx(stops, abs=0.05)


def test_what_is_done_of_each_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    """It grows from launch to launch, up to all there is; of a picture that ends by its time, the whole is told."""
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", 6000)
    work = [dict(one.work) for one in stratalux.render_passes("demo", size=(24, 16), spp=64)]
    assert list(work[0]) == ["direct/pilot", "direct/later", "paths/pilot", "paths/later"] and len(work) > 8
    for before, after in itertools.pairwise(work):
        assert sum(after[kind] > before[kind] for kind in before) == 1  # each launch is of one kind
    for kind, (done, whole) in work[-1].items():
        assert done == pytest.approx(whole)
        assert work[0][kind][0] == 0 or kind.endswith("pilot")
    first = next(iter(stratalux.render_passes("demo", size=(24, 16), spp=64, time=1e5)))
    assert first.work == {"": (first.share, 1.0)}
