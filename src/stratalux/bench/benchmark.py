"""The whole benchmark, step by step; a run that is interrupted goes on where it was."""

from __future__ import annotations

import datetime
import gc
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mitsuba as mi

from ..assets import Assets
from ..comparison.provenance import check_machine, machine, versions
from ..comparison.study import Study
from ..errors import InputError
from ..images.files import check_name, check_writable
from ..rendering.cluster import check_packages
from ..rendering.settings import MachineSettings
from ..rendering.variants import choose_variant
from ..scenes.mitsuba_xml import DIRECT
from ..settings import documented
from .candidates import ours
from .cases import Case, Suite, find_suite
from .floor import CASE as FLOOR_CASE
from .floor import measure_floor
from .measure import measure_case, settings_of
from .peers.measure import CASES as PEER_CASES
from .peers.measure import PEER_SECONDS, measure_peers, peer_settings
from .peers.records import PeersResult
from .peers.worker import find_peers
from .preparation import measure_preparation
from .records import CaseResult
from .results import FORMAT, VERSION, BenchResult
from .settings import BenchSettings

Progress = Callable[[float, str], None]
"""Told the fraction of the run that is done, and what is going on."""

_FLOOR_SECONDS = 25.0
_PREPARATION_SECONDS = 15.0
_SECONDS_PER_TEXEL = 8e-6
_NOT_MEASURED = ("bench", "cli", "report", "reproduce")
"""Folders of the package that what is measured does not depend on; :data:`VERSION` stands for the first."""


