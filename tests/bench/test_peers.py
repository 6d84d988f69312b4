"""The renderers of others: both sides of their processes on a made-up one, the records, and the real ones if there."""

from __future__ import annotations

import importlib.util
import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from stratalux import InputError
from stratalux.assets import Assets
from stratalux.bench import BenchResult, BenchSettings, Case, Suite
from stratalux.bench import run as run_benchmark
from stratalux.bench.markdown import markdown
from stratalux.bench.peers import worker
from stratalux.bench.peers.measure import PEER_SPP, measure_peers, plateau_of
from stratalux.bench.peers.records import PeersResult
from stratalux.bench.peers.scene import export, turned, z_up
from stratalux.bench.peers.worker import PEERS, Peer, PeerError, find_peers
from stratalux.bench.scenes import load_setting
from tests.bench.made_up import CUBE, TINY, bench_result, make_assets, peers_result
from tests.helpers import run

FAKE = """
import os, sys
import numpy as np

CONFIGURATIONS = {"slow": {"seconds": 2.0}, "quick": {"seconds": 1.0}}

def version():
    return "Fake 1"

class Renderer:
    def __init__(self, scene, folder):
        self.width, self.height = scene["size"]

    def render(self, settings, spp, seed):
        print("renderers talk")
        if spp == WRONG:
            print("no more light", file=sys.stderr, flush=True)
            os.abort()
        noise = np.random.default_rng(seed).normal(size=(self.height, self.width, 3)) / np.sqrt(spp)
        return 0.2 + noise, {"spp": spp, "seconds": settings["seconds"] * spp, "setup_seconds": 0.5}
"""


