"""Renders on a Dask cluster: processes of this machine, which the tests start and end."""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
import json
import os
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import stratalux
from stratalux import InputError
from stratalux.errors import SceneWarning
from stratalux.rendering.settings import PictureSettings
from tests.helpers import hall_map, scene_dict
from tests.scenes.formats.gltf_files import Gltf
from tests.variants import RGB

distributed = pytest.importorskip("distributed")
SEVERAL = {"size": (24, 16), "spp": 64, "seed": 3}
"""A picture of several launches, of those that are small."""
_LAUNCH = 3000
_SOME = 1 << 19
"""Camera samples of a launch that is larger, and smaller than usual."""


def _set(module: str, name: str, value: Any) -> None:
    mi.set_variant(RGB)
    setattr(importlib.import_module(module), name, value)


def _set_environment(name: str, value: str) -> None:
    os.environ[name] = value


@pytest.fixture(scope="module")
def workers() -> Iterator[Any]:
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        client.run(_set, "stratalux.integrators.automatic.view", "LAUNCH", _LAUNCH)
        yield client


@pytest.fixture
def scheduler(workers: Any, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", _LAUNCH)
    return str(workers.scheduler.address)


def model(folder: Path) -> dict[str, Any]:
    """A model with a map, and a picture behind it: three files."""
    file = Gltf()
    corners = [[-1, 0, -1], [1, 0, -1], [0, 0, 1], [0, 1.5, 0]]
    triangles = np.array([0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0], dtype=np.uint16)
    file.add("scenes", nodes=[file.show(file.primitive(corners, triangles))])
    file.write(folder / "model.glb")
    mi.Bitmap(hall_map(32, 64)).write(str(folder / "map.exr"))
    mi.Bitmap(np.full((8, 12, 3), 0.3, dtype=np.float32)).write(str(folder / "plate.exr"))
    names = {"scene": "model.glb", "environment": "map.exr", "background": "plate.exr"}
    return {key: str(folder / name) for key, name in names.items()}


def _never(file: Any) -> bool:
    return False


def test_the_picture_is_the_same(scheduler: str) -> None:
    """To the rounding of sums, whoever has made which part of it; also if it was begun here."""
    alone = [(p.checkpoint(), p) for p in stratalux.render_passes("demo", **SEVERAL) if p.checkpoint]
    passes = list(stratalux.render_passes("demo", **SEVERAL, cluster=scheduler))
    rest = stratalux.render("demo", **SEVERAL, cluster=scheduler, resume=alone[-3][0])
    assert len(alone) > 4 < len(passes) and passes[-1].workers.startswith("2 workers")
    for there in (passes[-1], rest):
        assert there.spp == alone[-1][1].spp
        np.testing.assert_allclose(there.image, alone[-1][1].image, rtol=1e-5, atol=1e-6)
    assert passes[-1].picture is not None and passes[-1].picture.machine.cluster == scheduler


def test_a_film_in_bands(scheduler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As many as the memory here asks for; whoever renders which of them."""
    from stratalux.integrators.memory import NoRoom, samples_at_once

    def no_room(limit: int | None, size: tuple[int, int], *each: int) -> int:
        if size[1] > 30:
            raise NoRoom("no room", 16 * size[0] * size[1] + 2 * 18 * size[0] * each[0], 1 << 40, each[0])
        return samples_at_once(limit, size, *each)

    monkeypatch.setattr("stratalux.integrators.automatic.image.samples_at_once", no_room)
    asked = {"size": (24, 48), "spp": 8, "seed": 3}
    with pytest.warns(SceneWarning, match="in 3 bands"):
        here, there = (stratalux.render("demo", **asked, cluster=where) for where in (None, scheduler))
    assert here.parts == there.parts == 3 and here.image.min(axis=(1, 2)).any()
    np.testing.assert_allclose(there.image, here.image, rtol=1e-5, atol=1e-6)


def test_workers_without_the_files_are_sent_them(workers: Any, scheduler: str, tmp_path: Path) -> None:
    job, shown = "stratalux.rendering.cluster.job", {**model(tmp_path), "size": (24, 16), "spp": 2}
    workers.run(_set, job, "_is_here", _never)
    workers.run(_set_environment, "STRATALUX_CACHE", str(tmp_path / "cache"))
    here, there = (stratalux.render(**shown, cluster=where) for where in (None, scheduler))
    np.testing.assert_allclose(there.image, here.image, rtol=1e-5, atol=1e-6)
    assert len(list((tmp_path / "cache" / "cluster" / "files").iterdir())) == 3


def test_techniques_that_know_of_no_stages(scheduler: str) -> None:
    asked = {"size": (24, 16), "spp": 8, "technique": "importance:samples=4,proposals=8"}
    here, there = (stratalux.render("demo", **asked, cluster=where) for where in (None, scheduler))
    np.testing.assert_allclose(there.image, here.image, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [("map", "0", "has another map; install"), ("mitsuba", "2.0", rf"has mitsuba {mi.__version__} instead of 2\.0")],
)
def test_a_worker_that_would_render_another_picture(
    scheduler: str, name: str, value: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from stratalux.rendering.cluster.job import Job

    of = Job.of

    def changed(*arguments: Any) -> Job:
        job = of(*arguments)
        identity = json.loads(job.identity)
        (identity if name in identity else identity["versions"])[name] = value
        return Job(job.picture, job.files, json.dumps(identity))

    monkeypatch.setattr(Job, "of", changed)
    with pytest.raises(InputError, match=f"cluster: the worker on .* {message}"):
        stratalux.render("demo", size=(12, 8), spp=1, cluster=scheduler)


def test_files_go_by_their_content(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from stratalux.rendering.cluster.job import Job, Missing, found

    monkeypatch.setenv("STRATALUX_CACHE", str(tmp_path / "cache"))
    names = model(tmp_path)
    source, environment, background = names.values()
    picture = PictureSettings.of(source, environment=environment, background=background)
    identity = {"map": "m", "scene": "s", "versions": {}}
    job = Job.of(picture, [Path(name) for name in names.values()], identity)
    assert found(job, {}) == {name: name for name in names.values()}  # all are here

    contents = {file.sha256: Path(file.path).read_bytes() for file in job.files}
    for name in names.values():
        Path(name).unlink()
    with pytest.raises(Missing) as missing:
        found(job, {})
    assert sorted(missing.value.hashes) == sorted(contents)
    paths = found(job, contents)
    for file in job.files:
        assert Path(paths[file.path]).read_bytes() == contents[file.sha256]
        assert Path(paths[file.path]).name == Path(file.path).name
    assert found(job, {}) == paths  # what is there is kept
    shown = job.settings(paths).scene
    assert shown is not None
    assert (shown.source, shown.environment, shown.background) == tuple(paths[name] for name in names.values())


def test_a_scene_is_loaded_ahead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once, for the picture that processes have started for, by whatever name its files are called; not for another."""
    from stratalux.rendering.cluster import worker
    from stratalux.rendering.cluster.job import Job

    model(tmp_path)
    monkeypatch.chdir(tmp_path)
    picture = PictureSettings.of("model.glb", environment="map.exr", size=(6, 4), variant=RGB)
    job = Job.of(picture, [tmp_path / "model.glb", tmp_path / "map.exr"], {"map": "", "scene": "", "versions": {}})
    asked = job.settings({file.path: file.path for file in job.files})
    worker._load_ahead(picture.to_text())
    assert worker._ahead is not None
    ahead = worker._ahead[1]
    assert worker._scene(asked) is ahead and worker._scene(asked) is not ahead
    worker._load_ahead(picture.to_text())
    assert worker._scene(dataclasses.replace(asked, camera=dataclasses.replace(asked.camera, size=(4, 4)))) is not ahead
    assert worker._ahead is None


def test_processes_end_with_their_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether its scene cannot be loaded, or nobody asks for its first pass."""
    closed: list[str] = []

    class Processes:
        def __init__(self, where: str, *_: str) -> None:
            self._where = where

        def close(self) -> None:
            closed.append(self._where)

    monkeypatch.setattr("stratalux.rendering.cluster.client.Processes", Processes)
    with pytest.raises(InputError, match="none\\.exr"):
        stratalux.render("demo", environment="none.exr", size=(6, 4), cluster="local:1")
    passes = stratalux.render_passes("demo", size=(6, 4), spp=1, cluster="local:2")
    assert closed == ["local:1"]
    del passes
    assert closed == ["local:1", "local:2"]


def test_what_only_a_program_has_is_refused() -> None:
    scene = mi.load_dict(scene_dict())
    with pytest.raises(InputError, match="cluster: the scene was loaded by a program; give its file"):
        stratalux.render(scene, spp=1, cluster="local:1")
    with pytest.raises(InputError, match="cluster: an integrator of a program's own"):
        stratalux.render("demo", size=(6, 4), spp=1, integrator=mi.load_dict({"type": "direct"}), cluster="local:1")
    with pytest.raises(InputError, match="cluster: the map was made by a program; give its file"):
        own = stratalux.EnvironmentMap.from_array(hall_map(16, 32))
        stratalux.render("demo", size=(6, 4), spp=1, environment=own, cluster="local:1")


@pytest.mark.parametrize("where", ["local:0", "local", "host", "http://host", "tcp://"])
def test_what_is_no_cluster(where: str) -> None:
    with pytest.raises(InputError, match=r"cluster: .* is none; give the address of a scheduler"):
        stratalux.render("demo", cluster=where)


def test_packages_that_are_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "distributed" else find(name))
    with pytest.raises(InputError, match=r"needs more packages: pip install 'stratalux\[cluster\]'"):
        stratalux.render("demo", size=(6, 4), spp=1, cluster="local:1")


def test_items_of_a_reproduction_on_workers(scheduler: str, tmp_path: Path) -> None:
    """What workers have made is found as if it had been made here."""
    from stratalux.reproduce import TINY, reproduce
    from tests.reproduce.data import make_assets

    assets, told = make_assets(tmp_path / "assets"), []
    asked = {"settings": TINY, "assets": assets}

    def tell(share: float, what: str) -> None:
        told.append(what)

    reproduce(["fig1"], tmp_path / "there", **asked, progress=tell, cluster=scheduler)
    assert told[0] == "1 of 1 items"
    steps = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "there/steps").iterdir()}
    reproduce(["fig1"], tmp_path / "there", **asked)
    assert steps == {path.name: path.stat().st_mtime_ns for path in (tmp_path / "there/steps").iterdir()}
    assert (tmp_path / "there/claims.json").exists() and steps


def test_cases_of_the_benchmark_on_workers(scheduler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All of them are resumed here; another kind of machine is refused."""
    from stratalux.bench.benchmark import run_suite
    from stratalux.bench.settings import BenchSettings
    from stratalux.rendering.settings import MachineSettings
    from tests.bench.made_up import TINY, make_assets

    suite = dataclasses.replace(TINY, preparation=(), ladder=(1, 2, 4), most=4, reference_spp=4)
    asked = BenchSettings(assets=str(make_assets(tmp_path / "assets")), folder=str(tmp_path / "out"))
    machine = MachineSettings(variant=RGB, cluster=scheduler)
    result = run_suite(suite, asked, machine)
    assert len(result.cases) == result.about["resumed"] == 1
    monkeypatch.setattr("stratalux.bench.benchmark.machine", lambda **_: "another")
    with pytest.raises(InputError, match="cluster: a worker is another machine"):
        run_suite(suite, dataclasses.replace(asked, folder=str(tmp_path / "other")), machine)


def test_a_comparison_on_workers(scheduler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is rendered depends neither on the machine nor on the order of the parts; another kind is refused."""
    asked = {"entries": ["stratified:proposals=2", "direct"], "size": (24, 16), "rays": (4, 8), "spp": 2, "repeats": 2}
    asked |= {**model(tmp_path), "background": "map", "reference_spp": 32, "variant": RGB}
    here = stratalux.compare(**asked, cache=tmp_path / "here")
    told: list[str] = []

    def tell(share: float, what: str) -> None:
        told.append(what)

    there = stratalux.compare(**asked, cache=tmp_path / "there", cluster=scheduler, progress=tell)
    assert told[-1] == "6 of 6 parts"  # two numbers of rays, four parts of the reference
    assert (there.reference.spp, there.reference.key) == (here.reference.spp, here.reference.key)
    np.testing.assert_allclose(there.reference.image, here.reference.image, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(there.reference.standard_error, here.reference.standard_error, rtol=1e-3, atol=1e-6)
    assert len(there.equal_time) == len(there.equal_rays) == 4
    for one, other in zip(here.equal_rays, there.equal_rays, strict=True):
        assert (one.stem, one.spp, one.integrator) == (other.stem, other.spp, other.integrator)
        np.testing.assert_allclose(one.image, other.image, rtol=1e-4, atol=1e-6)
        assert one.errors["image"].rmse.values == pytest.approx(other.errors["image"].rmse.values, rel=1e-4)
        assert len(other.seconds.values) == 2 and other.seconds.minimum > 0
    monkeypatch.setattr("stratalux.comparison.parts.machine", lambda **_: "another")
    with pytest.raises(InputError, match="cluster: a worker is another machine"):
        stratalux.compare(**asked, cache=tmp_path / "there", cluster=scheduler)
    monkeypatch.undo()
    monkeypatch.setattr("stratalux.comparison.compare.reference_key", lambda *_: "another")
    with pytest.raises(InputError, match="cluster: the worker on .* has another scene, map or version"):
        stratalux.compare(**asked, cache=tmp_path / "there", cluster=scheduler)


def test_what_is_timed_shares_no_machine() -> None:
    from stratalux.rendering.cluster.parts import timed

    with pytest.raises(InputError, match="cluster: times are taken, and the processes of local:2 would share"):
        list(timed("local:2", RGB, len, ["part"]))
    entries = ["stratified", "direct"]
    with pytest.raises(InputError, match="cluster: times are taken, and the processes of local:2 would share"):
        stratalux.compare("demo", entries=entries, size=(6, 4), rays=(4,), cluster="local:2")
    with pytest.raises(InputError, match="cluster: the scene was loaded by a program"):
        stratalux.compare(mi.load_dict(scene_dict()), entries=entries, cluster="tcp://host:1")
    own = stratalux.EnvironmentMap.from_array(hall_map(16, 32))
    with pytest.raises(InputError, match="cluster: the map was made by a program"):
        stratalux.compare("demo", entries=entries, environment=own, cluster="tcp://host:1")


def test_one_worker_of_each_machine(scheduler: str) -> None:
    from stratalux.rendering.cluster.client import cluster

    with cluster(scheduler, RGB) as workers:
        assert workers.width == 2 and len(workers.one_of_each_machine()) == 1


class _SmallLaunches(distributed.WorkerPlugin):  # type: ignore[misc]
    """Of whatever worker comes."""

    def setup(self, worker: Any) -> None:
        _set("stratalux.integrators.automatic.view", "LAUNCH", _SOME)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*no worker is left:stratalux.errors.SceneWarning")
def test_workers_that_die_all_the_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """200 launches while every 5 s one of two is killed; what it was at is done by others, and counts once.

    The scene is small, as a worker that takes as long as it lives until its first launch makes none."""
    psutil = pytest.importorskip("psutil")
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", _SOME)
    asked: dict[str, Any] = {**model(tmp_path), "size": (300, 200), "spp": 1850, "seed": 5, "direct": True}
    over = threading.Event()
    killed: list[int] = []

    def kill(cluster: Any) -> None:
        while not over.wait(5):
            living = [nanny.process.pid for nanny in cluster.workers.values() if nanny.process and nanny.process.pid]
            processes = [psutil.Process(pid) for pid in living if psutil.pid_exists(pid)]
            if len(processes) == 2:
                oldest = min(processes, key=lambda p: p.create_time())
                killed.append(oldest.pid)
                oldest.kill()

    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        client.register_plugin(_SmallLaunches())
        passes = stratalux.render_passes(**asked, cluster=cluster.scheduler_address)
        last = next(passes)
        thread = threading.Thread(target=kill, args=(cluster,), daemon=True)
        thread.start()
        try:
            for last in passes:  # noqa: B007
                pass
        finally:
            over.set()
            thread.join()
        assert last.checkpoint is not None
        done = last.checkpoint().memory["direct"]
    assert len(killed) > 3 and int(done["launches"]) >= 200
    np.testing.assert_allclose(last.image, stratalux.render(**asked).image, rtol=1e-5, atol=1e-6)
