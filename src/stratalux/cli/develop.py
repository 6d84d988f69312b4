"""``stratalux develop``."""

from __future__ import annotations

from dataclasses import fields

import click

from ..images.settings import MemorySettings, PictureFileSettings
from .flags import flags


@click.command()
@click.argument("images", metavar="IMAGE...", nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="FILE|FOLDER",
    help="Picture to write, .png .jpg .webp or .tif; for several, a folder, or a name with {} for that of the image.",
)
@flags(picture=PictureFileSettings, machine=MemorySettings)
def develop(images: tuple[str, ...], output: str, picture: PictureFileSettings, machine: MemorySettings) -> None:
    """Make pictures of images that are there: .exr, .hdr, or whatever a map may be.

    As film is developed: an exposure, and a view that bends what is brighter than white. The automatic exposure is one
    for all images, so that they can be compared.

    \b
    Examples:
      stratalux develop demo.exr --view agx -o demo.png
      stratalux develop a.exr b.exr --exposure -1 --bits 16 -o pictures/{}.tif
      stratalux develop frames/*.exr --view aces -o pictures
    """
    from ..images.develop import develop as developed  # not before --help

    asked = {field.name: getattr(picture, field.name) for field in fields(picture)}
    made = developed(images, output, max_memory=machine.max_memory, **asked)
    automatic = " (automatic)" if picture.exposure is None else ""
    click.echo(f"wrote {', '.join(map(str, made.files))}; exposure {made.exposure:+.2f} stops{automatic}")
