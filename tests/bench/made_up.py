"""A made-up result, and a small suite with data of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mitsuba as mi

from stratalux.bench.candidates import OURS, Configuration, Trial
from stratalux.bench.cases import QUICK, Case
from stratalux.bench.peers.records import PeerRecord, PeersResult, PeerTrial
from stratalux.bench.records import CaseResult, CurveRecord, Point
from stratalux.bench.results import BenchResult
from stratalux.comparison.records import Spread
from tests.helpers import hall_map

TINY = replace(
    QUICK,
    name="tiny",
    cases=(Case("grace", "diffuse", "buddha"),),
    open_cases=(),
    size=(15, 10),
    reference_spp=64,
    ladder=(4, 16, 64),
    most=64,
    screened=2,
    finalists=2,
    repeats=2,
    floor_spp=1,
    preparation=((32, 16, 8, 1),),
)

THEIRS = Configuration("direct:emitter_samples=1,bsdf_samples=0", "multijitter", "direct 1+0, multijitter", 1)

CUBE = """
v 0 0 0
v 1 0 0
v 0 1 0
v 1 1 0
v 0 0 1
v 1 0 1
v 0 1 1
v 1 1 1
f 1 3 4 2
f 5 6 8 7
f 1 2 6 5
f 3 7 8 4
f 1 5 7 3
f 2 4 8 6
"""


def make_assets(folder: Path) -> Path:
    """What the tiny suite needs, under the names of the real data."""
    for name in ("envmaps", "meshes"):
        (folder / name).mkdir(parents=True)
    mi.Bitmap(hall_map(24, 48)).write(str(folder / "envmaps/grace_latlong.exr"))
    (folder / "meshes/happy_buddha.obj").write_text(CUBE)
    return folder


def spread(value: float) -> Spread:
    return Spread((value, 0.9 * value, 1.1 * value))


def curve(configuration: Configuration, slowness: float, floor: float = 0.0) -> CurveRecord:
    """error = slowness / seconds, plus what the reference adds."""
    points = [
        Point(n, spread(n / 100), {r: spread(100 * slowness / n + floor) for r in ("surface", "image")})
        for n in (1, 4, 16, 64)
    ]
    return CurveRecord(configuration, tuple(points))


def case_result(case: Case, ratio: float, floor: float = 0.0) -> CaseResult:
    """A case in which we are ``ratio`` times as fast."""
    return CaseResult(
        case=case,
        size=(15, 10),
        scale=0.5,
        surface_fraction=1.0,
        means={"surface": 0.2, "image": 0.21},
        floors={"surface": floor, "image": floor},
        reference={
            "estimator": {"type": "direct"},
            "spp": 64,
            "passes": 16,
            "seconds": 1.0,
            "key": "k",
        },
        trials=(Trial(THEIRS, 16, 16, 0.1, 0.01),),
        ours=curve(OURS, 1e-3 / ratio, floor),
        theirs=(curve(THEIRS, 1e-3, floor),),
        preparation_seconds=0.01,
        compile_seconds=0.5,
    )


def peers_result() -> PeersResult:
    """One renderer that is 40 times as slow as we are, and one that has failed."""

    def surface(record: CurveRecord) -> CurveRecord:
        points = (Point(point.spp, point.seconds, {"surface": point.errors["surface"]}) for point in record.points)
        return CurveRecord(record.configuration, tuple(points))

    return PeersResult(
        case=Case("grace", "diffuse", "buddha"),
        size=(15, 10),
        scale=0.5,
        reference={"estimator": {"type": "direct"}, "spp": 128, "passes": 16, "seconds": 1.0, "key": "k"},
        floor=0.0,
        mean=0.2,
        ours=surface(curve(OURS, 1e-3)),
        peers=(
            PeerRecord(
                name="Cycles",
                version="Cycles of Blender 9.9",
                configurations={"MIS": {"seed": 1}},
                chosen="MIS",
                trials=(PeerTrial("MIS", 64.0, 1.0, 0.01, 0.25),),
                curve=surface(curve(Configuration("Cycles", "MIS", "Cycles of Blender 9.9, MIS"), 4e-2)),
                load_seconds=1.5,
                setup_seconds=0.25,
                agreement=1.0012,
                plateau=3e-6,
                plateau_noise=1e-6,
            ),
            PeerRecord(name="LuxCore", failure="LuxCore was ended by SIGSEGV: no more light"),
        ),
    )


def bench_result() -> BenchResult:
    """Two cases, with ratios of 2 and 0.5, and one against the map, with 8."""
    one = {"median": 1.0, "min": 0.5, "max": 2.0, "values": [1.0, 0.5, 2.0]}
    return BenchResult(
        about={
            "date": "2026-01-02T03:04:05+00:00",
            "machine": "a machine, 2 core(s)",
            "variant": "llvm_ad_rgb",
            "versions": {"mitsuba": "3.9.1", "matplotlib": None},
            "source_sha256": "0" * 64,
            "suite": "tiny",
            "resumed": 0,
        },
        cases=(
            case_result(Case("grace", "diffuse", "buddha"), 2.0),
            case_result(Case("sky", "metal", "teapot"), 0.5, floor=3e-3),
            case_result(Case("sky", "metal", "teapot", ground=False), 8.0),
        ),
        floor={
            "case": "buddha-diffuse-grace",
            "size": [15, 10],
            "spp": 1,
            "sampler": "independent",
            "rays_per_sample": 64,
            "integrator": {"type": "direct_stratified", "strata": 64, "proposals": 4},
            "rays_seconds": one,
            "stratified_seconds": one,
            "ratio": one,
        },
        preparation=(
            {
                "width": 32,
                "height": 16,
                "strata": 8,
                "map_bytes": 6144,
                "film": [192, 128],
                "seconds": {"mitsuba_array": one, "mitsuba_file": one, "ours": one, "pinned": one},
                "peak_bytes_per_byte": {"mitsuba_array": 3.5, "ours": None, "pinned": 1.5},
                "table_bytes": {"ours": 6_291_456, "pinned": 3_145_728},
                "seconds_per_spp": {"ours": one, "direct": one},
            },
        ),
    )
