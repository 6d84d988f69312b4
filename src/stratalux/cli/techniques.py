"""``stratalux techniques``."""

from __future__ import annotations

import click

from .progress import console


@click.command()
def techniques() -> None:
    """List the techniques that can be rendered and compared by name.

    \b
    Examples:
      stratalux techniques
      stratalux render demo --technique importance:samples=32,sequence=sobol -o demo.png
    """
    from rich.table import Table

    from ..integrators.techniques import techniques as all_techniques
    from ..rendering.variants import choose_variant

    choose_variant()
    table = Table("name", "biased", "what", "source", "properties (default)", box=None, pad_edge=False)
    for technique in all_techniques().values():
        properties = ", ".join(f"{name} ({_text(p.default)})" for name, p in technique.properties.items())
        biased = "no" if technique.unbiased else "yes"
        table.add_row(technique.name, biased, technique.summary, technique.source, properties)
    console(220).print(table)  # a pipe gets one line for each


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
