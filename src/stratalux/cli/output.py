"""What several commands write."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click


def write_json(destination: str, content: dict[str, Any]) -> None:
    """Write ``content`` as JSON to the file ``destination``, or to standard output for ``-``."""
    from ..images.files import write_atomically  # not before --help

    text = json.dumps(content, indent=1)
    if destination == "-":
        click.echo(text)
    else:
        write_atomically(destination, lambda name: Path(name).write_text(text + "\n", encoding="utf-8"))
