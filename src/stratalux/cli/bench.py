"""``stratalux bench``."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..bench.settings import BenchSettings
from ..rendering.settings import MachineSettings
from .flags import flags
from .output import write_json
from .progress import console as standard_output
from .progress import share_of_work

if TYPE_CHECKING:
    from rich.console import Console

    from ..bench import BenchResult
    from ..bench.peers.records import PeersResult

_TABLE_WIDTH = 150
"""Where the output is no terminal."""
_SPEED_SECONDS = 600.0
"""The time left follows from what was done in so many seconds."""


@click.command()
@flags(bench=BenchSettings, machine=MachineSettings)
@click.option("--json", "json_path", metavar="FILE", help="Write all figures there too; - prints them instead.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def bench(bench: BenchSettings, machine: MachineSettings, json_path: str | None, quiet: bool) -> None:
    """Measure the default technique against the best of Mitsuba's own, at equal error, on real maps and meshes.

    The figure is the seconds that the best of Mitsuba's "direct" needs to reach our error, over ours: above 1, we are
    ahead; of its "path" where the whole light is rendered. Every sampler and split is tried for the other side. Cases
    whose files are missing are left out; stratalux assets fetch brings them. The folder gets results.json and
    bench.svg, .png; a run that was interrupted goes on where it was. Nothing else should run on the machine meanwhile.

    \b
    Examples:
      stratalux bench
      stratalux bench --suite full -o out/bench
      stratalux bench --suite light
      stratalux bench --peers
      stratalux bench -q --json - | jq .summary.surface
    """
    from .. import bench as benchmark  # Mitsuba is imported here, not before --help
    from ..bench.picture import draw, why_no_picture
    from ..images.files import check_writable

    if json_path not in (None, "-"):
        check_writable(json_path)
    folder = Path(f"bench-{bench.suite}" if bench.folder is None else bench.folder)
    bar, tell = share_of_work("measuring", quiet=quiet, speed_estimate_period=_SPEED_SECONDS)
    with bar:
        suite = benchmark.SUITES[bench.suite]
        result = benchmark.run_suite(suite, replace(bench, folder=str(folder)), machine, progress=tell)
    missing = why_no_picture()
    if missing is None:
        draw(result, folder)
    elif not quiet:
        print(f"stratalux: note: {missing}", file=sys.stderr)
    if left_out := result.about.get("left_out"):
        print(f"stratalux: note: left out {len(left_out)}: {'; '.join(left_out)}", file=sys.stderr)
    if json_path is not None:
        write_json(json_path, result.to_json())
    if not quiet and json_path != "-":
        _print(result)
        click.echo(f"wrote {folder}")


def _print(result: BenchResult) -> None:
    from rich.table import Table

    from ..bench.markdown import marks
    from ..bench.records import REGIONS

    console = standard_output(_TABLE_WIDTH)
    table = Table(title="Speed-up at equal error over the best of Mitsuba's own", title_justify="left")
    table.add_column("case")
    table.add_column("our spp", justify="right")
    table.add_column("our seconds", justify="right")
    table.add_column("the best of Mitsuba's, by our budgets", overflow="fold")
    for name in ("surfaces", "range", "whole image", "range"):
        table.add_column(name, justify="right", no_wrap=True)
    for case in result.cases:
        verdicts = {region: case.verdict(region) for region in REGIONS}
        counted = verdicts[case.case.region]
        cells = []
        for region, verdict in verdicts.items():
            if verdict is None:
                cells += ["-", "-"]
            else:
                cells += [f"{verdict.ratio:.2f}{marks(case, region)}", f"{verdict.lowest:.2f}-{verdict.highest:.2f}"]
        table.add_row(
            case.case.name,
            ", ".join(str(point.spp) for point in case.ours.points),
            ", ".join(f"{point.seconds.median:.2g}" for point in case.ours.points),
            "-" if counted is None else "; ".join(counted.winners),
            *cells,
        )
    table.caption = "* outside of what was measured of the other side   † limited by the reference"
    table.caption_justify = "left"
    console.print(table)
    for region, title in (("surface", "surfaces"), ("image", "against the map, whole image")):
        summary = result.summary(region)
        if summary is not None:
            means = ", ".join(f"{name} {ratio:.2f}" for name, ratio in summary["materials"].items())
            console.print(
                f"{title}: geometric mean {summary['ratio']:.2f} ({means}); ahead in {summary['ahead']} of "
                f"{summary['cases']}; worst {summary['worst']['case']} {summary['worst']['ratio']:.2f}"
            )
    for raced in result.peers:
        _print_peers(console, raced)
    if result.floor is not None:
        ratio = result.floor["ratio"]
        console.print(
            f"64 strata, 4 proposals: {ratio['median']:.2f} times the time of as many bare shadow rays "
            f"({ratio['min']:.2f}-{ratio['max']:.2f})"
        )
    for one in result.preparation:
        names = ("ours", "pinned", "mitsuba_array", "mitsuba_file")
        ours, pinned, array, file = (one["seconds"][name]["median"] for name in names)
        megabytes = one["table_bytes"]["ours"] / 1e6
        console.print(
            f"preparation, {one['width']}x{one['height']}: ours {ours:.3g} s ({megabytes:.1f} MB), {one['strata']} "
            f"regions of the paper's scheme {pinned:.3g} s, on top of Mitsuba's {array:.3g} s from memory, "
            f"{file:.3g} s from a file"
        )


def _print_peers(console: Console, raced: PeersResult) -> None:
    from rich.table import Table

    from ..bench.markdown import plateau

    spp = ", ".join(str(point.spp) for point in raced.ours.points)
    table = Table(title=f"{raced.case.name}: seconds to the errors of our {spp} spp", title_justify="left")
    table.add_column("renderer", overflow="fold")
    for name in ("seconds", "speed-up", "mean over reference's", "plateau of relMSE"):
        table.add_column(name, justify="right")
    ours = ", ".join(f"{point.seconds.median:.2g}" for point in raced.ours.points)
    table.add_row("Stratalux, stratified", ours, "1", "-", "-")
    for peer in raced.peers:
        if peer.failure is not None:
            console.print(f"note: {peer.failure}", markup=False)
        verdict = raced.verdict(peer)
        if verdict is None or peer.curve is None:
            continue
        table.add_row(
            peer.curve.configuration.label,
            ", ".join(f"{duel.theirs:.3g}{'*' * duel.outside}" for duel in verdict.duels),
            f"{verdict.ratio:.3g} ({verdict.lowest:.3g}-{verdict.highest:.3g})",
            f"{peer.agreement:.4f}",
            plateau(peer),
        )
    console.print(table)
