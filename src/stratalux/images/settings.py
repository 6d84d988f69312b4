"""What leaves: how an image becomes a picture."""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import Settings, option

MOST_STOPS = 100.0


@dataclass(frozen=True)
class OutputSettings(Settings):
    """How an image becomes a picture of 8 bits (.png, .jpg); other formats keep it as it is."""

    exposure: float | None = option(
        None,
        "Exposure of a PNG or JPEG in stops.",
        "--exposure",
        minimum=-MOST_STOPS,
        maximum=MOST_STOPS,
        default_text="automatic",
    )
