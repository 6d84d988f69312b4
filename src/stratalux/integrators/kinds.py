"""What a BSDF is made of (Mitsuba)."""

from __future__ import annotations

from collections.abc import Collection

import mitsuba as mi


def made_of(bsdf: mi.BSDF | None, kinds: Collection[str]) -> bool:
    """Whether it is of one of these classes, as it is or, if two-sided, on both sides."""
    if bsdf is None:
        return False
    if bsdf.class_name() == "TwoSidedBRDF":
        sides = [line for line in str(bsdf).splitlines() if line.startswith("  brdf[")]
        return bool(sides) and all(side.partition(" = ")[2].partition("[")[0] in kinds for side in sides)
    return bsdf.class_name() in kinds
