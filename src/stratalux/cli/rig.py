"""``stratalux rig``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import InputError
from ..images.settings import MemorySettings, ViewSettings
from ..rigs.settings import RigSettings
from ..settings import command_line
from .flags import flags

if TYPE_CHECKING:
    from ..rigs.lights import Lights


@click.command()
@click.option("-o", "--output", metavar="FILE", help="The rig, by the suffix of the file; - for JSON on stdout.")
@click.option(
    "--to",
    multiple=True,
    metavar="FILE|NAME:FILE|NAME",
    help="Another file, by its suffix (.json .csv .xml .pbrt .glb .gltf .usda .usdc .usd .usdz .py .blend .tscn .rad) "
    "or by a name: three:FILE.json, unreal:FILE.py. A name alone is that of the format of -o.",
)
@click.option("--plot", help="Picture of the map with the lights and their cells (.png, .jpg ...).")
@click.option("--report", metavar="FILE.html", help="Page with the map, the lights, and what both light, in pictures.")
@flags(settings=RigSettings, picture=ViewSettings, machine=MemorySettings)
def rig(
    output: str | None,
    to: tuple[str, ...],
    plot: str | None,
    report: str | None,
    settings: RigSettings,
    picture: ViewSettings,
    machine: MemorySettings,
) -> None:
    """Turn the environment map MAP into N directional lights, or write a rig for another tool.

    Of each light the JSON has the unit direction towards it (the map's frame: y up, its middle at +z), its colour
    (linear RGB, the irradiance of what faces it), and the solid angle of the cell that it stands for. It is read back.
    Other formats have the axes and the units of their tools.

    \b
    Examples:
      stratalux rig venice.hdr --method kmeans -n 32 -o rig.json --plot rig.png
      stratalux rig venice.hdr --method fitted -n 8 --ambient sh2 --to lights.usda --to three:lights.json
      stratalux rig venice.hdr --sun -o sun.py
      stratalux rig venice.hdr --method fitted -n 8 --ambient sh2 --report rig.html
      stratalux rig rig.json --to rig.glb --env-frame three
      stratalux rig grace.exr --method structured -n 300 -o - | jq '.lights | length'
    """
    from ..images.files import PICTURE_SUFFIXES, check_different, check_output, check_writable
    from ..images.writing import write_picture
    from ..maps.envmap import EnvironmentMap
    from ..rigs.formats import format_of, read_rig, write_rig
    from ..rigs.formats.own import encode
    from ..rigs.making import make_lights
    from ..rigs.picture import draw_lights, draw_rig

    wanted = _wanted(output, to)
    if plot is not None:
        check_output(plot, PICTURE_SUFFIXES)
    if report is not None:
        if not report.lower().endswith((".html", ".htm")):
            raise InputError(f"{report}: a report is a page; give a name that ends with .html")
        check_writable(report)
    for name, file in wanted:
        check_writable(file)
        format_of(file, name)
    source = settings.source
    check_different([file for file in (plot, report, *(file for _, file in wanted)) if file is not None], [source])
    if Path(source).suffix.lower() == ".json":
        changed = sorted(set(settings.changed()) - {"source", "env_frame"})
        changed += [name for name, file in (("plot", plot), ("report", report)) if file is not None]
        if changed:
            raise InputError(f"{source}: is a rig already; {changed[0]} is for maps: leave it out, or give the map")
        lights, cells, environment = read_rig(source), None, None
        made = f"{len(lights)} light(s) by {lights.method}"
    else:
        environment = EnvironmentMap.load(source, layout=settings.env_layout, max_memory=machine.max_memory)
        lights, cells = make_lights(environment, settings)
        made = _summary(lights, 1 if settings.sun else settings.lights)
    if plot is not None and environment is not None:
        drawn = draw_lights(environment, lights, picture) if cells is None else draw_rig(environment, cells, picture)
        write_picture(plot, drawn)
    for name, file in wanted:
        write_rig(lights, file, name, env_frame=settings.env_frame)
    if report is not None and environment is not None:
        from ..comparison.rig_page import write_rig_report

        write_rig_report(environment, lights, report, cells=cells, command=command_line("stratalux", "rig", settings))
        made += f"; open {report} in a browser"
    if output == "-":
        click.echo(encode(lights, Path("-")).decode(), nl=False)
    click.echo(made, err=output == "-")


def _wanted(output: str | None, to: tuple[str, ...]) -> list[tuple[str | None, str]]:
    """Names of formats, None where the suffix tells, and files."""
    from ..rigs.formats import FORMATS

    wanted: list[tuple[str | None, str]] = []
    of_output: str | None = None
    for one in to:
        name, colon, file = one.partition(":")
        if one in FORMATS:
            if output in (None, "-"):
                raise InputError(f"--to {one}: is a format; give the file too, as in {one}:FILE")
            of_output = one
        elif colon and name in FORMATS:
            wanted.append((name, file))
        else:
            wanted.append((None, one))
    if output is not None and output != "-":
        wanted.insert(0, (of_output, output))
    return wanted


def _summary(lights: Lights, n: int) -> str:
    colour = " ".join(f"{c:.4g}" for c in lights.colour.sum(axis=0))
    short = "" if len(lights) == n else f" (of {n} asked for)"
    errors = f"irradiance {lights.quality['irradiance_error']:.2%} off, shadows {lights.quality['shadow_error']:.1%}"
    return f"{len(lights)} light(s){short} by {lights.method}, total colour {colour}, {errors}"
