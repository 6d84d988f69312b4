"""``stratalux reproduce``."""

from __future__ import annotations

import signal
import sys
from types import FrameType
from typing import Any

import click
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

_TABLE_WIDTH = 110
"""Where the output is no terminal."""
_SPEED_SECONDS = 300.0
"""The time left follows from what was done in so many seconds."""
_STYLES = {"holds": "green", "partly": "yellow", "fails": "red", "not tested": "dim"}


@click.command()
@click.argument("items", nargs=-1, metavar="[fig1 fig2 fig3 fig4 fig5 timings | all]")
@click.option("--quick", is_flag=True, help="Small images and few samples: two minutes in place of most of an hour.")
@click.option("-o", "--output", default="reproduction", show_default=True, help="Folder to write.")
@click.option("--assets", metavar="DIR", help="Folder of the paper's map and meshes.  [default: $STRATALUX_ASSETS]")
@click.option("--force", is_flag=True, help="Compute everything anew, in place of going on with a former run.")
@click.option("-m", "--variant", help="Mitsuba variant.  [default: cuda_ad_rgb where it works, else llvm_ad_rgb]")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def reproduce(items: tuple[str, ...], **options: Any) -> None:
    """Compute the paper's figures and numbers again, on its own data, and say which of its claims hold here.

    An interrupted run goes on where it stopped when the same command is given again. The folder gets a report
    (report.html), all images (.exr, .png), claims.json and results.json.

    \b
    Examples:
      stratalux reproduce --quick
      stratalux reproduce fig2 fig5 -o figures
      stratalux reproduce all -o reproduction --assets ~/grace
    """
    from ..rendering.variants import choose_variant
    from ..reproduce.run import check_folder, item_names  # Mitsuba is imported here, not before --help
    from ..reproduce.run import reproduce as run_reproduction

    item_names(items)
    check_folder(options["output"])
    choose_variant(options["variant"])
    quiet = options["quiet"]
    columns = (
        TextColumn("reproducing"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    # An exception that Dr.Jit meets while it traces comes out as another one: the signal itself has to be remembered.
    interrupted: list[int] = []
    before = signal.getsignal(signal.SIGINT)

    def interrupt(number: int, frame: FrameType | None) -> None:
        interrupted.append(number)
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    bar = Progress(
        *columns,
        console=Console(stderr=True),
        disable=quiet or not sys.stderr.isatty(),
        speed_estimate_period=_SPEED_SECONDS,
    )
    try:
        with bar:
            task = bar.add_task("", total=1.0)
            report = run_reproduction(
                items,
                options["output"],
                quick=options["quick"],
                assets=options["assets"],
                force=options["force"],
                progress=lambda done, what: bar.update(task, completed=done, description=what),
            )
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
        _print(report, options["output"])


def _print(report: Any, folder: str) -> None:
    console = Console(width=None if sys.stdout.isatty() else _TABLE_WIDTH, highlight=False)
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
