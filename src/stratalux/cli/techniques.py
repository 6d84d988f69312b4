"""``stratalux techniques``."""

from __future__ import annotations

import sys

import click
from rich.console import Console
from rich.table import Table


@click.command()
def techniques() -> None:
    """List the techniques that can be rendered and compared by name.

    \b
    Examples:
      stratalux techniques
      stratalux render demo --technique importance:samples=32,sequence=sobol -o demo.png
    """
    from ..integrators.techniques import techniques as all_techniques
    from ..rendering.variants import choose_variant

    choose_variant()
    table = Table("name", "biased", "what", "source", "properties (default)", box=None, pad_edge=False)
    for technique in all_techniques().values():
        properties = ", ".join(f"{name} ({_text(p.default)})" for name, p in technique.properties.items())
        biased = "no" if technique.unbiased else "yes"
        table.add_row(technique.name, biased, technique.summary, technique.source, properties)
    wide = None if sys.stdout.isatty() else 220  # a pipe gets one line for each
    Console(width=wide).print(table)


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
