"""Radiance: ``source`` objects that shine as ``light``; z up, (x, y, z) is written as (x, −z, y).

A source is seen under an angle, its diameter in degrees, and has a radiance: the irradiance of what faces it over
π sin²(angle / 2). Lights without an angle get that of the sun. Source: "The RADIANCE Synthetic Imaging System",
reference manual, ``source``, ``light`` and ``glow``.
"""

from __future__ import annotations

import math
from pathlib import Path

from ..lights import Lights

_SUN = 0.533
"""Degrees."""


def encode(lights: Lights, path: Path) -> bytes:
    lines = [f"# {len(lights)} lights by stratalux rig ({lights.method}): z up, radiance in W/(m2 sr), Rec. 709"]
    for name, (x, y, z), colour, angle in lights.named():
        degrees = math.degrees(angle) or _SUN
        share = math.pi * math.sin(math.radians(degrees) / 2) ** 2
        lines += [
            f"\nvoid light {name}_radiance\n0\n0\n3 {_numbers(colour / share)}",
            f"\n{name}_radiance source {name}\n0\n0\n4 {_numbers((x, 0.0 - z, y))} {degrees:.9g}",
        ]
    if lights.ambient is not None:
        lines += [
            f"\nvoid glow ambient_radiance\n0\n0\n4 {_numbers(lights.ambient_radiance)} 0",
            "\nambient_radiance source ambient\n0\n0\n4 0 0 1 360",
        ]
    return ("\n".join(lines) + "\n").encode()


def _numbers(values: object) -> str:
    return " ".join(f"{value:.9g}" for value in values)  # type: ignore[attr-defined]
