"""The command line: one file a command, each of which parses, calls the library, and prints."""

from __future__ import annotations

import sys
import warnings

import click

from ..errors import CacheWarning, InputError, SceneWarning
from ..maps.envmap import EnvironmentMapWarning
from . import assets, bench, compare, completion, doctor, render, reproduce, rig, stratify, techniques


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="stratalux")
def cli() -> None:
    """Light scenes with environment maps: fast, unbiased, stratified.

    \b
    Examples:
      stratalux render demo -o demo.png
      stratalux render buddha.ply --env venice.hdr --material gold -o buddha.exr
      stratalux render scene.xml --spp 128 -o scene.exr
      stratalux compare demo --technique stratified --technique direct --rays 16,64
      stratalux reproduce --quick
      stratalux bench
      stratalux stratify venice.hdr -n 64 -o regions.png
      stratalux rig venice.hdr --method kmeans -n 32 -o rig.json
      stratalux techniques
      stratalux assets fetch
      stratalux doctor
    """


for command in (
    render.render,
    compare.compare,
    reproduce.reproduce,
    bench.bench,
    stratify.stratify,
    rig.rig,
    techniques.techniques,
    assets.assets,
    doctor.doctor,
    completion.completion,
):
    cli.add_command(command)


def main() -> None:
    """Run the command line: errors take one line on stderr, and bad input exits with 2."""
    warnings.showwarning = _show_warning
    try:
        sys.exit(cli.main(standalone_mode=False, prog_name="stratalux"))
    except click.ClickException as error:
        _fail(" ".join(error.format_message().split()))
    except InputError as error:
        _fail(str(error))
    except (click.Abort, KeyboardInterrupt):
        print("stratalux: interrupted", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(141)


def _fail(message: str) -> None:
    print(f"stratalux: error: {message}", file=sys.stderr)
    sys.exit(2)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: object = None,
    line: str | None = None,
) -> None:
    if issubclass(category, (EnvironmentMapWarning, CacheWarning, SceneWarning)):
        print(f"stratalux: warning: {message}", file=sys.stderr)
