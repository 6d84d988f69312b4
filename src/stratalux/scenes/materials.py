"""The materials that `render` can put on a mesh, as Mitsuba BSDF dictionaries."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from ..errors import InputError


@dataclass(frozen=True)
class Material:
    """A named look: one line of text, and the BSDF dictionary that `mi.load_dict` understands."""

    description: str
    bsdf: dict[str, Any]


def _two_sided(bsdf: dict[str, Any]) -> dict[str, Any]:
    """The BSDF on both sides: meshes with flipped windings exist, and would be black otherwise."""
    return {"type": "twosided", "bsdf": bsdf}


def _metal(metal: str, alpha: float) -> dict[str, Any]:
    """A rough conductor: GGX of roughness `alpha` over Mitsuba's measured data for `metal`."""
    return _two_sided({"type": "roughconductor", "distribution": "ggx", "alpha": alpha, "material": metal})


def _colour(red: float, green: float, blue: float) -> dict[str, Any]:
    """A reflectance given in linear sRGB."""
    return {"type": "rgb", "value": [red, green, blue]}


_MATTE = {"type": "diffuse", "reflectance": _colour(0.5, 0.5, 0.5)}

MATERIALS: dict[str, Material] = {
    "clay": Material("matte grey, reflectance 0.5, for what has no look", _two_sided(_MATTE)),
    "diffuse": Material(
        "matte grey, reflectance 0.5",
        _two_sided(_MATTE),
    ),
    "plastic": Material(
        "rough plastic, GGX 0.14: matte colour under a soft gloss",
        _two_sided(
            {
                "type": "roughplastic",
                "distribution": "ggx",
                "alpha": 0.14,
                "nonlinear": True,
                "diffuse_reflectance": _colour(0.45, 0.12, 0.05),
            }
        ),
    ),
    "ceramic": Material(
        "white glazed ceramic: matte white under a mirror-like coat (a delta lobe)",
        _two_sided({"type": "plastic", "nonlinear": True, "diffuse_reflectance": _colour(0.75, 0.73, 0.69)}),
    ),
    "metal": Material("brushed aluminium, GGX 0.14", _metal("Al", 0.14)),
    "satin": Material("satin aluminium, GGX 0.3", _metal("Al", 0.3)),
    "polished": Material("polished aluminium, GGX 0.05", _metal("Al", 0.05)),
    "gold": Material("gold, GGX 0.14", _metal("Au", 0.14)),
    "copper": Material("copper, GGX 0.14", _metal("Cu", 0.14)),
    "mirror": Material("perfect mirror (a delta lobe)", _two_sided({"type": "conductor", "material": "none"})),
}


def material(name: str) -> dict[str, Any]:
    """A fresh copy of the BSDF dictionary of the material called `name`; InputError for an unknown name."""
    if name not in MATERIALS:
        raise InputError(f"material '{name}' is unknown; use one of {', '.join(MATERIALS)}")
    return deepcopy(MATERIALS[name].bsdf)
