"""How maps are read, and what becomes of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..settings import Settings, option

LAYOUT_NAMES = (
    "latlong",
    "cross",
    "vertical-cross",
    "strip",
    "vertical-strip",
    "faces",
    "openexr-cube",
    "octahedral",
    "equal-area",
    "angular",
    "mirror-ball",
)
"""Those of :data:`.layouts.LAYOUTS`, which this need not import."""

HARMONICS = "sh"


def layout_option() -> Any:
    """A field of settings: how a map lies in its file."""
    return option(
        "auto",
        f"How the map lies in its file: auto, which is what its header or its name say, or {', '.join(LAYOUT_NAMES)}.",
        "--env-layout",
        choices=("auto", *LAYOUT_NAMES),
        metavar="LAYOUT",
    )


LARGEST_HEIGHT = 1 << 15


@dataclass(frozen=True)
class LayoutSettings(Settings):
    """How a map lies in its file."""

    env_layout: str = layout_option()


@dataclass(frozen=True)
class MapSettings(Settings):
    """A map for another tool."""

    source: str = option(..., "A map.", argument=True, metavar="MAP")
    to: str = option(
        "latlong",
        f"What the map becomes: {', '.join(LAYOUT_NAMES)}; or sh, nine coefficients of spherical harmonics, as .json "
        "or .glsl.",
        "--to",
        choices=(*LAYOUT_NAMES, HARMONICS),
        metavar="LAYOUT",
    )
    size: int | None = option(
        None,
        "Rows of the image, or of a face of a cube.",
        "--size",
        minimum=1,
        maximum=LARGEST_HEIGHT,
        metavar="N",
        default_text="as fine as the map is",
    )
    remove_sun: bool = option(False, "Leave the sun out; --light writes it.", "--remove-sun")
    irradiance: bool = option(
        False,
        "The light on a matte surface that faces each direction, over π, in place of the radiance.",
        "--irradiance",
    )
    env_layout: str = layout_option()
