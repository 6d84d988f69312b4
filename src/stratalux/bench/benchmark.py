"""The whole benchmark, step by step; a run that is interrupted goes on where it was."""

from __future__ import annotations

import datetime
import gc
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mitsuba as mi

from ..assets import Assets
from ..comparison.provenance import machine, versions
from ..comparison.study import Study
from ..errors import InputError
from ..images.files import check_writable
from ..rendering.variants import choose_variant
from .candidates import OURS
from .cases import Suite, find_suite
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

Progress = Callable[[float, str], None]
"""Told the fraction of the run that is done, and what is going on."""

_FLOOR_SECONDS = 25.0
_PREPARATION_SECONDS = 15.0
_SECONDS_PER_TEXEL = 8e-6
_NOT_MEASURED = ("bench", "cli", "report", "reproduce")
"""Folders of the package that what is measured does not depend on; :data:`VERSION` stands for the first."""


def run(
    suite: str | Suite = "quick",
    *,
    assets: str | Path | Assets | None = None,
    folder: str | Path | None = None,
    cache: Path | None = None,
    variant: str | None = None,
    peers: bool = False,
    peers_python: str | None = None,
    progress: Progress | None = None,
) -> BenchResult:
    """Measure how long the best of Mitsuba's ``direct`` needs for our error, over what we need.

    ``suite``: "quick" (minutes), "full" (hours), or one of your own. ``assets``: folder to look through first.
    ``folder``: by default ``bench-SUITE``; gets ``results.json`` and, in ``steps``, what an interrupted run resumes
    from: the steps of other code, of another machine or of other versions are not used. ``cache``: folder for
    references instead of the usual one. ``variant``: of Mitsuba; it stays active. ``peers``: measure Cycles and LuxCore
    too, with the packages of the interpreter ``peers_python``, by default this one.

    Raises :class:`InputError` for missing assets and packages, before any work is done.
    """
    suite = find_suite(suite)
    assets = assets if isinstance(assets, Assets) else Assets(assets)
    folder = Path(folder or f"bench-{suite.name}")
    packages = find_peers(peers_python) if peers else {}
    _check(suite, assets, folder)
    variant = choose_variant(variant)
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
    total = suite.seconds * len(suite.all_cases) + _FLOOR_SECONDS + sum(work.values())
    total += PEER_SECONDS * len(PEER_CASES) if peers else 0.0
    study = Study(folder / "steps", common, total, progress)
    files = {name: str(assets.require(name)) for name in _needed(suite)}
    sizes = {name: Path(path).stat().st_size for name, path in files.items()}

    floor = study.step(
        "floor",
        {"size": suite.size, "spp": suite.floor_spp, "assets": [sizes[FLOOR_CASE.map], sizes[FLOOR_CASE.scene]]},
        _FLOOR_SECONDS,
        lambda fraction: measure_floor(suite, assets, fraction),
    )
    preparation = []
    for size in suite.preparation:
        name = f"preparation {size[0]}x{size[1]}"
        preparation.append(study.step(name, {"size": size}, work[size], _preparation(size)))
    cases = []
    for case in suite.all_cases:
        settings = {**settings_of(case, suite), "ours": OURS.label, "assets": [sizes[case.map], sizes[case.scene]]}

        def compute(fraction: Callable[[float], None], case: Any = case) -> dict[str, Any]:
            gc.collect()  # kernels number what lives: beside an earlier scene, each would be compiled anew
            return measure_case(case, suite, assets, cache=cache, fraction=fraction).to_json()

        cases.append(CaseResult.from_json(study.step(case.name, settings, suite.seconds, compute)))
    raced = []
    for case in PEER_CASES if peers else ():
        settings = {**peer_settings(case, suite), "packages": packages, "assets": [sizes[case.map], sizes[case.scene]]}

        def race(fraction: Callable[[float], None], case: Any = case) -> dict[str, Any]:
            return measure_peers(case, suite, assets, python=peers_python, cache=cache, fraction=fraction).to_json()

        raced.append(PeersResult.from_json(study.step(f"peers {case.name}", settings, PEER_SECONDS, race)))
    result = BenchResult(
        about={
            "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
            **{name: common[name] for name in ("machine", "variant", "versions", "source_sha256")},
            "suite": suite.name,
            "resumed": study.resumed,
        },
        cases=tuple(cases),
        floor=floor,
        preparation=tuple(preparation),
        peers=tuple(raced),
    )
    result.write(folder / "results.json")
    return result


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


def _needed(suite: Suite) -> list[str]:
    """Names of all assets."""
    cases = (*suite.all_cases, *PEER_CASES, FLOOR_CASE)
    return sorted({case.map for case in cases} | {case.scene for case in cases})


def _check(suite: Suite, assets: Assets, folder: Path) -> None:
    missing = [name for name in _needed(suite) if assets.find(name) is None]
    if missing:
        looked = ", ".join(str(place) for place in assets.folders)
        raise InputError(
            f"missing asset(s): {', '.join(missing)}, looked for in {looked}; type: stratalux assets, which says "
            "how to get each, or name their folder with --assets"
        )
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; name another folder with -o")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror or error}); name another with -o") from None
    check_writable(folder / "results.json")
