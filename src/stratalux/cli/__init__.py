"""The command line: one file a command, each of which parses, calls the library, and prints."""

from __future__ import annotations

import os
import sys
import traceback
import warnings
from contextlib import suppress
from importlib import import_module

import click

from ..errors import CacheWarning, EnvironmentMapWarning, ImageWarning, InputError, RigWarning, SceneWarning

COMMANDS = {
    "render": "Render a scene, a mesh or the demo.",
    "merge": "Join images of different seeds.",
    "develop": "Make pictures of images that are there.",
    "settings": "Print the command that makes an image again.",
    "compare": "Compare techniques at equal rays and at equal time.",
    "reproduce": "Compute the paper's figures and numbers again.",
    "bench": "Measure against the best of Mitsuba's own.",
    "stratify": "Cut a map into regions of equal energy.",
    "rig": "Turn a map into directional lights.",
    "map": "Convert a map for another tool.",
    "techniques": "List the techniques.",
    "assets": "List and fetch the maps and meshes of the paper.",
    "doctor": "Say what works on this machine.",
    "completion": "Print the completion script of a shell.",
}
"""A command is one file of this folder, which has a function of the same name, and a line here, which help shows."""


class Commands(click.Group):
    """Imports a command only when it is asked for: help is there at once."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = getattr(import_module(f".{cmd_name}", __name__), cmd_name)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(
    cls=Commands,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(package_name="stratalux")
@click.option("--debug", is_flag=True, help="Show the traceback of an error that is ours.")
@click.pass_context
def cli(ctx: click.Context, debug: bool) -> None:
    """Light scenes with environment maps: fast, unbiased, stratified.

    \b
    Examples:
      stratalux render demo -o demo.png
      stratalux render buddha.ply --env venice.hdr --material gold -o buddha.exr
      stratalux render scene.xml --spp 128 -o scene.exr
      stratalux merge one.exr two.exr -o both.exr
      stratalux develop scene.exr --view agx -o scene.png
      stratalux settings scene.exr
      stratalux compare demo --technique stratified --technique direct --rays 16,64
      stratalux reproduce --quick
      stratalux bench
      stratalux stratify venice.hdr -n 64 -o regions.png
      stratalux rig venice.hdr --method kmeans -n 32 -o rig.json
      stratalux map venice.hdr --to cross -o cross.exr
      stratalux techniques
      stratalux assets fetch
      stratalux doctor
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


def main() -> None:
    """Run the command line: errors take one line on stderr; bad input exits with 2, an error of ours with 1."""
    warnings.showwarning = _show_warning
    _open_streams()
    try:
        code = cli.main(standalone_mode=False, prog_name="stratalux")
        _drain()
        sys.exit(code)
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
    except OSError as error:  # of a file of the user's: a full disk, no permission
        _debug()
        with suppress(OSError):
            _drain()
        what = error.filename if error.filename is not None else "standard output, or another file"
        _fail(f"{os.fsdecode(what) if isinstance(what, bytes) else what}: {error.strerror or error}")
    except Exception as error:
        _debug()
        said = " ".join(f"{type(error).__name__}: {error}".split())
        print(
            f"stratalux: error: {said}; this is ours: please report it, with what stratalux --debug ... prints",
            file=sys.stderr,
        )
        sys.exit(1)


def _open_streams() -> None:
    """Streams that are closed would be the next files that are opened, and what a stream cannot show would end us."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        with suppress(OSError):
            os.fstat(number)
            continue
        os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free: this one
        setattr(sys, name, os.fdopen(number, mode, closefd=False))
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _drain() -> None:
    """Write what is held back, or say why not; Python would try again at its end, and fail again."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise


def _debug() -> None:
    if "--debug" in sys.argv:
        traceback.print_exc()


def _fail(message: str) -> None:
    print(f"stratalux: error: {_one_line(message)}", file=sys.stderr)
    sys.exit(2)


def _one_line(text: str) -> str:
    """Names may have line breaks, and worse."""
    return "".join(c if c.isprintable() or "\udc80" <= c <= "\udcff" else repr(c)[1:-1] for c in text)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: object = None,
    line: str | None = None,
) -> None:
    if issubclass(category, (EnvironmentMapWarning, ImageWarning, SceneWarning, CacheWarning, RigWarning)):
        print(f"stratalux: warning: {_one_line(str(message))}", file=sys.stderr)
