"""``stratalux stratify``."""

from __future__ import annotations

import time
from typing import Any

import click

from ..images.settings import MemorySettings, ViewSettings
from ..maps.settings import LayoutSettings
from ..rendering.settings import MOST_STRATA
from .flags import flags
from .output import write_json


@click.command()
@click.argument("map_file", metavar="MAP")
@click.option(
    "-n", "-N", "--strata", "n", type=click.IntRange(1, MOST_STRATA), default=64, show_default=True, help="Regions."
)
@click.option("-o", "--output", help="Picture of the map with the borders of the regions (.png, .jpg ...).")
@click.option("--json", "json_file", help="The regions as JSON; - for standard output.")
@flags(file=LayoutSettings, picture=ViewSettings, machine=MemorySettings)
def stratify(
    map_file: str,
    n: int,
    output: str | None,
    json_file: str | None,
    file: LayoutSettings,
    picture: ViewSettings,
    machine: MemorySettings,
) -> None:
    """Cut the environment map MAP into regions of equal energy by median cut (figure 1 of the paper).

    \b
    Examples:
      stratalux stratify grace.exr -n 64 -o regions.png
      stratalux stratify grace.exr -n 37 --json regions.json
      stratalux stratify grace.exr -n 16 --json - | jq '.regions[0].direction'
    """
    from ..images.files import PICTURE_SUFFIXES, check_different, check_output, check_writable
    from ..images.writing import write_picture
    from ..maps.envmap import EnvironmentMap
    from ..maps.median_cut import median_cut
    from ..maps.regions import describe_regions
    from ..rigs.picture import draw_regions

    if output is not None:
        check_output(output, PICTURE_SUFFIXES)
    if json_file not in (None, "-"):
        check_writable(json_file)
    check_different([path for path in (output, json_file) if path not in (None, "-")], [map_file])
    environment = EnvironmentMap.load(map_file, layout=file.env_layout, max_memory=machine.max_memory)
    start = time.perf_counter()
    regions = median_cut(environment, n)
    milliseconds = 1000 * (time.perf_counter() - start)
    if output is not None:
        write_picture(output, draw_regions(environment, regions, picture))
    if json_file is not None:
        write_json(json_file, {"map": map_file, **describe_regions(environment, regions)})
    click.echo(_summary(regions, n, milliseconds), err=json_file == "-")


def _summary(regions: Any, n: int, milliseconds: float) -> str:
    energy, mean = regions.energy, regions.energy.mean()
    short = "" if len(regions) == n else f" (of {n} asked for: the rest cannot be cut)"
    if mean == 0:
        return f"{len(regions)} region(s){short}, all black, cut in {milliseconds:.1f} ms"
    return (
        f"{len(regions)} region(s){short}, energies {energy.min() / mean:.3f} to {energy.max() / mean:.3f} "
        f"of their mean (standard deviation {energy.std() / mean:.3f}), cut in {milliseconds:.1f} ms"
    )
