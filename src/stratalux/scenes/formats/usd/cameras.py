"""The cameras of a stage."""

from __future__ import annotations

import math

from pxr import Usd, UsdGeom

from ...model import Camera, Floats
from .notes import Notes

_TENTHS = 0.1
"""Focal lengths and apertures of the film are in tenths of the scene's unit."""


def camera(prim: Usd.Prim, matrix: Floats, time: Usd.TimeCode, notes: Notes) -> Camera | None:
    """The camera of a prim, or None where its numbers are those of none."""
    schema = UsdGeom.Camera(prim)
    focal = _TENTHS * float(schema.GetFocalLengthAttr().Get(time))
    width = _TENTHS * float(schema.GetHorizontalApertureAttr().Get(time))
    height = _TENTHS * float(schema.GetVerticalApertureAttr().Get(time))
    stop, focus = float(schema.GetFStopAttr().Get(time)), float(schema.GetFocusDistanceAttr().Get(time))
    if not (width > 0 and height > 0 and focal > 0 and math.isfinite(width + height + focal)):
        notes.add("cameras without a film or a focal length are left out", prim.GetPath())
        return None
    if schema.GetHorizontalApertureOffsetAttr().Get(time) or schema.GetVerticalApertureOffsetAttr().Get(time):
        notes.add("offsets of the film are not shown", prim.GetPath())
    is_flat = schema.GetProjectionAttr().Get(time) == UsdGeom.Tokens.orthographic
    return Camera(
        matrix,
        prim.GetName(),
        fov=2 * math.atan(height / (2 * focal)),
        height=height if is_flat else None,
        aspect=width / height,
        aperture=focal / (2 * stop) if stop > 0 and focus > 0 and not is_flat else 0.0,
        focus=focus if focus > 0 else None,
    )
