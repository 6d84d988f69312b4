"""A whole reproduction, so small that it proves nothing, interrupted and resumed."""

from __future__ import annotations

import json
from pathlib import Path

import mitsuba as mi
import pytest

from stratalux.errors import InputError
from stratalux.reproduce import ITEMS, TINY, reproduce
from tests.reproduce.data import make_assets
from tests.variants import RGB, SPECTRAL


@pytest.fixture(scope="module")
def assets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    mi.set_variant(RGB)
    return make_assets(tmp_path_factory.mktemp("assets"))


def test_everything_with_an_interruption(tmp_path: Path, assets: Path) -> None:
    folder = tmp_path / "out"
    seen: list[float] = []

    def stop(done: float, what: str) -> None:
        seen.append(done)
        if what == "fig4-4":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reproduce(["all"], folder, settings=TINY, assets=assets, progress=stop)
    before = {path.name: path.stat().st_mtime_ns for path in (folder / "steps").iterdir()}
    assert any(name.startswith("fig3") for name in before) and not any(name.startswith("fig5") for name in before)
    assert not (folder / "claims.json").exists()

    seen.clear()
    report = reproduce(["all"], folder, settings=TINY, assets=assets, progress=lambda done, what: seen.append(done))
    after = {path.name: path.stat().st_mtime_ns for path in (folder / "steps").iterdir()}
    assert before.items() <= after.items() and len(after) > len(before)
    # The work of the items is that of their steps: the bar neither stops short nor waits at its end.
    assert seen == sorted(seen) and seen[-1] == pytest.approx(1) and max(s for s in seen[:-4]) < 1

    assert [section.anchor for section in report.sections] == list(ITEMS)
    claims = json.loads((folder / "claims.json").read_text())
    assert claims["format"] == "stratalux-reproduction" and claims["settings"]["name"] == "tiny"
    found = [claim for section in claims["sections"] for claim in section["claims"]]
    assert len(found) >= 25 and all(claim["ours"] for claim in found)
    results = json.loads((folder / "results.json").read_text())
    assert len(results["charts"]) >= 3 and len(results["heat_maps"]) == 3
    assert results["steps"]["fig3"]["outcomes"][0]["technique"].startswith("importance:samples=16,")
    images = sorted(path.name for path in (folder / "images").iterdir())
    assert len([name for name in images if name.endswith(".exr")]) == len(images) / 2 > 8

    again = reproduce(["fig1", "fig3"], folder, settings=TINY, assets=assets)
    assert [section.anchor for section in again.sections] == ["fig1", "fig3"]
    assert {path.name for path in (folder / "steps").iterdir()} == set(after)  # nothing was computed


def test_force_computes_anew(tmp_path: Path, assets: Path) -> None:
    reproduce(["fig1"], tmp_path, settings=TINY, assets=assets)
    (before,) = (path.stat().st_mtime_ns for path in (tmp_path / "steps").iterdir())
    reproduce(["fig1"], tmp_path, settings=TINY, assets=assets, force=True)
    (after,) = (path.stat().st_mtime_ns for path in (tmp_path / "steps").iterdir())
    assert after > before


def test_another_map_is_another_step(tmp_path: Path, assets: Path) -> None:
    reproduce(["fig1"], tmp_path / "out", settings=TINY, assets=assets)
    other = make_assets(tmp_path / "other")
    mi.Bitmap(3 * mi.TensorXf(mi.Bitmap(str(other / "envmaps" / "grace_latlong.exr")))).write(
        str(other / "envmaps" / "grace_latlong.exr")
    )
    reproduce(["fig1"], tmp_path / "out", settings=TINY, assets=other)
    assert len(list((tmp_path / "out" / "steps").iterdir())) == 2


def test_bad_input(tmp_path: Path, assets: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="item 'fig9' is unknown; use fig1, fig2"):
        reproduce(["fig9"], tmp_path / "out", assets=assets)
    with pytest.raises(InputError, match="no such folder"):
        reproduce(["fig1"], tmp_path / "out", assets=tmp_path / "nowhere")
    for where in ("STRATALUX_ASSETS", "STRATALUX_CACHE"):
        monkeypatch.setenv(where, str(tmp_path))
    monkeypatch.setattr("stratalux.assets._beside_checkout", lambda: None)
    with pytest.raises(InputError, match="grace is missing: there is no envmaps/grace_latlong.exr in"):
        reproduce(["fig1"], tmp_path / "out", assets=tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="is a file"):
        reproduce(["fig1"], tmp_path / "file", assets=assets)
    with pytest.raises(InputError, match="is not empty, and holds no reproduction"):
        reproduce(["fig1"], tmp_path, assets=assets)
    mi.set_variant(SPECTRAL)
    with pytest.raises(InputError, match=f"{SPECTRAL}: the paper's figures are in RGB"):
        reproduce(["fig1"], tmp_path / "out", assets=assets)
    assert not (tmp_path / "out").exists()
