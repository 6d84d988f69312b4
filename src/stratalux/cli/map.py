"""``stratalux map``."""

from __future__ import annotations

from dataclasses import fields

import click

from ..images.settings import MemorySettings
from ..maps.settings import MapSettings
from .flags import flags


@click.command()
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    required=True,
    metavar="FILE",
    help="File to write, .exr .hdr .pfm or .tif; .json or .glsl for sh; repeat for several. For faces, six are named "
    "after it.",
)
@click.option(
    "--light",
    "lights",
    multiple=True,
    metavar="FILE|NAME:FILE",
    help="File for the sun that --remove-sun leaves out, in a format of rigs (see stratalux rig --to).",
)
@flags(settings=MapSettings, machine=MemorySettings)
def map(outputs: tuple[str, ...], lights: tuple[str, ...], settings: MapSettings, machine: MemorySettings) -> None:
    """Convert the environment map MAP: to another layout, to spherical harmonics, or to one without its sun.

    Resampled with all of its light. Any layout is read (--env-layout), and any is written; docs/maps.md says how each
    lies in its image.

    \b
    Examples:
      stratalux map venice.hdr --to cross --size 512 -o venice_cross.exr
      stratalux map venice.hdr --to faces -o venice.hdr
      stratalux map uffizi_probe.hdr -o uffizi.exr
      stratalux map venice.hdr --to equal-area -o venice_equiarea.exr
      stratalux map venice.hdr --to sh -o venice.json -o venice.glsl
      stratalux map sky.hdr --remove-sun -o rest.exr --light sun.json --light sun.usda
    """
    from ..rigs.conversion import convert_map  # not before --help
    from ..rigs.formats import FORMATS

    split = [one.partition(":") for one in lights]
    named = [(name, file) if colon and name in FORMATS else (None, name + colon + file) for name, colon, file in split]
    asked = {field.name: getattr(settings, field.name) for field in fields(settings) if field.name != "source"}
    made = convert_map(settings.source, outputs, lights=named, max_memory=machine.max_memory, **asked)
    if made.sun is not None:
        colour = " ".join(f"{c:.4g}" for c in made.sun.colour)
        click.echo(f"left out: a sun of {colour}, {made.sun.share:.1%} of the light")
    click.echo(f"wrote {', '.join(str(file) for file in made.files)}: {made.what}")
