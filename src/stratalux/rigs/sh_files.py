"""The light of a map as nine coefficients of spherical harmonics: as JSON, and as a function of GLSL."""

from __future__ import annotations

import json

import numpy as np
from numpy.typing import NDArray

from .formats.own import FRAME
from .harmonics import COSINE
from .lights import plain

_Float = NDArray[np.float64]

FORMAT, VERSION = "stratalux spherical harmonics", 1
SUFFIXES = (".json", ".glsl")
_ORDER = ("Y00", "Y1-1", "Y10", "Y11", "Y2-2", "Y2-1", "Y20", "Y21", "Y22")
_BASIS = (
    "0.282095",
    "0.488603 * y",
    "0.488603 * z",
    "0.488603 * x",
    "1.092548 * x * y",
    "1.092548 * y * z",
    "0.315392 * (3 * z * z - 1)",
    "1.092548 * x * z",
    "0.546274 * (x * x - y * y)",
)


def encode(coefficients: _Float, suffix: str, source: str) -> str:
    """``coefficients`` (9, 3) of radiance, those of :mod:`.harmonics`, as the text of a file with the ``suffix``."""
    return _json(coefficients, source) if suffix == ".json" else _glsl(coefficients, source)


def _json(coefficients: _Float, source: str) -> str:
    content = {
        "format": FORMAT,
        "version": VERSION,
        "map": source,
        "frame": {name: value for name, value in FRAME.items() if name != "direction"},
        "unit": "radiance of the map, W/(m2 sr); irradiance in W/m2; linear, Rec. 709",
        "harmonics": dict(zip(_ORDER, _BASIS, strict=True)),
        "convention": "real, orthonormal, without signs of Condon and Shortley; a value is the sum of coefficients "
        "times harmonics of a unit vector (x, y, z)",
        "radiance": plain(coefficients),
        "irradiance": plain(COSINE[:, None] * coefficients),
    }
    return json.dumps(content, indent=1) + "\n"


def _glsl(coefficients: _Float, source: str) -> str:
    # With their constants: what is left is a polynomial of the normal.
    constants = np.sqrt(np.array([1, 3, 3, 3, 15, 15, 5 / 4, 15, 15 / 4]) / (4 * np.pi))
    rows = ",\n".join(
        "    vec3(" + ", ".join(f"{value:.9g}" if value % 1 else f"{value:.1f}" for value in row) + ")"
        for row in (COSINE * constants)[:, None] * coefficients
    )
    name = "".join(c if c.isprintable() else "?" for c in source)
    return f"""// Irradiance under the map {name}, from nine spherical harmonics (Ramamoorthi and Hanrahan 2001).
// Frame: right-handed, y up, the middle of the map at +z and the quarter to the right of it at -x.
// Unit: W/m2, for radiance of the map in W/(m2 sr); linear, Rec. 709. A matte surface reflects albedo / pi of it.
const vec3 irradianceCoefficients[9] = vec3[9](
{rows}
);

vec3 irradiance(vec3 n) {{
    return max(
        irradianceCoefficients[0]
            + irradianceCoefficients[1] * n.y + irradianceCoefficients[2] * n.z + irradianceCoefficients[3] * n.x
            + irradianceCoefficients[4] * n.x * n.y + irradianceCoefficients[5] * n.y * n.z
            + irradianceCoefficients[6] * (3.0 * n.z * n.z - 1.0) + irradianceCoefficients[7] * n.x * n.z
            + irradianceCoefficients[8] * (n.x * n.x - n.y * n.y),
        0.0);
}}
"""