@documented(BenchSettings, MachineSettings, without=("suite", "assets", "folder"))
def run(
    suite: str | Suite = "quick",
    *,
    assets: str | Path | Assets | None = None,
    folder: str | Path | None = None,
    cache: Path | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> BenchResult:
    """Measure how long the best of Mitsuba's ``direct``, or ``path``, needs for our error, over what we need.

    ``suite``: "quick" (minutes), "full" (hours), "light" (the whole light, minutes), "light-full" (the same, hours),
    or one of your own. ``assets``: folder to look through first; cases whose files are not there are left out, and
    noted. ``folder``: by default ``bench-SUITE``; gets ``results.json``
    and, in ``steps``, what an interrupted run resumes from: the steps of other code, of another machine or of other
    versions are not used. ``cache``: folder for references instead of the usual one. The ``variant`` stays active.
    ``peers``: measure Cycles and LuxCore too, with the packages of the interpreter ``peers_python``. ``cluster``:
    address of a Dask scheduler, whose workers measure the cases, one at a time on each machine; all have to be alike.

    Raises :class:`InputError` for missing packages, and where no case has its files, before any work is done.
    """
    machine = MachineSettings(**{name: settings.pop(name) for name in ("variant", "cluster") if name in settings})
    chosen = find_suite(suite)
    own = Assets(assets) if not isinstance(assets, Assets) else assets
    settings |= {"suite": suite} if isinstance(suite, str) else {}
    settings |= {"assets": own.folder and str(own.folder), "folder": folder and str(folder)}
    asked = BenchSettings(**settings)
    return run_suite(chosen, asked, machine, assets=own, cache=cache, progress=progress)


def run_suite(
    suite: Suite,
    asked: BenchSettings,
    machine_settings: MachineSettings,
    *,
    assets: Assets | None = None,
    cache: Path | None = None,
    progress: Progress | None = None,
) -> BenchResult:
    """The same from groups of settings; see :func:`run`."""
    assets = assets or Assets(asked.assets)
    folder = Path(asked.folder or f"bench-{suite.name}")
    peers, peers_python = asked.peers or asked.peers_python is not None, asked.peers_python
    packages = find_peers(peers_python) if peers else {}
    cases, left_out = _at_hand(suite.all_cases, assets)
    if not cases:
        raise InputError(f"no case has its files: {left_out[0]}; type: stratalux assets fetch")
    peer_cases, without = _at_hand(PEER_CASES if peers else (), assets)
    floor_cases, bare = _at_hand((FLOOR_CASE,) if suite.depth == DIRECT else (), assets)
    left_out += [*(f"peers: {one}" for one in without), *(f"bare shadow rays: {one}" for one in bare)]
    _check(folder)
    variant = choose_variant(machine_settings.variant)
    if peers and not variant.startswith("llvm"):
        raise InputError(f"--peers: the others render on the CPU, {variant} would not; add -m llvm_ad_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    common = {
        "format": [FORMAT, VERSION],
        "machine": machine(gpu=variant.startswith("cuda")),
        "variant": variant,
        "versions": versions(),
        "source_sha256": source_sha256(),
    }
    work = {size: _PREPARATION_SECONDS + _SECONDS_PER_TEXEL * size[0] * size[1] for size in suite.preparation}
    total = suite.seconds * len(cases) + _FLOOR_SECONDS * len(floor_cases) + sum(work.values())
    total += PEER_SECONDS * len(peer_cases)
    study = Study(folder / "steps", common, total, progress)
    needed = _needed((*cases, *peer_cases, *floor_cases))
    sizes = {name: assets.require(name).stat().st_size for name in needed}

    floor = None
    for case in floor_cases:
        floor = study.step(
            "floor",
            {"size": suite.size, "spp": suite.floor_spp, "assets": [sizes[case.map], sizes[case.scene]]},
            _FLOOR_SECONDS,
            lambda fraction: measure_floor(suite, assets, fraction),
        )
    preparation = []
    for size in suite.preparation:
        name = f"preparation {size[0]}x{size[1]}"
        preparation.append(study.step(name, {"size": size}, work[size], _preparation(size)))
    if machine_settings.cluster is not None:
        _on_workers(suite, asked, machine_settings, cases, common["machine"], folder)
    measured = []
    for case in cases:
        settings = {
            **settings_of(case, suite),
            "ours": ours(suite.depth).label,
            "assets": [sizes[name] for name in sorted(case.assets)],
        }

        def compute(fraction: Callable[[float], None], case: Any = case) -> dict[str, Any]:
            gc.collect()  # kernels number what lives: beside an earlier scene, each would be compiled anew
            return measure_case(case, suite, assets, cache=cache, fraction=fraction).to_json()

        measured.append(CaseResult.from_json(study.step(case.name, settings, suite.seconds, compute)))
    raced = []
    for case in peer_cases:
        settings = {**peer_settings(case, suite), "packages": packages, "assets": [sizes[case.map], sizes[case.scene]]}

        def race(fraction: Callable[[float], None], case: Any = case) -> dict[str, Any]:
            return measure_peers(case, suite, assets, python=peers_python, cache=cache, fraction=fraction).to_json()

        raced.append(PeersResult.from_json(study.step(f"peers {case.name}", settings, PEER_SECONDS, race)))
    result = BenchResult(
        about={
            "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
            **{name: common[name] for name in ("machine", "variant", "versions", "source_sha256")},
            "suite": suite.name,
            "settings": {"bench": asked.to_json(), "machine": machine_settings.to_json()},
            "left_out": left_out,
            "resumed": study.resumed,
        },
        cases=tuple(measured),
        floor=floor,
        preparation=tuple(preparation),
        peers=tuple(raced),
        ours=ours(suite.depth),
    )
    result.write(folder / "results.json")
    return result


def _on_workers(
    suite: Suite,
    asked: BenchSettings,
    machine_settings: MachineSettings,
    cases: Sequence[Case],
    here: Any,
    folder: Path,
) -> None:
    """Let the workers of a cluster measure the cases, and keep the steps as if they had been made here."""
    check_packages()
    from ..rendering.cluster.parts import timed

    (folder / "steps").mkdir(parents=True, exist_ok=True)
    alone = replace(machine_settings, cluster=None)
    parts = []
    for case in cases:
        opened = case in suite.open_cases
        one = replace(suite, cases=() if opened else (case,), open_cases=(case,) if opened else (), preparation=())
        parts.append((one, asked, alone, here))
    for _, steps in timed(str(machine_settings.cluster), choose_variant(machine_settings.variant), _steps_of, parts):
        for name, content in steps.items():
            (folder / "steps" / name).write_bytes(content)


def _steps_of(part: tuple[Suite, BenchSettings, MachineSettings, Any]) -> dict[str, bytes]:
    """What a worker makes of a case: its steps as files. Raises :class:`InputError` on another kind of machine."""
    from ..rendering.cluster.parts import files_of

    suite, asked, machine_settings, wanted = part
    check_machine(wanted, gpu=choose_variant(machine_settings.variant).startswith("cuda"))

    def make(folder: Path) -> None:
        run_suite(suite, replace(asked, folder=str(folder), peers=False, peers_python=None), machine_settings)

    return files_of(make, "steps")


def source_sha256() -> str:
    """SHA-256 over the code of the package that decides what is measured."""
    root = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        name = path.relative_to(root)
        if name.parts[0] not in _NOT_MEASURED:
            digest.update(f"{name.as_posix()}\n".encode() + path.read_bytes())
    return digest.hexdigest()


def _preparation(size: tuple[int, int, int, int]) -> Callable[[Callable[[float], None]], dict[str, Any]]:
    return lambda fraction: measure_preparation(*size)


def _needed(cases: Sequence[Case]) -> list[str]:
    """Names of the assets of cases."""
    return sorted({name for case in cases for name in case.assets})


def _at_hand(cases: Sequence[Case], assets: Assets) -> tuple[list[Case], list[str]]:
    """The cases whose files are there, and for each of the others a line that says what is missing."""
    there = {name: assets.find(name) is not None for name in _needed(cases)}
    missing = {case: [name for name in case.assets if not there[name]] for case in cases}
    lines = [f"{case.name} ({', '.join(names)} missing)" for case, names in missing.items() if names]
    return [case for case, names in missing.items() if not names], lines


def _check(folder: Path) -> None:
    check_name(folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; name another folder with -o")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror or error}); name another with -o") from None
    check_writable(folder / "results.json")
