"""``stratalux reproduce``."""

from __future__ import annotations

import signal
import sys
from types import FrameType
from typing import Any

import click

from ..rendering.settings import MachineSettings
from ..reproduce.request import ReproductionSettings
from .flags import flags
from .progress import console as standard_output
from .progress import share_of_work

_TABLE_WIDTH = 110
"""Where the output is no terminal."""
_SPEED_SECONDS = 300.0
"""The time left follows from what was done in so many seconds."""
_STYLES = {"holds": "green", "partly": "yellow", "fails": "red", "not tested": "dim", "figure": "dim"}


@click.command()
@flags(request=ReproductionSettings, machine=MachineSettings)
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def reproduce(request: ReproductionSettings, machine: MachineSettings, quiet: bool) -> None:
    """Compute the paper's figures and numbers again, on its own data, and say which of its claims hold here.

    An interrupted run goes on where it stopped when the same command is given again. The folder gets a report
    (report.html), all images (.exr, .png), claims.json and results.json.

    \b
    Examples:
      stratalux reproduce --quick
      stratalux reproduce fig2 fig5 -o figures
      stratalux reproduce all -o reproduction --assets ~/grace
    """
    from ..rendering.passes import activate  # Mitsuba is imported here, not before --help
    from ..reproduce.run import check_folder, item_names, run_reproduction

    item_names(request.items)
    check_folder(request.folder)
    machine = activate(machine)
    # An exception that Dr.Jit meets while it traces comes out as another one: the signal itself has to be remembered.
    interrupted: list[int] = []
    before = signal.getsignal(signal.SIGINT)

    def interrupt(number: int, frame: FrameType | None) -> None:
        interrupted.append(number)
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    bar, tell = share_of_work("reproducing", quiet=quiet, speed_estimate_period=_SPEED_SECONDS)
    try:
        with bar:
            report = run_reproduction(request, progress=tell, cluster=machine.cluster)
    except BaseException:
        if not interrupted:
            raise
        print("stratalux: interrupted; the same command resumes", file=sys.stderr)
        sys.exit(130)
    finally:
        signal.signal(signal.SIGINT, before)
    for note in report.notes:
        print(f"stratalux: note: {note}", file=sys.stderr)
    if not quiet:
        _print(report, request.folder)


def _print(report: Any, folder: str) -> None:
    from rich.markup import escape
    from rich.table import Table

    console = standard_output(_TABLE_WIDTH)
    for section in report.sections:
        table = Table(title=section.title, title_justify="left", title_style="bold")
        table.add_column("claim", ratio=3)
        table.add_column("paper", ratio=2)
        table.add_column("here", ratio=4)
        table.add_column("", no_wrap=True)
        for claim in section.claims:
            texts = (escape(text) for text in (claim.text, claim.theirs, claim.ours))
            table.add_row(*texts, f"[{_STYLES[claim.verdict]}]{claim.verdict}[/]")
        console.print(table)
    console.print(report.summary[0])
    console.print(f"wrote {folder}")
