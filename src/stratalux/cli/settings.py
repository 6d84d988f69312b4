"""``stratalux settings``."""

from __future__ import annotations

import json

import click


@click.command()
@click.argument("image", metavar="IMAGE.exr")
@click.option("--python", "as_call", is_flag=True, help="The Python call that makes the image.")
@click.option("--json", "as_json", is_flag=True, help="All settings as JSON.")
def settings(image: str, as_call: bool, as_json: bool) -> None:
    """Print the command that makes an image again, from what the OpenEXR file remembers of its settings.

    \b
    Examples:
      stratalux settings demo.exr
      stratalux settings demo.exr --python
      stratalux settings demo.exr --json | jq .sampling.spp
    """
    from ..rendering.settings import PictureSettings

    if as_call and as_json:
        raise click.UsageError("--python and --json are two answers; ask for one of them")
    picture = PictureSettings.of_file(image)
    if as_json:
        click.echo(json.dumps(picture.to_json(), indent=1, ensure_ascii=False))
    else:
        click.echo(picture.call() if as_call else picture.command())
