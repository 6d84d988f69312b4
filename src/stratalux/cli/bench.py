"""``stratalux bench``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from .output import write_json

if TYPE_CHECKING:
    from ..bench import BenchResult
    from ..bench.peers.records import PeersResult

_TABLE_WIDTH = 150
"""Where the output is no terminal."""
_SUITES = ("quick", "full")


@click.command()
@click.option(
    "--suite",
    type=click.Choice(_SUITES),
    default="quick",
    show_default=True,
    help="quick: five cases, minutes; full: 100 cases, an hour.",
)
@click.option("--json", "json_path", metavar="FILE", help="Write all figures there too; - prints them instead.")
@click.option("-o", "--output", metavar="FOLDER", help="Folder of the results.  [default: bench-SUITE]")
@click.option("--assets", "assets", metavar="DIR", help="Look there first for maps and meshes.")
@click.option("-m", "--variant", help="Mitsuba variant.  [default: cuda_ad_rgb where it works, else llvm_ad_rgb]")
@click.option("--peers", is_flag=True, help="Measure Cycles and LuxCore in the same scene too: stratalux[peers].")
@click.option("--peers-python", metavar="PYTHON", help="Interpreter that has their packages.  [default: this one]")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def bench(suite: str, **options: Any) -> None:
    """Measure the default technique against the best of Mitsuba's own, at equal error, on real maps and meshes.

    The figure is the seconds that the best of Mitsuba's "direct" needs to reach our error, over ours: above 1, we are
    ahead. Every sampler and split is tried for the other side. The folder gets results.json and bench.svg, .png; a run
    that was interrupted goes on where it was. Nothing else should run on the machine meanwhile.

    \b
    Examples:
      stratalux bench
      stratalux bench --suite full -o out/bench
      stratalux bench --peers
      stratalux bench -q --json - | jq .summary.surface
    """
    from .. import bench as benchmark  # Mitsuba is imported here, not before --help
    from ..bench.picture import draw, why_no_picture
    from ..images.files import check_writable

    json_path = options["json_path"]
    if json_path not in (None, "-"):
        check_writable(json_path)
    folder = Path(options["output"] or f"bench-{suite}")
    quiet = options["quiet"]
    columns = (
        TextColumn("measuring"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, disable=quiet or not sys.stderr.isatty(), speed_estimate_period=600
    ) as bar:
        task = bar.add_task("", total=1.0)
        result = benchmark.run(
            suite,
            assets=options["assets"],
            folder=folder,
            variant=options["variant"],
            peers=options["peers"] or options["peers_python"] is not None,
            peers_python=options["peers_python"],
            progress=lambda done, what: bar.update(task, completed=done, description=what),
        )
    missing = why_no_picture()
    if missing is None:
        draw(result, folder)
    elif not quiet:
        print(f"stratalux: note: {missing}", file=sys.stderr)
    if json_path is not None:
        write_json(json_path, result.to_json())
    if not quiet and json_path != "-":
        _print(result)
        click.echo(f"wrote {folder}")


def _print(result: BenchResult) -> None:
    from ..bench.markdown import marks
    from ..bench.records import REGIONS

    console = Console(width=None if sys.stdout.isatty() else _TABLE_WIDTH, highlight=False)
    table = Table(title="Speed-up at equal error over the best of Mitsuba's direct", title_justify="left")
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
    floor = result.floor
    console.print(
        f"64 strata, 4 proposals: {floor['ratio']['median']:.2f} times the time of as many bare shadow rays "
        f"({floor['ratio']['min']:.2f}-{floor['ratio']['max']:.2f})"
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
