"""The benchmark from end to end on a made-up map and mesh, its resumption, and its command line."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

from stratalux import bench
from stratalux.assets import Assets
from stratalux.bench import Case, candidates, cases, measure
from stratalux.bench.floor import bare_rays
from stratalux.bench.preparation import synthetic_map
from stratalux.bench.scenes import load_setting
from tests.bench.made_up import TINY, bench_result, make_assets
from tests.helpers import asset, run
from tests.variants import RGB


@pytest.fixture(autouse=True)
def few_configurations(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two of the other side's, as kernels take long to compile."""
    some = [c for c in candidates.mitsuba_configurations() if c.sampler == "multijitter"][1:3]
    monkeypatch.setattr(measure, "mitsuba_configurations", lambda depth: tuple(some))


def test_a_run_measures_everything_and_resumes(tmp_path: Path) -> None:
    assets = make_assets(tmp_path / "assets")
    told: list[float] = []
    options = {"assets": assets, "folder": tmp_path / "out", "cache": tmp_path / "cache", "variant": RGB}
    result = bench.run(TINY, **options, progress=lambda done, what: told.append(done))
    assert told == sorted(told) and told[-1] == pytest.approx(1)
    assert result == bench.BenchResult.read(tmp_path / "out/results.json")
    (case,) = result.cases
    assert case.surface_fraction == 1 and case.means["surface"] == pytest.approx(0.2, rel=0.05)
    verdict = case.verdict("surface")
    assert verdict is not None and verdict.lowest <= verdict.ratio <= verdict.highest
    assert len(case.ours.points) == 3 and all(len(record.points) >= 3 for record in case.theirs)
    assert all(len(point.seconds.values) >= TINY.repeats for point in case.ours.points)
    assert result.floor["ratio"]["median"] > 0 and result.preparation[0]["map_bytes"] == 32 * 16 * 12
    assert result.preparation[0]["table_bytes"]["ours"] == 48 << 16
    assert result.preparation[0]["table_bytes"]["pinned"] > 0

    again = bench.run(TINY, **options)
    assert again.about["resumed"] == 3 and again.cases == result.cases


def test_the_preview_takes_another_map_and_material() -> None:
    asset("scenes/matpreview/matpreview.xml")
    asset("envmaps/sky.hdr")
    suite = bench.Suite(**{**vars(TINY), "preview_size": (16, 12)})
    means = {}
    for material in ("diffuse", "polished"):
        setting = load_setting(bench.Case("sky", material, "matpreview"), suite, Assets())
        assert set(setting.cameras) == set(candidates.SAMPLERS) and setting.size == (16, 12)
        image = mi.render(setting.plain, integrator=mi.load_dict({"type": "direct"}), spp=64)
        assert np.mean(image.numpy()[setting.surface]) == pytest.approx(0.2, rel=0.1)
        means[material] = image.numpy()[4:8, 6:10].std()
    assert means["diffuse"] != pytest.approx(means["polished"], rel=0.1)


def test_a_room_of_its_own(tmp_path: Path) -> None:
    """It needs a map alone. Light comes in by its window, and what it reflects is most of what is seen."""
    case = bench.Case("grace", "diffuse", cases.ROOM)
    assert case.assets == ("grace",) and case in {replace(c, map="grace") for c in cases.LIGHT.cases}
    setting = load_setting(case, replace(TINY, depth=8), Assets(make_assets(tmp_path)))
    assert setting.size == TINY.size and 0.7 < setting.surface.mean() < 1  # the window is seen
    direct, whole = (
        mi.render(setting.plain, integrator=mi.load_dict({"type": "path", "max_depth": depth}), spp=256).numpy()
        for depth in (2, 8)
    )
    assert whole[setting.surface].mean() > 1.5 * direct[setting.surface].mean() > 0


def test_bare_rays_measure_openness() -> None:
    integrator = bare_rays(16)
    scene = {
        "type": "scene",
        "floor": {"type": "rectangle"},
        "sensor": {
            "type": "perspective",
            "fov": 20,
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}},
        },
    }
    assert np.allclose(mi.render(mi.load_dict(scene), integrator=integrator, spp=4), 1)
    scene["lid"] = {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([0, 0, 5]).scale([1e4, 1e4, 1])}
    assert np.allclose(mi.render(mi.load_dict(scene), integrator=integrator, spp=4), 0, atol=0.01)


def test_the_synthetic_map_is_always_the_same() -> None:
    one = synthetic_map(64, 32)
    assert one.shape == (32, 64, 3) and one.min() > 0 and one.max() > 10
    assert np.array_equal(one, synthetic_map(64, 32))


def test_missing_assets_take_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Assets, "find", lambda self, name: None)
    assert run(monkeypatch, "bench") == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and error.startswith("stratalux: error: no case has its files: ")
    assert error.endswith("type: stratalux assets fetch\n")
    assert not any(tmp_path.iterdir())


def test_cases_whose_files_are_missing_are_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The others are measured, and the result says which were not."""
    benchmark = sys.modules["stratalux.bench.benchmark"]
    here, there = (replace(TINY.cases[0], map=name) for name in ("grace", "venice"))
    suite = replace(TINY, cases=(here, there), open_cases=(), preparation=())
    (tmp_path / "file").touch()
    monkeypatch.setattr(Assets, "find", lambda self, name: None if name == "venice" else tmp_path / "file")
    monkeypatch.setattr(benchmark, "measure_floor", lambda *_: {"ratio": {}})
    seen = []

    def measured(case: Case, *_: object, **more: object) -> object:
        seen.append(case)
        return SimpleNamespace(to_json=bench_result().cases[0].to_json)

    monkeypatch.setattr(benchmark, "measure_case", measured)
    result = bench.run(suite, folder=tmp_path / "out", assets=tmp_path)
    assert seen == [here] and len(result.cases) == 1
    assert result.about["left_out"] == [f"{there.name} (venice missing)"]
    assert json.loads((tmp_path / "out" / "results.json").read_text())["left_out"] == result.about["left_out"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--suite", "huge"), "'huge' is not one of 'quick', 'full'"),
        (("--assets", "nowhere"), "nowhere: no such folder"),
        (("-o", "file"), "file: is a file; name another folder with -o"),
        (("--json", "nowhere/x.json"), "nowhere/x.json: cannot be written"),
    ],
)
def test_bad_arguments_take_one_line(
    arguments: tuple[str, ...],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    monkeypatch.setattr(Assets, "find", lambda self, name: tmp_path)
    assert run(monkeypatch, "bench", *arguments) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and message in error


def test_the_command_prints_a_table_or_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fake(suite: bench.Suite, asked: bench.BenchSettings, *machine: object, **more: object) -> bench.BenchResult:
        assert asked.folder is not None
        Path(asked.folder).mkdir(exist_ok=True)
        return bench_result()

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(bench, "run_suite", fake)
    assert run(monkeypatch, "bench") == 0
    printed = capsys.readouterr().out
    for text in ("teapot-metal-sky-open", "surfaces: geometric mean 1.00", "worst teapot-metal-sky 0.50", "8.00"):
        assert text in printed
    assert run(monkeypatch, "bench", "-q", "--json", "-") == 0
    assert json.loads(capsys.readouterr().out)["summary"]["surface"]["cases"] == 2
