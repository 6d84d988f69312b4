"""The lights of a stage, from UsdLux to radiance, intensity and irradiance.

Source: OpenUSD, "UsdLux", with "Quantifying Light Emission": an intensity is a luminance, and is taken for a radiance;
with `normalize` it is divided by the area in the scene, or by the share of the sky that a distant light has.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdLux

from ...model import Colour, Floats, Light
from .assets import Assets
from .notes import Notes

_HALF_TURN = np.diag([-1.0, 1.0, -1.0, 1.0])
"""The middle of a map is along z in USD, as in OpenEXR's "Latitude-Longitude Map", and along -z in a model."""
_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""A quarter turn around x, as Hydra makes it of a pole along z."""


def light(prim: Usd.Prim, matrix: Floats, time: Usd.TimeCode, assets: Assets, notes: Notes) -> Light | None:
    """The light of a prim, or None where it is of a kind that is not shown."""
    name, common = prim.GetName(), UsdLux.LightAPI(prim)
    colour = _colour(common, time)
    found = Light("point", matrix, colour, name)
    normalised = bool(common.GetNormalizeAttr().Get(time))
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    area_scale = float(np.linalg.norm(np.cross(matrix[:3, 0], matrix[:3, 1])))
    if prim.IsA(UsdLux.DistantLight):
        angle = math.radians(max(_get(UsdLux.DistantLight(prim).GetAngleAttr(), time), 0.0))
        share = math.pi * math.sin(min(angle, math.pi) / 2) ** 2
        factor = share if share and not normalised else 1.0
        found = replace(found, kind="distant", angle=angle, colour=_times(colour, factor))
    elif prim.IsA(UsdLux.RectLight):
        rect = UsdLux.RectLight(prim)
        size = (_get(rect.GetWidthAttr(), time), _get(rect.GetHeightAttr(), time))
        area = size[0] * size[1] * area_scale
        found = replace(found, kind="rectangle", size=size, colour=_over(colour, area, normalised))
        if _path(rect.GetTextureFileAttr(), time):
            notes.add("the textures of lights are not shown", prim.GetPath())
    elif prim.IsA(UsdLux.DiskLight):
        radius = _get(UsdLux.DiskLight(prim).GetRadiusAttr(), time)
        area = math.pi * radius**2 * area_scale
        found = replace(found, kind="disk", size=(2 * radius, 2 * radius), colour=_over(colour, area, normalised))
    elif prim.IsA(UsdLux.SphereLight):
        found = _sphere(UsdLux.SphereLight(prim), found, float(np.prod(lengths) ** (1 / 3)), normalised, time)
    elif prim.IsA(UsdLux.DomeLight) or prim.IsA(UsdLux.DomeLight_1):
        return _dome(prim, found, time, assets, notes)
    else:
        notes.add(f"lights of the type {prim.GetTypeName()} are not shown", prim.GetPath())
        return None
    return _shaped(prim, found, time, notes)


def _sphere(sphere: UsdLux.SphereLight, found: Light, scale: float, normalised: bool, time: Usd.TimeCode) -> Light:
    """A sphere, or a point that shines as it does."""
    radius = _get(sphere.GetRadiusAttr(), time)
    disk = math.pi * (radius * scale) ** 2
    if sphere.GetTreatAsPointAttr().Get(time) or radius <= 0:
        # From afar one sees a disk, whose area is a quarter of that of the sphere.
        return replace(found, colour=_times(found.colour, 0.25 if normalised else disk))
    colour = _over(found.colour, 4 * disk, normalised)
    return replace(found, kind="sphere", size=(2 * radius, 2 * radius), colour=colour)


def _dome(prim: Usd.Prim, found: Light, time: Usd.TimeCode, assets: Assets, notes: Notes) -> Light:
    """A map. Its pole is along y; that of the newer schema may be that of the scene."""
    turn = np.eye(4)
    if prim.IsA(UsdLux.DomeLight_1):
        pole = str(UsdLux.DomeLight_1(prim).GetPoleAxisAttr().Get(time))
        up = str(UsdGeom.GetStageUpAxis(prim.GetStage())) if pole == "scene" else pole
        turn = _Z_UP if up == "Z" else np.eye(4)
        dome: Any = UsdLux.DomeLight_1(prim)
    else:
        dome = UsdLux.DomeLight(prim)
    found = replace(found, kind="dome", matrix=found.matrix @ turn @ _HALF_TURN)
    asset = dome.GetTextureFileAttr().Get(time)
    if not _path(dome.GetTextureFileAttr(), time):
        return found
    form = str(dome.GetTextureFormatAttr().Get(time))
    if form not in ("automatic", "latlong"):
        notes.add(f"maps of the format {form!r} are not shown, but their light in one colour", prim.GetPath())
        return found
    picture = assets.picture(asset)
    if picture is None:
        notes.add("the map of a light is not there, which is shown in one colour", asset.path)
    return replace(found, picture=picture)


def _shaped(prim: Usd.Prim, found: Light, time: Usd.TimeCode, notes: Notes) -> Light:
    """A point whose light is kept in a cone is a spot."""
    shaping = UsdLux.ShapingAPI(prim)
    if not prim.HasAPI(UsdLux.ShapingAPI):
        return found
    cone = math.radians(_get(shaping.GetShapingConeAngleAttr(), time))
    narrow = cone < math.pi / 2 - 1e-6
    if found.kind == "point" and narrow:
        softness = min(max(_get(shaping.GetShapingConeSoftnessAttr(), time), 0.0), 1.0)
        found = replace(found, kind="spot", cone=(cone * (1 - softness), cone))
    elif narrow:
        notes.add("the cones of lights that are no points are not shown", prim.GetPath())
    if _path(shaping.GetShapingIesFileAttr(), time) or shaping.GetShapingFocusAttr().Get(time):
        notes.add("the focus and the IES profiles of lights are not shown", prim.GetPath())
    return found


def _colour(common: UsdLux.LightAPI, time: Usd.TimeCode) -> Colour:
    """intensity 2^exposure colour, with that of a black body of the light's temperature where it is switched on."""
    strength = _get(common.GetIntensityAttr(), time) * 2 ** _get(common.GetExposureAttr(), time)
    colour = np.array(common.GetColorAttr().Get(time), dtype=np.float64) * strength
    if common.GetEnableColorTemperatureAttr().Get(time):
        colour = colour * np.array(UsdLux.BlackbodyTemperatureAsRgb(_get(common.GetColorTemperatureAttr(), time)))
    r, g, b = np.maximum(colour, 0).tolist()
    return r, g, b


def _times(colour: Colour, factor: float) -> Colour:
    return colour[0] * factor, colour[1] * factor, colour[2] * factor


def _over(colour: Colour, area: float, normalised: bool) -> Colour:
    return _times(colour, 1 / area) if normalised and area > 0 else colour


def _get(attribute: Usd.Attribute, time: Usd.TimeCode) -> float:
    return float(attribute.Get(time) or 0.0)


def _path(attribute: Usd.Attribute, time: Usd.TimeCode) -> str:
    asset = attribute.Get(time)
    return str(asset.path) if asset else ""
