"""``stratalux render``."""

from __future__ import annotations

import os
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import InputError
from ..images.settings import OutputSettings
from ..rendering.settings import MachineSettings, PictureSettings, SamplingSettings
from ..scenes.settings import CameraSettings, SceneSettings, check_source
from .flags import Number, flags
from .watch import Keeper, watch

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
@click.option(
    "--checkpoint",
    metavar="FILE",
    help="Keep the picture in the making there, to go on with.  [default: OUTPUT.checkpoint, from two minutes on]",
)
@click.option(
    "--checkpoint-every",
    type=Number(0),
    default=60.0,
    metavar="SECONDS",
    help="How often.  [default: 60]",
)
@click.option("--resume", metavar="FILE", help="Go on from a checkpoint of the same picture.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@click.option("-v", "--verbose", is_flag=True, help="Show Mitsuba's log.")
def render(
    scene: SceneSettings,
    camera: CameraSettings,
    sampling: SamplingSettings,
    image: OutputSettings,
    machine: MachineSettings,
    outputs: tuple[str, ...],
    checkpoint: str | None,
    checkpoint_every: float,
    resume: str | None,
    quiet: bool,
    verbose: bool,
) -> None:
    """Render SCENE: a Mitsuba XML file, a model (.glb .gltf .usd .usdz .obj .ply .stl .off), or demo.

    A model looks as its file says, and stands in its shadow on what is behind it. Light is traced by path_stratified,
    with the depth and the other settings that the integrator of an XML file has, or by direct_stratified where that is
    of direct light. Ctrl-C stops after the current pass and keeps what is done. What takes longer than two minutes is
    kept in a checkpoint every minute: if the process is killed, the same command goes on with --resume.

    \b
    Examples:
      stratalux render demo -o demo.exr -o demo.png
      stratalux render teapot.obj --env grace.exr --env-rotate flip --size 600x400 -o teapot.png
      stratalux render demo --direct -o direct.png
      stratalux render teapot.obj --env grace.exr --orbit 120,30 --fov 50 -o side.png
      stratalux render truck.glb --env studio.hdr --orbit 60,20 --background blur:5 -o truck.jpg
      stratalux render demo --target-error 0.01 -o demo.exr
      stratalux render demo --time 8h --checkpoint night.checkpoint -o demo.exr
      stratalux render demo --spp 4096 --cluster tcp://scheduler:8786 -o demo.exr
      stratalux render part.stl --up z --env studio.hdr --material metal --strata 32 --proposals 8
      stratalux render demo --technique importance:samples=32,proposals=128 -o importance.png
      stratalux render matpreview.xml -D spp=64 --env forest.hdr --env-rotate 90 -o preview.exr
    """
    from ..images.files import (
        CHECKPOINT,
        check_bits,
        check_different,
        check_film,
        check_float32,
        check_output,
        check_writable,
        is_picture,
    )

    if quiet and verbose:
        raise click.UsageError("--quiet and --verbose: one asks for nothing, the other for Mitsuba's log; give one")
    check_source(scene.source)
    paths = [check_output(path) for path in outputs or (f"{Path(scene.source).stem}.exr",)]
    for path in paths:
        check_bits(path, image)
        if camera.size is not None:
            check_film(path, *camera.size)
    check_float32(paths, image)
    beside = paths[0].name if len(os.fsencode(paths[0].name)) < 240 else "stratalux"
    kept = Path(checkpoint or resume or paths[0].with_name(beside + CHECKPOINT))
    inputs = [scene.source, *([scene.environment] if scene.environment else [])]
    check_different([*paths, kept], inputs)
    if checkpoint is not None:
        check_writable(kept)
    picture = PictureSettings(scene, camera, sampling, image, machine)
    keeper = Keeper(kept, checkpoint is not None, checkpoint_every, expected=resume is not None)
    watched = watch(lambda: _passes(picture, paths, resume, verbose), keeper, quiet=quiet)
    result, stopped = watched.result, watched.stopped
    if result is None:
        print("stratalux: interrupted before the first pass was done; nothing to keep", file=sys.stderr)
        sys.exit(128 + stopped)
    if result.part + 1 < result.parts:
        below = f"below row {result.rows.stop}, all is black"
        print(f"stratalux: warning: {result.part} of {result.parts} bands are complete; {below}", file=sys.stderr)
    if lost := _without_numbers(result):
        print(f"stratalux: warning: {lost} pixel(s) are not finite numbers; something is too bright", file=sys.stderr)
    stops = result.exposure if any(is_picture(path, result.output) for path in paths) else None
    lost_places = [told for path in paths if (told := _written(result, path, stops))]
    if not quiet and not lost_places:
        rays = result.camera_rays + result.shadow_rays
        seconds = max(result.seconds, 1e-9)
        click.echo(
            f"{result.spp} spp in {result.seconds:.2f} s with {result.variant} "
            f"(preparation {result.preparation_seconds:.2f} s, compilation {result.compile_seconds:.2f} s): "
            f"up to {rays / 1e6:.1f} M rays, {rays / seconds / 1e6:.1f} M rays/s, "
            f"{result.camera_rays / seconds / 1e6:.2f} M samples/s"
        )
        exposed = "" if stops is None or image.exposure is not None else f"; exposure {stops:+.2f} stops (automatic)"
        size = f"; the object is {result.measure}" if result.measure else ""
        error = "" if result.error is None else f"; relative standard error of a pixel {100 * result.error:.2g} %"
        click.echo("wrote " + ", ".join(map(str, paths)) + exposed + size + error)
    if lost_places or watched.failed:
        raise InputError("; ".join([*([watched.failed] if watched.failed else []), *lost_places]))
    if stopped:
        sys.exit(128 + stopped)


def _written(result: RenderResult, path: Path, stops: float | None) -> str:
    """Write the image, elsewhere if its place has gone meanwhile, or is full: it has taken long. What went wrong."""
    given = {} if stops is None else {"exposure": stops}
    try:
        result.write(path, **given)
        return ""
    except (OSError, InputError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    for folder in (Path.home(), Path(tempfile.gettempdir())):
        with suppress(OSError, InputError):
            elsewhere = Path(tempfile.mkdtemp(prefix="stratalux-", dir=folder)) / path.name
            result.write(elsewhere, **given)
            return f"{path}: cannot be written any more ({why}); the image is in {elsewhere}"
    return f"{path}: cannot be written any more ({why}), and nothing in {Path.home()} or {tempfile.gettempdir()} either"


def _passes(picture: PictureSettings, paths: list[Path], resume: str | None, verbose: bool) -> Iterator[RenderResult]:
    """The passes of a picture, whose scene is loaded; a bad name is told before that."""
    import mitsuba as mi

    from ..rendering.passes import activate, render_passes
    from ..rendering.ready import technique_of

    activate(picture.machine)
    mi.set_log_level(mi.LogLevel.Info if verbose else mi.LogLevel.Error)
    technique_of(picture.sampling)
    return _checked(render_passes(picture, resume=resume), paths)


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

    from ..images.strips import strips

    pixels = np.asarray(result.bitmap)
    rows = strips(*pixels.shape[:2])
    return sum(int(np.count_nonzero(~np.isfinite(pixels[some]).all(axis=-1))) for some in rows)