@pytest.fixture
def fakes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Two renderers of our own, the second of which fails at 5 samples per pixel."""
    folder = tmp_path / "fakes"
    folder.mkdir()
    shutil.copy(worker.SERVER, folder)
    (folder / "good.py").write_text(FAKE.replace("WRONG", "0"))
    (folder / "bad.py").write_text(FAKE.replace("WRONG", "5"))
    monkeypatch.setattr(worker, "SERVER", folder / "serve.py")
    peers = worker.PEERS
    monkeypatch.setattr(worker, "PEERS", {"Good": ("good", "numpy"), "Bad": ("bad", "numpy")})
    monkeypatch.setattr("stratalux.bench.peers.measure.PEERS", worker.PEERS)
    assert peers is not worker.PEERS
    monkeypatch.delenv("PYTHONFAULTHANDLER", raising=False)  # it adds lines to what an abort says
    return folder


def test_a_renderer_answers_and_its_crash_is_one_line(fakes: Path, tmp_path: Path) -> None:
    np.savez(tmp_path / "scene.npz", size=np.array([3, 2]))
    with Peer("Bad", tmp_path) as peer:
        assert peer.version == "Fake 1" and list(peer.configurations) == ["slow", "quick"]
        shot = peer.render("quick", 4, 1)
        assert shot.image.shape == (2, 3, 3) and (shot.spp, shot.seconds, shot.setup_seconds) == (4, 4.0, 0.5)
        assert np.array_equal(shot.image, peer.render("slow", 4, 1).image)
        for _ in range(2):
            with pytest.raises(PeerError, match="^Bad was ended by SIGABRT: no more light$"):
                peer.render("quick", 5, 1)


def test_a_renderer_that_does_not_start_is_one_line(fakes: Path, tmp_path: Path) -> None:
    with pytest.raises(PeerError, match=r"^Good ended with status 1: .*scene\.npz"):
        Peer("Good", tmp_path)


def test_one_that_fails_does_not_take_the_other_with_it(fakes: Path, tmp_path: Path) -> None:
    mi.set_variant("llvm_ad_rgb")
    assets = Assets(make_assets(tmp_path / "assets"))
    told: list[float] = []
    result = measure_peers(
        TINY.cases[0], TINY, assets, cache=tmp_path / "cache", peer_spp=(2, 4, 5, 8), fraction=told.append
    )
    good, bad = result.peers
    assert good.chosen == "quick" and good.failure is None and good.curve is not None
    assert [point.spp for point in good.curve.points] == [2, 4, 5, 8] and result.verdict(good) is not None
    assert all(len(point.seconds.values) == 2 for point in good.curve.points)
    assert good.plateau is not None and good.agreement == pytest.approx(1, abs=0.2)
    assert bad.failure == "Bad was ended by SIGABRT: no more light"
    assert told == sorted(told) and told[-1] == pytest.approx(1)
    assert PeersResult.from_json(json.loads(json.dumps(result.to_json()))) == result


def test_missing_packages_take_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(worker, "PEERS", {"Cycles": ("cycles", "no-such-package"), "LuxCore": ("luxcore", "numpy")})
    assert run(monkeypatch, "bench", "--peers") == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and error.startswith(
        "stratalux: error: --peers needs no-such-package (Cycles), which"
    )
    assert f"type: {sys.executable} -m pip install 'stratalux[peers]'" in error
    assert run(monkeypatch, "bench", "--peers-python", str(tmp_path / "python")) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "is no Python interpreter that works" in error
    assert not any(tmp_path.iterdir())


def test_packages_are_found_with_their_versions(fakes: Path) -> None:
    assert find_peers() == {"numpy": np.__version__}


def test_a_run_measures_the_peers_after_the_cases_and_resumes(
    fakes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = sys.modules["stratalux.bench.benchmark"]
    made_up, asked = bench_result(), []

    def measured(case: Case, *_: object, python: str | None, **__: object) -> PeersResult:
        asked.append((case.name, python))
        return peers_result()

    monkeypatch.setattr(module, "measure_case", lambda *_, **__: made_up.cases[0])
    monkeypatch.setattr(module, "measure_floor", lambda *_: made_up.floor)
    monkeypatch.setattr(module, "measure_preparation", lambda *_: made_up.preparation[0])
    monkeypatch.setattr(module, "measure_peers", measured)
    options = {"assets": make_assets(tmp_path / "assets"), "folder": tmp_path / "out", "variant": "llvm_ad_rgb"}
    for _ in range(2):
        result = run_benchmark(TINY, **options, peers=True, peers_python=sys.executable)
        assert result.peers == (peers_result(),) and BenchResult.read(tmp_path / "out/results.json") == result
    assert asked == [("buddha-diffuse-grace", sys.executable)]
    assert run_benchmark(TINY, **options).peers == ()


def test_a_graphics_card_does_not_race_against_processors(
    fakes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules["stratalux.bench.benchmark"], "choose_variant", lambda variant: "cuda_ad_rgb")
    with pytest.raises(InputError, match="--peers: the others render on the CPU, cuda_ad_rgb would not"):
        run_benchmark(TINY, assets=make_assets(tmp_path / "assets"), folder=tmp_path / "out", peers=True)


def test_records_and_pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    result = replace(bench_result(), peers=(peers_result(),))
    result.write(tmp_path / "results.json")
    assert BenchResult.read(tmp_path / "results.json") == result
    stored = json.loads((tmp_path / "results.json").read_text())["peers"][0]["peers"]
    assert stored[0]["verdict"]["ratio"] == pytest.approx(40) and stored[1]["verdict"] is None
    page = markdown(result)
    assert "## Other renderers: buddha-diffuse-grace" in page and "LuxCore was ended by SIGSEGV: no more light." in page
    (row,) = (line for line in page.splitlines() if line.startswith("| Cycles of Blender 9.9 | MIS | **40**"))
    assert "1.0012" in row and "3.0e-06 ± 1e-06" in row
    assert "Other renderers" not in markdown(bench_result())
    # A budget whose error is lost in the reference's noise has no column.
    lost = replace(peers_result(), floor=0.9 * peers_result().ours.points[-1].errors["surface"].median)
    rows = [
        line for line in markdown(replace(result, peers=(lost,))).splitlines() if "Cycles of" in line or "load," in line
    ]
    assert len({line.count("|") for line in rows}) == 1 and "our 16 spp" in rows[0] and "our 64 spp" not in rows[0]

    def fake(suite: Suite, asked: BenchSettings, *machine: object, **more: object) -> BenchResult:
        assert asked.folder is not None
        Path(asked.folder).mkdir(exist_ok=True)
        return result if asked.peers else bench_result()

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("stratalux.bench.run_suite", fake)
    assert run(monkeypatch, "bench", "--peers") == 0
    printed = capsys.readouterr().out
    assert "Cycles of Blender 9.9, MIS" in printed and "40 (40-40)" in printed
    assert "note: LuxCore was ended by SIGSEGV" in printed


def test_results_without_peers_are_read(tmp_path: Path) -> None:
    content = bench_result().to_json()
    del content["peers"]
    assert BenchResult.from_json(content) == bench_result()


def test_the_plateau_is_what_two_seeds_share() -> None:
    rng = np.random.default_rng(0)
    truth = np.full((20_000, 3), 0.3)
    wanted = truth + rng.normal(0, 0.02, truth.shape)
    images = [truth + 0.01 + rng.normal(0, 0.1, truth.shape) for _ in range(2)]
    weight = 0.3**2 + 0.01
    plateau, noise = plateau_of(images, wanted, 0.02**2 / weight)
    assert plateau is not None and noise is not None
    assert plateau == pytest.approx(0.01**2 / weight, abs=4 * noise) and noise < 0.5 * plateau
    assert plateau_of(images[:1], wanted, 0.0) == (None, None)


def test_a_turned_map_shows_every_direction_its_opposite_in_y_and_z() -> None:
    height, width = 6, 12
    theta = np.pi * (np.arange(height) + 0.5) / height
    phi = 2 * np.pi * (np.arange(width) + 0.5) / width
    directions = np.stack(
        [
            np.sin(theta)[:, None] * np.sin(phi),
            np.broadcast_to(np.cos(theta)[:, None], (height, width)),
            -np.sin(theta)[:, None] * np.cos(phi),
        ],
        axis=2,
    )
    assert np.allclose(turned(directions.astype(np.float32)), directions * [1, -1, -1], atol=1e-6)
    assert np.allclose(turned(turned(directions)), directions)


def test_z_up_keeps_handedness_and_columns() -> None:
    matrix = z_up(np.eye(3)).T
    assert np.linalg.det(matrix) == pytest.approx(1)
    d = np.array([0.3, 0.5, -0.7])
    x, y, z = z_up(d)
    column = (0.5 - np.arctan2(y, x) / (2 * np.pi)) % 1
    assert z == d[1] and column == pytest.approx((np.arctan2(d[0], -d[2]) / (2 * np.pi)) % 1)


def test_only_diffuse_meshes_on_their_ground_are_exported(tmp_path: Path) -> None:
    mi.set_variant("llvm_ad_rgb")
    assets = Assets(make_assets(tmp_path / "assets"))
    setting = load_setting(TINY.cases[0], TINY, assets)
    with pytest.raises(InputError, match="case buddha-metal-grace: other renderers are told of diffuse meshes"):
        export(Case("grace", "metal", "buddha"), setting, assets, tmp_path, 2)


def test_budgets_of_the_peers_are_at_least_four() -> None:
    assert len(PEER_SPP) >= 4 and list(PEER_SPP) == sorted(PEER_SPP)


@pytest.mark.parametrize("depth", [2, 4])
@pytest.mark.parametrize("name", list(PEERS))
def test_a_real_renderer_agrees(name: str, depth: int, tmp_path: Path) -> None:
    """A cube under a smooth map that has no symmetry, upside down as the real one is."""
    if importlib.util.find_spec(PEERS[name][1]) is None:
        pytest.skip(f"needs {PEERS[name][1]}: pip install 'stratalux[peers]'")
    mi.set_variant("llvm_ad_rgb")
    theta, phi = np.meshgrid(np.pi * np.arange(128) / 127, 2 * np.pi * (np.arange(256) + 0.5) / 256, indexing="ij")
    texels = 0.1 + np.stack([np.exp(3 * np.sin(theta) * np.cos(phi - k) - 2 * np.cos(theta)) for k in range(3)], axis=2)
    (tmp_path / "envmaps").mkdir()
    (tmp_path / "meshes").mkdir()
    mi.Bitmap(texels.astype(np.float32)).write(str(tmp_path / "envmaps/grace_latlong.exr"))
    (tmp_path / "meshes/happy_buddha.obj").write_text(CUBE)
    suite = replace(TINY, size=(30, 20))
    assets = Assets(tmp_path)
    setting = load_setting(suite.cases[0], suite, assets)
    camera = setting.cameras["multijitter"]
    wanted = mi.render(
        setting.plain, integrator=mi.load_dict({"type": "path", "max_depth": depth}), spp=1024, sensor=camera
    ).numpy()
    export(suite.cases[0], setting, assets, tmp_path, depth)
    with Peer(name, tmp_path) as peer:
        shots = [peer.render(next(iter(peer.configurations)), 256, seed) for seed in (7, 8)]
    images = [shot.image[setting.surface].astype(float) for shot in shots]
    wanted = wanted[setting.surface].astype(float)
    assert np.mean(images) == pytest.approx(wanted.mean(), rel=0.01)
    plateau, _ = plateau_of(images, wanted, 0.0)
    assert plateau is not None and plateau < 1e-3
    assert all(shot.spp == pytest.approx(256, rel=0.1) and shot.seconds > 0 for shot in shots)
