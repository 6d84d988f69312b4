"""``stratalux rig``."""

from __future__ import annotations

import time

import click

from ..images.settings import MemorySettings, ViewSettings
from ..rendering.settings import MOST_STRATA
from ..rigs import RIGS
from .flags import flags
from .output import write_json


@click.command()
@click.argument("map_file", metavar="MAP")
@click.option("--method", type=click.Choice(list(RIGS)), default="median-cut", show_default=True, help="Technique.")
@click.option(
    "-n", "-N", "--lights", "n", type=click.IntRange(1, MOST_STRATA), default=64, show_default=True, help="Lights."
)
@click.option("-o", "--output", help="The rig as JSON; - for standard output.")
@click.option("--plot", help="Picture of the map with the lights and their cells (.png, .jpg ...).")
@flags(picture=ViewSettings, machine=MemorySettings)
def rig(
    map_file: str,
    method: str,
    n: int,
    output: str | None,
    plot: str | None,
    picture: ViewSettings,
    machine: MemorySettings,
) -> None:
    """Turn the environment map MAP into N directional lights.

    The JSON lists for each light its unit direction (the map's frame, y up), its colour (linear RGB, radiance times
    steradian: the light of its cell) and the solid angle of its cell.

    \b
    Examples:
      stratalux rig venice.hdr --method kmeans -n 32 -o rig.json --plot rig.png
      stratalux rig grace.exr --method structured -n 300 -o - | jq '.lights | length'
    """
    from ..images.files import PICTURE_SUFFIXES, check_different, check_output, check_writable
    from ..images.writing import write_picture
    from ..maps.envmap import EnvironmentMap
    from ..rigs import light_rig
    from ..rigs.picture import draw_rig

    if plot is not None:
        check_output(plot, PICTURE_SUFFIXES)
    if output not in (None, "-"):
        check_writable(output)
    check_different([path for path in (plot, output) if path not in (None, "-")], [map_file])
    environment = EnvironmentMap.load(map_file, max_memory=machine.max_memory)
    start = time.perf_counter()
    made = light_rig(method, environment, n)
    seconds = time.perf_counter() - start
    if plot is not None:
        write_picture(plot, draw_rig(environment, made, picture))
    if output is not None:
        write_json(output, {"map": map_file, "preprocessing_seconds": seconds, **made.describe()})
    colour = " ".join(f"{c:.4g}" for c in made.total_colour)
    short = "" if len(made) == n else f" (of {n} asked for)"
    click.echo(
        f"{len(made)} light(s){short} by {method}, total colour {colour}, preprocessing {1000 * seconds:.1f} ms",
        err=output == "-",
    )
