"""``stratalux render``."""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..images.settings import OutputSettings
from ..rendering.settings import MachineSettings, PictureSettings, SamplingSettings
from ..scenes.settings import CameraSettings, SceneSettings, check_source
from .flags import flags
from .progress import progress_bar

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..rendering.passes import RenderResult


@click.command()
@flags(
    scene=SceneSettings,
    camera=CameraSettings,
    sampling=SamplingSettings,
    image=OutputSettings,
    machine=MachineSettings,
)
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    metavar="FILE",
    help="File to write, .exr .png .jpg .webp .tif .hdr or .pfm; repeat for several.  [default: SCENE.exr]",
)
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@click.option("-v", "--verbose", is_flag=True, help="Show Mitsuba's log.")
def render(
    scene: SceneSettings,
    camera: CameraSettings,
    sampling: SamplingSettings,
    image: OutputSettings,
    machine: MachineSettings,
    outputs: tuple[str, ...],
    quiet: bool,
    verbose: bool,
) -> None:
    """Render SCENE: a Mitsuba XML file, a model (.glb .gltf .usd .usdz .obj .ply .stl .off), or demo.

    A model looks as its file says, and stands in its shadow on what is behind it. Light is traced by path_stratified,
    with the depth and the other settings that the integrator of an XML file has, or by direct_stratified where that is
    of direct light. Ctrl-C stops after the current pass and keeps what is done.

    \b
    Examples:
      stratalux render demo -o demo.exr -o demo.png
      stratalux render teapot.obj --env grace.exr --env-rotate flip --size 600x400 -o teapot.png
      stratalux render demo --direct -o direct.png
      stratalux render teapot.obj --env grace.exr --orbit 120,30 --fov 50 -o side.png
      stratalux render truck.glb --env studio.hdr --orbit 60,20 --background blur:5 -o truck.jpg
      stratalux render part.stl --up z --env studio.hdr --material metal --strata 32 --proposals 8
      stratalux render demo --technique importance:samples=32,proposals=128 -o importance.png
      stratalux render matpreview.xml -D spp=64 --env forest.hdr --env-rotate 90 -o preview.exr
    """
    from ..images.files import check_bits, check_different, check_float32, check_output, is_picture

    if quiet and verbose:
        raise click.UsageError("--quiet and --verbose: one asks for nothing, the other for Mitsuba's log; give one")
    check_source(scene.source)
    paths = [check_output(path) for path in outputs or (f"{Path(scene.source).stem}.exr",)]
    for path in paths:
        check_bits(path, image)
    check_float32(paths, image)
    check_different(paths, [scene.source, *([scene.environment] if scene.environment else [])])
    picture = PictureSettings(scene, camera, sampling, image, machine)
    result, stopped = _watch(lambda: _passes(picture, paths, verbose), sampling, quiet=quiet)
    if result is None:
        print("stratalux: interrupted before the first pass was done; nothing to keep", file=sys.stderr)
        sys.exit(130)
    if lost := _without_numbers(result):
        print(f"stratalux: warning: {lost} pixel(s) are not finite numbers; something is too bright", file=sys.stderr)
    stops = result.exposure if any(is_picture(path, result.output) for path in paths) else None
    for path in paths:
        result.write(path, **({} if stops is None else {"exposure": stops}))
    if not quiet:
        rays = result.camera_rays + result.shadow_rays
        seconds = max(result.seconds, 1e-9)
        click.echo(
            f"{result.spp} spp in {result.seconds:.2f} s with {result.picture.machine.variant} "
            f"(preparation {result.preparation_seconds:.2f} s, compilation {result.compile_seconds:.2f} s): "
            f"up to {rays / 1e6:.1f} M rays, {rays / seconds / 1e6:.1f} M rays/s, "
            f"{result.camera_rays / seconds / 1e6:.2f} M samples/s"
        )
        exposed = "" if stops is None or image.exposure is not None else f"; exposure {stops:+.2f} stops (automatic)"
        size = f"; the object is {result.measure}" if result.measure else ""
        click.echo("wrote " + ", ".join(map(str, paths)) + exposed + size)
    if stopped:
        sys.exit(130)


def _passes(picture: PictureSettings, paths: list[Path], verbose: bool) -> Iterator[RenderResult]:
    """The passes of a picture, whose scene is loaded; a bad name is told before that."""
    import mitsuba as mi

    from ..rendering.passes import activate, render_passes, technique_of

    activate(picture.machine)
    mi.set_log_level(mi.LogLevel.Info if verbose else mi.LogLevel.Error)
    technique_of(picture.sampling)
    return _checked(render_passes(picture), paths)


def _checked(passes: Iterator[RenderResult], paths: list[Path]) -> Iterator[RenderResult]:
    """The passes, after a look whether the formats of ``paths`` can hold the film's channels."""
    from ..images.files import check_film

    for result in passes:
        for path in paths:
            check_film(path, result.bitmap.width(), result.bitmap.height(), result.bitmap.channel_count())
        yield result


def _without_numbers(result: RenderResult) -> int:
    """How many pixels are infinite or no number."""
    import numpy as np

    return int(np.count_nonzero(~np.isfinite(result.image).all(axis=-1)))


def _watch(start: Any, sampling: SamplingSettings, *, quiet: bool) -> tuple[Any, bool]:
    """Run the passes that ``start`` gives under a progress bar; the last result, and whether Ctrl-C ended it early."""
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    interrupted = False

    def interrupt(*_: object) -> None:
        nonlocal interrupted
        if interrupted:  # the second time, at once
            raise KeyboardInterrupt
        interrupted = True

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[spp]}"),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    previous = signal.getsignal(signal.SIGINT)
    result = None
    try:
        with progress_bar(*columns, quiet=quiet) as progress:
            task = progress.add_task("loading", total=sampling.spp or None, spp="", rate="")
            passes = start()
            signal.signal(signal.SIGINT, interrupt)
            progress.update(task, description="rendering")
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
