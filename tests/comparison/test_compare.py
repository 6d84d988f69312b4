"""Comparisons: who takes part, with how many rays and how much time, and what is written."""

from __future__ import annotations

import importlib.util
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import stratalux
from stratalux import Comparison, InputError
from stratalux.comparison import contest, results
from stratalux.comparison.compare import surface_mask
from stratalux.comparison.records import Spread
from stratalux.comparison.results import check_folder, describe
from stratalux.images.metrics import relative_mse, rmse, why_no_flip
from stratalux.integrators import plugins, techniques
from stratalux.integrators.techniques import Property, Technique
from tests.helpers import scene_dict
from tests.variants import MONO, RGB

ENTRIES = ("stratified:proposals=1", "stratified:proposals=2", "direct", "path")
RAYS = (16, 4)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def compared(cache: Path) -> Comparison:
    mi.set_variant(RGB)
    return small(ENTRIES, cache, rays=RAYS, repeats=3, reference_spp=1024, name="ball")


def small(entries: Any, cache: Path, **options: Any) -> Comparison:
    options = {"rays": (4,), "spp": 2, "repeats": 1, "reference_spp": 64, **options}
    return stratalux.compare(mi.load_dict(scene_dict("roughplastic")), entries, cache=cache, **options)


def test_every_entry_gets_every_number_of_rays(compared: Comparison) -> None:
    assert [entry.name for entry in compared.entries] == list(ENTRIES)
    for records in (compared.equal_rays, compared.equal_time):
        assert [(r.rays, r.entry.name) for r in records] == [(n, name) for n in (4, 16) for name in ENTRIES]
    for record in compared.equal_rays:
        assert record.rays_per_pixel == record.rays * 2
        assert record.camera_rays == 18 * 12 * record.spp and record.shadow_rays == 18 * 12 * record.rays * 2
        assert record.spp == (record.rays if record.entry.name == "path" else 2)
    assert compared.equal_rays[1].integrator["strata"] == 4 and compared.equal_rays[1].integrator["proposals"] == 2
    assert compared.equal_rays[2].integrator["emitter_samples"] == 3  # and one from the BSDF


def test_errors_are_those_of_the_images_and_fall_with_rays(compared: Comparison) -> None:
    truth = compared.reference.image
    for record in (*compared.equal_rays, *compared.equal_time):
        assert set(record.errors) == {"surface", "image"}
        assert record.errors["image"].rmse.values[0] == pytest.approx(rmse(record.image, truth), rel=1e-5)
        first = record.errors["surface"].relative_mse.values[0]
        assert first == pytest.approx(relative_mse(record.image, truth, compared.surface), rel=1e-5)
        for errors in record.errors.values():
            assert len(set(errors.relative_mse.values)) == 3  # other seeds
            cost = record.seconds.median * errors.relative_mse.median
            assert errors.efficiency == pytest.approx(1 / cost)
    few, many = compared.equal_rays[:4], compared.equal_rays[4:]
    for a, b in zip(few, many, strict=True):
        assert b.errors["surface"].relative_mse.maximum < a.errors["surface"].relative_mse.minimum
        assert b.errors["surface"].rmse.median < a.errors["surface"].rmse.median
    best = [max(compared.relative_to_best(r) for r in records) for records in (few, many)]
    assert best == [1, 1]


def test_the_reference_is_made_by_another_estimator(compared: Comparison) -> None:
    assert compared.reference.estimator["type"] == "volpath"
    assert not any(record.errors["surface"].reference_limited for record in compared.equal_rays[:4])


def test_the_same_seed_gives_the_same_images(compared: Comparison, cache: Path) -> None:
    again = small((ENTRIES[0], "path"), cache, rays=(4,), repeats=1)
    np.testing.assert_allclose(again.equal_rays[0].image, compared.equal_rays[0].image, rtol=1e-4, atol=1e-5)
    other = small((ENTRIES[0],), cache, rays=(4,), repeats=1, seed=1)
    assert np.abs(other.equal_rays[0].image - compared.equal_rays[0].image).max() > 1e-3


