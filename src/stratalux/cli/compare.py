"""``stratalux compare``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..comparison.settings import ComparisonSettings
from ..rendering.settings import MachineSettings
from ..scenes.settings import CameraSettings, SceneSettings, check_source
from .flags import flags
from .progress import console as standard_output
from .progress import share_of_work

if TYPE_CHECKING:
    from rich.table import Table

_TABLE_WIDTH = 110
"""Where the output is no terminal."""


@click.command()
@flags(scene=SceneSettings, camera=CameraSettings, comparison=ComparisonSettings, machine=MachineSettings)
@click.option("-o", "--output", metavar="FOLDER", help="Folder to write.  [default: compare-SCENE]")
@click.option("--force", is_flag=True, help="Replace a folder of former results.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def compare(
    scene: SceneSettings,
    camera: CameraSettings,
    comparison: ComparisonSettings,
    machine: MachineSettings,
    output: str | None,
    force: bool,
    quiet: bool,
) -> None:
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
    import mitsuba as mi  # not before --help

    from ..comparison.compare import run_comparison
    from ..comparison.results import check_folder
    from ..rendering.passes import activate

    check_source(scene.source)
    folder = check_folder(f"compare-{Path(scene.source).stem}" if output is None else output, force=force)
    machine = activate(machine)
    mi.set_log_level(mi.LogLevel.Error)
    bar, tell = share_of_work("comparing", quiet=quiet)
    with bar:
        result = run_comparison(scene, comparison, camera, machine, progress=tell)
    result.write(folder, force=force)
    for note in result.notes:
        print(f"stratalux: note: {note}", file=sys.stderr)
    if quiet:
        return
    console = standard_output(_TABLE_WIDTH)
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
    from rich.table import Table

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
