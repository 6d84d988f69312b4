"""``stratalux assets``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..assets import ASSETS, Asset, Assets
from ..errors import InputError
from .output import write_json
from .progress import console, progress_bar

_FOLDER = click.option("--assets", "folder", metavar="DIR", help="Look there first; what is fetched goes there.")


@click.group(invoke_without_command=True)
@_FOLDER
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
@click.pass_context
def assets(ctx: click.Context, folder: str | None, as_json: bool) -> None:
    """List the maps, meshes and scenes of the paper and of the benchmarks: what is there, whose it is, its terms.

    Found in --assets, in $STRATALUX_ASSETS, in ../shared/assets beside a checkout, or in ~/.cache/stratalux/assets. A
    file "as measured" is the one that the published figures were made with; one that "differs" works, with others.

    \b
    Examples:
      stratalux assets
      stratalux assets fetch
      stratalux assets fetch grace teapot --assets data
      stratalux assets --json | jq '.assets[] | select(.status == "missing").name'
    """
    from rich.table import Table

    ctx.obj = folder
    if ctx.invoked_subcommand is not None:
        if as_json:
            raise click.UsageError("--json lists; it does not go with fetch")
        return
    lookup = Assets(folder)
    rows = [_describe(lookup, asset) for asset in ASSETS.values()]
    if as_json:
        write_json("-", {"folders": [str(place) for place in lookup.folders], "assets": rows})
        return
    table = Table("name", "status", "size", "owner", "terms", "what", box=None, pad_edge=False)
    table.add_column("where", overflow="fold")
    for row in rows:
        size = f"{row['size'] / 1e6:.1f} MB"
        table.add_row(row["name"], row["status"], size, row["owner"], row["terms"], row["what"], row["path"] or "-")
    console(1000, markup=False).print(table)  # a pipe gets one line for each
    if names := [row["name"] for row in rows if row["path"] is None]:
        click.echo(f"stratalux assets fetch: downloads {', '.join(names)}")


@assets.command()
@click.argument("names", nargs=-1, type=click.Choice(list(ASSETS)), metavar="[NAME]...")
@_FOLDER
@click.pass_obj
def fetch(outer: str | None, names: tuple[str, ...], folder: str | None) -> None:
    """Download assets, all without NAME, and say whose they are and on which terms. What is there stays.

    Needs the extra stratalux[assets]. Files come from public repositories at a fixed commit, must have the SHA-256 of
    those that were measured with, and go to ~/.cache/stratalux/assets, or to --assets, which is made if need be.

    \b
    Examples:
      stratalux assets fetch
      stratalux assets fetch grace teapot
    """
    place = folder or outer
    if place is not None and not Path(place).exists():
        try:
            Path(place).mkdir()
        except OSError as error:
            raise InputError(f"{place}: cannot be made ({error.strerror or error}); name another folder") from None
    lookup = Assets(place)
    for name in names or ASSETS:
        asset = ASSETS[name]
        click.echo(f"{name}: {asset.what}; by {asset.owner}, {asset.source}; terms: {asset.terms}")
        click.echo(f"  {_fetch(lookup, name)}")


def _fetch(lookup: Assets, name: str) -> str:
    from rich.progress import BarColumn, DownloadColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TimeRemainingColumn())
    with progress_bar(*columns, transient=True) as bars:
        task = bars.add_task("", start=True)
        path = lookup.fetch(
            name, lambda file, done, total: bars.update(task, description=file, completed=done, total=total)
        )
    return str(path)


def _describe(lookup: Assets, asset: Asset) -> dict[str, Any]:
    found = lookup.locate(asset.name)
    return {
        "name": asset.name,
        "what": asset.what,
        "owner": asset.owner,
        "terms": asset.terms,
        "source": asset.source,
        "size": asset.size,
        "status": "missing" if found is None else "as measured" if found.as_measured else "differs",
        "path": None if found is None else str(found.path),
        "files": [
            {"file": file.file, "sha256": file.sha256, "size": file.size, "url": file.url} for file in asset.files
        ],
    }
