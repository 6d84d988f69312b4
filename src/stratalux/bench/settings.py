"""What the benchmark measures, and where it finds and leaves things."""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import Settings, option


@dataclass(frozen=True)
class BenchSettings(Settings):
    """What the benchmark measures, and where it finds and leaves things."""

    suite: str = option(
        "quick",
        "quick: five cases, minutes; full: 100 cases, an hour; light: the whole light, ten cases; light-full: 49.",
        "--suite",
        choices=("quick", "full", "light", "light-full"),
    )
    folder: str | None = option(
        None, "Folder of the results.", "-o", "--output", metavar="FOLDER", default_text="bench-SUITE"
    )
    assets: str | None = option(None, "Look there first for maps and meshes.", "--assets", metavar="DIR")
    peers: bool = option(False, "Measure Cycles and LuxCore in the same scene too: stratalux[peers].", "--peers")
    peers_python: str | None = option(
        None,
        "Interpreter that has their packages; asks for --peers.",
        "--peers-python",
        metavar="PYTHON",
        default_text="this one",
    )
