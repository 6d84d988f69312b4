"""``stratalux merge``."""

from __future__ import annotations

import click


@click.command()
@click.argument("images", metavar="IMAGE.exr...", nargs=-1, required=True)
@click.option("-o", "--output", metavar="FILE.exr", required=True, help="OpenEXR file to write.")
@click.option("--float32", is_flag=True, help="Numbers of 32 bits instead of half floats.")
def merge(images: tuple[str, ...], output: str, float32: bool) -> None:
    """Join images of the same picture that were rendered from different seeds, on several machines for instance.

    The result is their mean by their samples per pixel. It can be merged again, and remembers its seeds, so that none
    counts twice. Render with --float32 where rounding to half floats would show.

    \b
    Examples:
      stratalux render demo --seed 1 -o one.exr
      stratalux render demo --seed 2 -o two.exr
      stratalux merge one.exr two.exr -o both.exr
    """
    from ..images.files import check_different, check_output
    from ..images.writing import write_image
    from ..rendering.merging import merge as merged

    path = check_output(output, (".exr",))
    check_different([path], images)
    result = merged(images)
    write_image(path, result.pixels, result.metadata(), float32=float32, channels=result.channels)
    click.echo(f"wrote {path}: {result.spp} spp of {len(result.seeds)} seeds")
