"""The page that tells the results: what was measured, how, and all figures, in Markdown."""

from __future__ import annotations

from typing import Any

from .candidates import OURS
from .cases import MATERIALS
from .peers.records import REGION, PeerRecord, PeersResult
from .records import CaseResult
from .results import BenchResult

_METHOD = """\
The figure is the **speed-up at equal error**: the seconds that the best of Mitsuba's `{theirs}` needs to reach our
error, over the seconds that we took. Ours is `{technique}` with its defaults; only the samples per pixel are chosen.
In each case all of Mitsuba's samplers{splits} and the map's `mis_compensation`
where it is unbiased are screened at a low budget and the best of them at a higher one; the finalists' curves are
measured at three budgets or more, and their lower envelope is what counts. Both sides are rendered in turn after a
warm-up; times are medians of the seeds, without compilation and preparation. Between budgets, curves are interpolated
in log-log. The error is the relative MSE in linear RGB over the pixels that are all surface, with a box filter and
the map scaled so that their mean is 0.2. It is taken against Mitsuba's `{theirs}` with many times the samples and
other seeds; the noise of that reference is subtracted.
"""

_SPLITS = {"direct": ", five splits of emitter and BSDF samples,", "path": ""}

_PEERS = """\
In the same scene, with the same camera, box filter and map, {width}x{height} pixels, {light}: the
seconds that each renderer needs to reach our error, and their ratio to ours, by our budgets. Each renders in a process
of its own, in turn with ours; times are of the rendering alone. Loading and setting up, which come once, are listed
apart. Of several configurations of each, the one that does best at a middle budget counts. *Agreement* is the mean of
the image over that of Mitsuba's reference. *Plateau* is the relative MSE that more samples would not take away, which
is the square of the renderer's disagreement with Mitsuba: near our error, it would make the other look slow.
"""

_MARKS = """\
\\* our error is outside of what was measured of the other side, whose curve was continued along its last segment.
† the reference's noise is more than a quarter of an error of ours.
"""


def markdown(result: BenchResult) -> str:
    """The page, ending with a line break."""
    about = result.about
    versions = ", ".join(f"{name} {version}" for name, version in about["versions"].items() if version)
    parts = [
        "# Benchmarks",
        f"`stratalux bench --suite {about['suite']}`, {about['date'][:10]}, on {about['machine']}, variant "
        f"`{about['variant']}`; {versions}.",
        _METHOD.format(technique=result.ours.technique, theirs=result.theirs, splits=_SPLITS[result.theirs]).strip(),
        "![Speed-up of every case, and curves](bench.svg)",
        "## Summary",
        _summary(result),
        "## Cases",
        _cases([case for case in result.cases if case.case.ground]),
    ]
    if open_cases := [case for case in result.cases if not case.case.ground]:
        parts += ["Objects against the map, without a ground:", _cases(open_cases)]
    if left_out := about.get("left_out"):
        parts.append(f"Left out, as files are missing: {'; '.join(left_out)}.")
    for raced in result.peers:
        parts += [f"## Other renderers: {raced.case.name}", *_peers(raced)]
    parts.append(_MARKS.strip())
    if result.floor is not None:
        parts += ["## The price of choosing rays", _floor(result.floor)]
    parts += ["## Preparation", _preparation(result)]
    return "\n\n".join(parts) + "\n"


def _summary(result: BenchResult) -> str:
    rows = []
    for region, title in (("surface", "surfaces"), ("image", "against the map, whole image")):
        summary = result.summary(region)
        if summary is None:
            continue
        means = [f"{summary['materials'][m]:.2f}" if m in summary["materials"] else "-" for m in MATERIALS]
        worst, best = (f"{summary[end]['ratio']:.2f} ({summary[end]['case']})" for end in ("worst", "best"))
        ahead = f"{summary['ahead']} of {summary['cases']}"
        rows.append([title, f"**{summary['ratio']:.2f}**", *means, worst, best, ahead])
    return table(["", "geometric mean", *MATERIALS, "worst", "best", "ahead"], rows)


def _cases(cases: list[CaseResult]) -> str:
    rows = []
    for case in cases:
        verdicts = [(region, case.verdict(region)) for region in ("surface", "image")]
        spp = ", ".join(str(point.spp) for point in case.ours.points)
        winners = dict.fromkeys(winner for _, verdict in verdicts if verdict for winner in verdict.winners)
        ratios = []
        for region, verdict in verdicts:
            ratios.append("-" if verdict is None else f"{verdict.ratio:.2f}{marks(case, region, chr(92) + '*')}")
            ratios.append("-" if verdict is None else f"{verdict.lowest:.2f} to {verdict.highest:.2f}")
        names = [case.case.scene, case.case.material, case.case.map]
        rows.append([*names, spp, "; ".join(winners), *ratios])
    heads = ["scene", "material", "map", "our spp", "best of Mitsuba's", "surfaces", "range", "whole image", "range"]
    return table(heads, rows)


