"""The ambient light as a map beside the file, for formats that have maps and no harmonics."""

from __future__ import annotations

from pathlib import Path

from ..harmonics import ambient_map
from ..lights import Lights


def ambient_file(lights: Lights, path: Path) -> Path:
    """Write ``NAME-ambient.exr`` beside ``path``; the path of it."""
    from ...images.encoding import encode_file  # not before a file is written

    assert lights.ambient is not None
    file = path.with_name(f"{path.stem}-ambient.exr")
    file.write_bytes(encode_file(".exr", ambient_map(lights.ambient), ("R", "G", "B")))
    return file
