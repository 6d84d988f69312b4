"""What a rig is made of, and how."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import InputError
from ..maps.frames import ENV_FRAMES
from ..maps.settings import layout_option
from ..settings import Settings, option

MOST_LIGHTS = 1 << 20
AMBIENTS = ("none", "constant", "sh2")
METHODS = ("median-cut", "structured", "kmeans", "lloyd", "penrose", "fitted")
"""Those of :data:`.RIGS`, which this need not import, and the one that is fitted."""


@dataclass(frozen=True)
class RigSettings(Settings):
    """Lights of a map, or those of a rig that is there."""

    source: str = option(..., "A map, or the JSON of a rig.", argument=True, metavar="MAP|RIG.json")
    method: str = option("median-cut", "Technique.", "--method", choices=METHODS)
    lights: int = option(64, "Lights.", "-n", "-N", "--lights", minimum=1, maximum=MOST_LIGHTS, metavar="N")
    ambient: str | None = option(
        None,
        "Light from everywhere beside the lights of --method fitted or --sun: none, constant, or sh2, which has nine "
        "coefficients of spherical harmonics.",
        "--ambient",
        choices=AMBIENTS,
        metavar="KIND",
        default_text="none; sh2 with --sun",
    )
    sun: bool = option(
        False, "One light for the sun, with its angle and colour as the map has them; the rest is ambient.", "--sun"
    )
    env_frame: str | None = option(
        None,
        f"The tool whose map the lights stand with: {', '.join(ENV_FRAMES)}.",
        "--env-frame",
        choices=tuple(ENV_FRAMES),
        metavar="TOOL",
        default_text="that of the format",
    )
    env_layout: str = layout_option()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.sun and (self.method != "median-cut" or self.lights != 64):
            raise InputError("--sun: is one light, by a technique of its own; leave --method and -n out")
        if self.ambient is not None and not self.sun and self.method != "fitted":
            raise InputError(f"--ambient: goes with --method fitted or --sun, not with '{self.method}'; leave it out")