def test_equal_time_scales_the_samples(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a clock of ours: a technique takes a fixed time and, for each ray of a sample, a time of its own."""
    render = contest.render

    def timed(scene: mi.Scene, *, integrator: mi.Integrator, spp: int, **options: Any) -> Any:
        cost = 0.1 if "PathIntegrator" in str(integrator) else 0.4
        return replace(render(scene, integrator=integrator, spp=spp, **options), seconds=2 + cost * spp)

    monkeypatch.setattr(contest, "render", timed)
    result = small(("stratified:proposals=1", "path", "direct"), cache, rays=(16,), spp=4)
    assert [r.spp for r in result.equal_rays] == [4, 32, 4]
    budget = 2 + 0.4 * 4
    assert [r.seconds.median for r in result.equal_rays] == pytest.approx([budget, 5.2, budget])
    assert all(r.budget_seconds == budget for r in result.equal_time)
    assert [r.spp for r in result.equal_time] == [4, 16, 4]
    assert all(abs(r.seconds.median - budget) < 0.1 * budget for r in result.equal_time)


def test_equal_time_gives_at_least_one_sample(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    render = contest.render

    def timed(scene: mi.Scene, *, integrator: mi.Integrator, spp: int, **options: Any) -> Any:
        cost = 100.0 if "proposals = 7" in str(integrator) else 0.001
        return replace(render(scene, integrator=integrator, spp=spp, **options), seconds=cost * spp)

    monkeypatch.setattr(contest, "render", timed)
    result = small((ENTRIES[0], "direct", "stratified:proposals=7"), cache)
    assert [r.spp for r in result.equal_time] == [2, 2, 1]


def test_a_sampler_that_rounds_up_is_counted(cache: Path) -> None:
    description = scene_dict()
    description["sensor"]["sampler"] = {"type": "multijitter", "sample_count": 4}
    scene = mi.load_dict(description)
    result = stratalux.compare(scene, ["path"], rays=[10], spp=1, repeats=1, reference_spp=16, cache=cache)
    assert result.equal_rays[0].spp == 6 and result.equal_rays[0].rays_per_pixel == 12


def test_a_technique_that_is_new_takes_part(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing but its description is needed, and one that lies about being unbiased shows in its errors."""
    half = Technique(
        name="half",
        plugin="half_light",
        summary="half of the light",
        source="nowhere",
        unbiased=False,
        properties={"beams": Property(1, "rays", minimum=1)},
        rays=("beams",),
    )

    class HalfLight(mi.SamplingIntegrator):
        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            self.inner = mi.load_dict({"type": "direct", "emitter_samples": props["beams"], "bsdf_samples": 0})

        def sample(self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True) -> Any:
            L, valid, aovs = self.inner.sample(scene, sampler, ray, medium, active)
            return 0.5 * L, valid, aovs

        def to_string(self) -> str:
            return "HalfLight"

    mi.register_integrator("half_light", HalfLight)
    module = type("module", (), {"TECHNIQUES": (half,), "PLUGINS": {"half_light": HalfLight}})
    modules = plugins.integrator_modules()
    monkeypatch.setattr(plugins, "integrator_modules", lambda: [*modules, module])
    assert "half" in techniques.techniques()
    result = small(("half", "stratified"), cache, rays=(16,), spp=8, reference_spp=1024)
    mine, theirs = result.equal_rays
    assert mine.integrator == {"type": "half_light", "beams": 16} and mine.rays_per_pixel == 128
    assert mine.errors["image"].rmse.median > 2 * theirs.errors["image"].rmse.median
    assert describe(result)["entries"][0]["unbiased"] is False


@pytest.mark.parametrize(
    ("entries", "options", "words"),
    [
        ((), {}, "no technique"),
        (("nonsense",), {}, "technique 'nonsense' is unknown"),
        (("stratified:strata=x",), {}, "not of type int"),
        (("direct", "direct"), {}, "given twice"),
        (("direct",), {"rays": ()}, "no number"),
        (("direct",), {"rays": (0, 4)}, "rays: 0"),
        (("direct",), {"spp": 0}, "spp: 0"),
        (("direct",), {"repeats": 0}, "repeats: 0"),
        (("direct",), {"reference_spp": 0}, "reference_spp: 0"),
        (("direct",), {"seed": 1 << 16}, "seed"),
        (("direct",), {"camera": 1}, "camera '1'"),
    ],
)
def test_bad_requests(cache: Path, entries: tuple[str, ...], options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        small(entries, cache, **options)


def test_progress_goes_from_0_to_1(cache: Path, tmp_path: Path) -> None:
    for made_before in (False, True):
        told: list[tuple[float, str]] = []
        small(("path",), tmp_path, progress=lambda done, what, told=told: told.append((done, what)))
        done = [fraction for fraction, _ in told]
        assert done == sorted(done) and done[-1] == pytest.approx(1) and "path" in {what for _, what in told}
        assert ("reference" in {what for _, what in told}) is not made_before


@pytest.mark.parametrize("rfilter", ["box", "gaussian"])
def test_the_mask_of_surfaces(rfilter: str) -> None:
    description = scene_dict(size=(48, 32))
    description["sensor"]["film"]["rfilter"] = {"type": rfilter}
    mask = surface_mask(mi.load_dict(description))
    assert mask.shape == (32, 48) and 0.5 < mask.mean() < 1
    description["sky"] = {"type": "constant"}
    for name in ("ball", "box", "floor"):
        description[name]["bsdf"] = {"type": "diffuse", "reflectance": 0.0}
    image = np.array(mi.render(mi.load_dict(description), integrator=mi.load_dict({"type": "path"}), spp=256))
    assert (image[mask].max(axis=1) > 0).mean() < 0.01 and (image[~mask] > 0).any()
    assert ((image[..., 0] == 0) & ~mask).mean() < 0.02
    del description["ball"], description["box"], description["floor"]
    assert not surface_mask(mi.load_dict(description)).any()


def test_a_scene_without_surfaces(cache: Path, tmp_path: Path) -> None:
    description = scene_dict()
    del description["ball"], description["box"], description["floor"]
    result = stratalux.compare(
        mi.load_dict(description), ["stratified"], rays=[4], spp=1, repeats=1, reference_spp=16, cache=cache
    )
    result.write(tmp_path / "r")
    content = json.loads((tmp_path / "r" / "results.json").read_text())
    assert content["region"] == "image" and content["equal_rays"][0]["surface"] is None


def test_the_folder_is_complete(compared: Comparison, tmp_path: Path) -> None:
    compared.write(tmp_path / "r")
    assert [path.name for path in tmp_path.iterdir()] == ["r"]
    content = json.loads((tmp_path / "r" / "results.json").read_text())
    assert sorted(content["files"]) == sorted(path.name for path in (tmp_path / "r").iterdir())
    stems = ["reference"]
    stems += [f"{name}-{n}{tail}" for name in map(slug, ENTRIES) for n in (4, 16) for tail in ("", "-equal-time")]
    assert {f"{stem}{suffix}" for stem in stems for suffix in (".exr", ".png")} <= set(content["files"])
    assert {f"error-{x}.{y}" for x in ("rays", "time") for y in ("svg", "png")} <= set(content["files"])
    page = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert "report.html" in content["files"] and page.startswith("<!DOCTYPE html>") and "Comparison: ball" in page
    image = mi.Bitmap(str(tmp_path / "r" / "direct-4.exr"))
    np.testing.assert_array_equal(np.array(image), compared.equal_rays[2].image)
    assert json.loads(image.metadata()["integrator"])["emitter_samples"] == 3

    assert content["format"] == results.FORMAT and content["settings"]["scene"] == "ball"
    assert content["versions"]["mitsuba"] == mi.__version__ and "core" in content["machine"]
    assert content["reference"]["estimator"]["type"] == "volpath"
    assert content["reference"]["surface"]["relative_mse_floor"] > 0
    for record in (*content["equal_rays"], *content["equal_time"]):
        assert record["entry"] in ENTRIES and record["seconds"]["min"] <= record["seconds"]["median"]
        assert record["preprocessing_seconds"] >= 0 and record["compile_seconds"] >= 0 and record["shadow_rays"] > 0
        for region in ("surface", "image"):
            figures = record[region]
            assert len(figures["rmse"]["values"]) == 3 and figures["relmse"]["median"] > 0
            assert 0 < figures["relative_to_best"] <= 1 and figures["efficiency"] > 0
            assert (figures["flip"] is None) is (why_no_flip() is not None)
    assert all(record["budget_seconds"] is None for record in content["equal_rays"])
    assert all(record["budget_seconds"] > 0 for record in content["equal_time"])


def slug(name: str) -> str:
    return name.replace(":", "-").replace("=", "-")


def test_without_the_optional_packages(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, package=None: None)
    result = small(("stratified",), cache)
    result.write(tmp_path / "r")
    content = json.loads((tmp_path / "r" / "results.json").read_text())
    assert content["equal_rays"][0]["image"]["flip"] is None
    assert not any(name.startswith("error-") for name in content["files"])
    assert sum("pip install" in note for note in content["notes"]) == 2


def test_figures_that_do_not_exist_are_null(compared: Comparison, tmp_path: Path) -> None:
    record = compared.equal_rays[0]
    broken = {
        region: replace(errors, relative_mse=Spread((np.nan,)), flip=float("nan"), efficiency=float("inf"))
        for region, errors in record.errors.items()
    }
    odd = replace(compared, equal_rays=(replace(record, errors=broken), *compared.equal_rays[1:]))
    odd.write(tmp_path / "r")
    figures = json.loads((tmp_path / "r" / "results.json").read_text())["equal_rays"][0]["image"]
    assert figures["relmse"]["median"] is None and figures["flip"] is None and figures["efficiency"] is None


def test_only_results_are_replaced(compared: Comparison, tmp_path: Path) -> None:
    target = tmp_path / "r"
    target.mkdir()
    compared.write(target)  # an empty folder may be filled
    with pytest.raises(InputError, match="--force"):
        check_folder(target)
    compared.write(target, force=True)
    (target / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="also holds 'notes.txt'"):
        compared.write(target, force=True)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="is not empty"):
        compared.write(tmp_path / "other", force=True)
    with pytest.raises(InputError, match="is a file"):
        check_folder(target / "notes.txt", force=True)
    with pytest.raises(InputError, match="cannot be written"):
        check_folder(tmp_path / "no" / "such" / "place")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other", "r"]


def test_an_interrupted_write_leaves_what_was_there(
    compared: Comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    compared.write(tmp_path / "r")
    before = (tmp_path / "r" / "results.json").read_text()
    monkeypatch.setattr(results, "_finite", interrupt)
    for target in ("r", "new"):
        with pytest.raises(KeyboardInterrupt):
            compared.write(tmp_path / target, force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["r"]
    assert (tmp_path / "r" / "results.json").read_text() == before


def test_one_channel(cache: Path, tmp_path: Path) -> None:
    mi.set_variant(MONO)
    description = scene_dict()
    description["sensor"]["film"]["pixel_format"] = "luminance"
    result = stratalux.compare(
        mi.load_dict(description), ["stratified"], rays=[4], spp=1, repeats=1, reference_spp=16, cache=cache
    )
    assert result.reference.image.shape == (12, 18, 1)
    result.write(tmp_path / "r")
    assert mi.Bitmap(str(tmp_path / "r" / "stratified-4.exr")).channel_count() == 1
