"""A table: one line for the ambient light's mean, one for each light."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from ..lights import Lights

COLUMNS = ("kind", "name", "x", "y", "z", "red", "green", "blue", "angle_degrees")


def encode(lights: Lights, path: Path) -> bytes:
    """``distant``: direction towards the light, irradiance in W/m². ``ambient``: radiance in W/(m²·sr)."""
    file = io.StringIO()
    table = csv.writer(file)
    table.writerow(COLUMNS)
    for name, direction, colour, angle in lights.named():
        table.writerow(["distant", name, *direction.tolist(), *colour.tolist(), float(np.degrees(angle))])
    if lights.ambient is not None:
        table.writerow(["ambient", "ambient", "", "", "", *lights.ambient_radiance.tolist(), ""])
    return file.getvalue().encode()