def _peers(raced: PeersResult) -> list[str]:
    ours = raced.ours.usable(REGION, raced.floor)
    heads = ["renderer", "configuration", "speed-up", *(f"our {point.spp} spp" for point, _ in ours)]
    heads += ["agreement", "plateau", "load, set-up"]
    seconds = [f"{point.seconds.median:.3g} s to {error:.2g}" for point, error in ours]
    rows = [["Stratalux", f"`{raced.ours.configuration.label}`", "1", *seconds, "-", "-", "-"]]
    failures = []
    for peer in raced.peers:
        if peer.failure is not None:
            failures.append(f"{peer.failure}.")
        verdict = raced.verdict(peer)
        if verdict is None or peer.agreement is None:
            continue
        star = chr(92) + "*"
        reached = [f"{duel.theirs:.3g} s{star * duel.outside} ({duel.ratio:.3g})" for duel in verdict.duels]
        setup = " + ".join("-" if s is None else f"{s:.2g} s" for s in (peer.load_seconds, peer.setup_seconds))
        row = [peer.version, peer.chosen, f"**{verdict.ratio:.3g}**{star * verdict.outside}", *reached]
        rows.append([*row, f"{peer.agreement:.4f}", plateau(peer), setup])
    direct = raced.ours.configuration == OURS
    light = "direct light of the map only" if direct else "light of the map by paths of as many segments as ours"
    return [
        _PEERS.format(width=raced.size[0], height=raced.size[1], light=light).strip(),
        table(heads, rows),
        *failures,
    ]


def plateau(peer: PeerRecord) -> str:
    """The plateau of a renderer, give or take its noise."""
    return "-" if peer.plateau is None else f"{peer.plateau:.1e} ± {peer.plateau_noise:.0e}"


def marks(case: CaseResult, region: str, outside: str = "*") -> str:
    """The marks of a verdict."""
    verdict = case.verdict(region)
    if verdict is None:
        return ""
    return (outside if verdict.outside else "") + ("†" if case.limited(region) else "")


def _floor(floor: dict[str, Any]) -> str:
    ratio = floor["ratio"]
    rays, ours = floor["rays_seconds"]["median"], floor["stratified_seconds"]["median"]
    width, height = floor["size"]
    return (
        f"{floor['rays_per_sample']} cosine-distributed shadow rays from each camera hit and nothing else take "
        f"{rays:.3g} s ({floor['case']}, {width}x{height}, {floor['spp']} spp). `direct_stratified` with "
        f"{floor['integrator']['strata']} strata and {floor['integrator']['proposals']} proposals takes {ours:.3g} s: "
        f"**{ratio['median']:.2f} times** as long ({ratio['min']:.2f} to {ratio['max']:.2f})."
    )


def _preparation(result: BenchResult) -> str:
    rows = []
    for one in result.preparation:
        seconds = {name: f"{spread['median']:.3g} s" for name, spread in one["seconds"].items()}
        peak = {name: "-" if v is None else f"{v:.1f}" for name, v in one["peak_bytes_per_byte"].items()}
        each = {name: f"{1000 * spread['median']:.3g} ms" for name, spread in one["seconds_per_spp"].items()}
        rows.append(
            [
                f"{one['width']}x{one['height']}",
                *(seconds[name] for name in ("ours", "pinned", "mitsuba_array", "mitsuba_file")),
                *(peak[name] for name in ("ours", "pinned", "mitsuba_array")),
                *(f"{one['table_bytes'][name] / 1e6:.1f} MB" for name in ("ours", "pinned")),
                *(each[name] for name in ("ours", "direct")),
            ]
        )
    regions = ", ".join(dict.fromkeys(f"{one['strata']:,}" for one in result.preparation))
    heads = ["map", "ours, on top", f"{regions} regions of the paper's scheme", "Mitsuba's `envmap`"]
    heads += ["the same from .hdr", "peak bytes per byte of map, ours", "regions", "Mitsuba's"]
    heads += ["tables, ours", "regions", "a sample per pixel, ours", "`direct` 1+0"]
    compiling = [case.compile_seconds for case in result.cases]
    text = table(heads, rows)
    if compiling:
        text += (
            f"\n\nCompiling our kernel took {min(compiling):.2g} to {max(compiling):.2g} s by case; Dr.Jit "
            "keeps kernels on disk, so that the next process has them."
        )
    return text


def table(heads: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
