"""``stratalux compare``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from .options import Counts, load, scene_options

_TABLE_WIDTH = 110
"""Where the output is no terminal."""


@click.command()
@click.argument("scene")
@scene_options
@click.option(
    "-t",
    "--technique",
    "techniques",
    multiple=True,
    required=True,
    metavar="NAME[:key=value,...]",
    help="What to compare; repeat for several.",
)
@click.option("--rays", type=Counts(), default="16,32,64,128,256", show_default=True, help="Rays per shading point.")
@click.option(
    "-s",
    "--spp",
    type=click.IntRange(min=1),
    default=4,
    show_default=True,
    help="Samples per pixel; a technique whose rays are fixed gets more instead.",
)
@click.option(
    "--repeats", type=click.IntRange(1, 100), default=3, show_default=True, help="Renderings with different seeds."
)
@click.option(
    "--reference-spp",
    type=click.IntRange(min=1),
    default=4096,
    show_default=True,
    help="Samples per pixel of the reference.",
)
@click.option("--seed", type=click.IntRange(0, 65535), default=0, show_default=True, help="Seed of the random numbers.")
@click.option("-o", "--output", help="Folder to write.  [default: compare-SCENE]")
@click.option("--force", is_flag=True, help="Replace a folder of former results.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def compare(scene: str, **options: Any) -> None:
    """Compare techniques on SCENE (as for render), at equal numbers of shadow rays and at equal time.

    Errors are measured against a reference that none of the techniques made; it is kept in ~/.cache/stratalux. The
    folder gets report.html, a page to open in a browser, all images (.exr, .png), results.json, and log-log curves
    (.svg, .png).

    \b
    Examples:
      stratalux compare demo --size 150x100 --technique stratified --technique direct --rays 16,64
      stratalux compare buddha.obj --env grace.exr --env-rotate flip --material metal \\
          --technique stratified --technique stratified:proposals=8 --technique path -o metal
      stratalux compare scene.xml --technique direct:bsdf_samples=4 --technique path --reference-spp 16384
    """
    from ..comparison.compare import compare as run_comparison  # Mitsuba is imported here, not before --help
    from ..comparison.compare import parse_entries
    from ..comparison.results import check_folder
    from ..rendering.variants import choose_variant

    stem = Path(scene).stem
    folder = check_folder(options["output"] or f"compare-{stem}", force=options["force"])
    choose_variant(options["variant"])
    parse_entries(options["techniques"])  # before a large scene is loaded
    loaded, _ = load(scene, options)
    quiet = options["quiet"]
    columns = (
        TextColumn("comparing"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=Console(stderr=True), disable=quiet or not sys.stderr.isatty()) as progress:
        task = progress.add_task("", total=1.0)
        result = run_comparison(
            loaded,
            options["techniques"],
            rays=options["rays"],
            spp=options["spp"],
            repeats=options["repeats"],
            seed=options["seed"],
            reference_spp=options["reference_spp"],
            name=stem,
            progress=lambda done, what: progress.update(task, completed=done, description=what),
        )
    result.write(folder, force=options["force"])
    for note in result.notes:
        print(f"stratalux: note: {note}", file=sys.stderr)
    if quiet:
        return
    console = Console(width=None if sys.stdout.isatty() else _TABLE_WIDTH, highlight=False)
    reference = result.reference
    plugin, *settings = (
        str(value) if key == "type" else f"{key}={value}" for key, value in reference.estimator.items()
    )
    console.print(
        f"reference: {plugin} ({', '.join(settings)}), {reference.spp} spp"
        f"{', from the cache' if reference.cached else f', made in {reference.seconds:.1f} s'}; its own relMSE "
        f"{reference.relative_mse_floor(result.mask(result.region)):.2g}"
    )
    for title, records in (("Equal shadow rays", result.equal_rays), ("Equal time", result.equal_time)):
        console.print(_table(f"{title}; {_WHERE[result.region]}", result, records))
    console.print(f"wrote {folder}; open {folder / 'report.html'} in a browser")


_WHERE = {"surface": "errors over the pixels that are all surface", "image": "errors over the whole image"}


def _table(title: str, result: Any, records: Any) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold")
    table.add_column("rays", justify="right")
    table.add_column("technique", overflow="fold")
    for name in ("spp", "seconds", "relMSE", "FLIP", "efficiency", "vs best"):
        table.add_column(name, justify="right", no_wrap=True)
    for record in records:
        errors = record.errors[result.region]
        table.add_row(
            str(record.rays),
            record.entry.name + ("" if record.entry.technique.unbiased else " (biased)"),
            str(record.spp),
            f"{record.seconds.median:.3g}",
            f"{errors.relative_mse.median:.3g}{' *' if errors.reference_limited else ''}",
            "-" if errors.flip is None else f"{errors.flip:.4f}",
            f"{errors.efficiency:.3g}",
            f"{result.relative_to_best(record):.2f}",
            end_section=record.entry is result.entries[-1],
        )
    if any(record.errors[result.region].reference_limited for record in records):
        table.caption = "* limited by the reference"
        table.caption_justify = "left"
    return table
