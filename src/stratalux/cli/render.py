"""``stratalux render``."""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from .options import load, scene_options


@click.command()
@click.argument("scene")
@scene_options
@click.option("-N", "--strata", type=click.IntRange(min=1), help="Pin the scheme of the paper, with N regions.")
@click.option("-M", "--proposals", type=click.IntRange(min=1), help="Pin the scheme of the paper, with M proposals.")
@click.option("-t", "--technique", metavar="NAME[:key=value,...]", help="Another technique; see stratalux techniques.")
@click.option("-s", "--spp", type=click.IntRange(min=1), help="Samples per pixel.  [default: the scene's own, or 64]")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the random numbers.")
@click.option("--hide-emitters", is_flag=True, help="Leave the map out of the background.")
@click.option(
    "-o", "--output", multiple=True, help="File to write, .exr or .png; repeat for several.  [default: SCENE.exr]"
)
@click.option("--exposure", type=float, help="Exposure of a PNG in stops.  [default: automatic]")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@click.option("-v", "--verbose", is_flag=True, help="Show Mitsuba's log.")
def render(scene: str, **options: Any) -> None:
    """Render SCENE: a Mitsuba XML file, a mesh (.ply .obj .stl .glb .gltf .off), or demo.

    A mesh is framed on a ground plane. The integrator of an XML file is replaced by direct_stratified: direct light, of
    which the samples per pixel are all there is to choose. Ctrl-C stops after the current pass and keeps what is done.

    \b
    Examples:
      stratalux render demo -o demo.exr -o demo.png
      stratalux render teapot.obj --env grace.exr --env-rotate flip --size 600x400 -o teapot.png
      stratalux render part.stl --up z --env studio.hdr --material metal --strata 32 --proposals 8
      stratalux render demo --technique importance:samples=32,proposals=128 -o importance.png
      stratalux render matpreview.xml -D spp=64 --env forest.hdr --env-rotate 90 -o preview.exr
    """
    from ..images.files import check_output  # Mitsuba is imported here, not before --help
    from ..integrators.techniques import parse_technique
    from ..rendering.passes import render_passes
    from ..rendering.variants import choose_variant

    outputs = [check_output(path) for path in options["output"] or (f"{Path(scene).stem}.exr",)]
    choose_variant(options["variant"])
    if options["technique"]:
        parse_technique(options["technique"])  # a bad name is told before anything is loaded
    loaded, variant = load(scene, options, verbose=options["verbose"])
    passes = render_passes(
        loaded,
        technique=options["technique"] or "stratified",
        strata=options["strata"],
        proposals=options["proposals"],
        hide_emitters=options["hide_emitters"],
        spp=options["spp"] or 0,
        seed=options["seed"],
    )
    result, stopped = _watch(passes, quiet=options["quiet"])
    if result is None:
        print("stratalux: interrupted before the first pass was done; nothing to keep", file=sys.stderr)
        sys.exit(130)
    for path in outputs:
        result.write(path, options["exposure"])
    if not options["quiet"]:
        rays = result.camera_rays + result.shadow_rays
        seconds = max(result.seconds, 1e-9)
        click.echo(
            f"{result.spp} spp in {result.seconds:.2f} s with {variant} "
            f"(preparation {result.preparation_seconds:.2f} s, compilation {result.compile_seconds:.2f} s): "
            f"up to {rays / 1e6:.1f} M rays, {rays / seconds / 1e6:.1f} M rays/s, "
            f"{result.camera_rays / seconds / 1e6:.2f} M samples/s"
        )
        click.echo("wrote " + ", ".join(map(str, outputs)))
    if stopped:
        sys.exit(130)


def _watch(passes: Any, *, quiet: bool) -> tuple[Any, bool]:
    """Run the passes under a progress bar; the last result, and whether Ctrl-C ended it early."""
    interrupted = False

    def interrupt(*_: object) -> None:
        nonlocal interrupted
        if interrupted:  # the second time, at once
            raise KeyboardInterrupt
        interrupted = True

    columns = (
        TextColumn("rendering"),
        BarColumn(),
        TextColumn("{task.fields[spp]}"),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    previous = signal.signal(signal.SIGINT, interrupt)
    result = None
    try:
        with Progress(*columns, console=Console(stderr=True), disable=quiet or not sys.stderr.isatty()) as progress:
            task = progress.add_task("render", total=None, spp="", rate="")
            for result in passes:
                rate = f"{(result.camera_rays + result.shadow_rays) / max(result.seconds, 1e-9) / 1e6:.1f} M rays/s"
                spp = f"{result.spp}/{result.spp_total} spp"
                progress.update(task, completed=result.spp, total=result.spp_total, spp=spp, rate=rate)
                if interrupted:
                    break
    finally:
        signal.signal(signal.SIGINT, previous)
    # Where the samples of a pixel follow its error, there may be a few less in the end than asked for.
    return result, interrupted and result is not None and result.spp < result.spp_total
