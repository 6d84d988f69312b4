"""USD, .usda, .usdc, .usd and .usdz: UsdLux ``DistantLight``, and the map beside it as an inactive ``DomeLight``.

With ``normalize`` the light of a distant light does not depend on its angle: intensity times colour is the irradiance
of what faces it. Y is up, and the middle of a dome's map is at +z. Source: OpenUSD, "UsdLux", "Quantifying Light
Emission".
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, RigWarning
from ..lights import Lights, quaternion_towards, split
from .beside import ambient_file

_IN_A_PACKAGE = (".exr", ".png", ".jpg", ".jpeg")
"""Images that a .usdz may have."""


def encode(lights: Lights, path: Path) -> bytes:
    """Raises :class:`InputError` without the package that writes it."""
    if importlib.util.find_spec("pxr") is None:
        raise InputError(f"{path}: USD needs another package: pip install 'stratalux[usd]'")
    with tempfile.TemporaryDirectory(prefix="stratalux-") as folder:
        if path.suffix.lower() == ".usdz":
            return _package(lights, path, Path(folder))
        file = Path(folder) / f"rig{path.suffix.lower()}"
        chart = lights.map and Path(os.path.relpath(lights.map, path.parent)).as_posix()
        ambient = ambient_file(lights, path).name if lights.varies else None
        _write_stage(lights, file, chart, ambient)
        return file.read_bytes()


def _package(lights: Lights, path: Path, folder: Path) -> bytes:
    from pxr import Sdf, UsdUtils

    chart = None
    if lights.map is not None:
        there = Path(lights.map)
        if there.suffix.lower() in _IN_A_PACKAGE and there.is_file():
            chart = f"map{there.suffix.lower()}"
            shutil.copyfile(there, folder / chart)
        else:
            warnings.warn(
                f"{path}: a .usdz has no room for {there.name}, so the map is left out; convert it to .exr",
                RigWarning,
                stacklevel=2,
            )
    stage, package = folder / "rig.usdc", folder / "package.usdz"
    ambient = ambient_file(lights, stage).name if lights.varies else None
    _write_stage(lights, stage, chart, ambient)
    if not UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(stage)), str(package)):
        raise InputError(f"{path}: usd-core could not make the package; write a .usda")
    return package.read_bytes()


def _write_stage(lights: Lights, path: Path, chart: str | None, ambient: str | None) -> None:
    from pxr import Usd, UsdGeom, UsdLux

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    rig = UsdGeom.Xform.Define(stage, "/rig")
    stage.SetDefaultPrim(rig.GetPrim())
    for name, direction, colour, angle in lights.named():
        light = UsdLux.DistantLight.Define(stage, f"/rig/{name}")
        _shine(light, colour)
        light.CreateAngleAttr(float(np.degrees(angle)))
        light.CreateNormalizeAttr(True)
        _orient(light, quaternion_towards(direction))
    if lights.ambient is not None:
        dome = UsdLux.DomeLight.Define(stage, "/rig/ambient")
        if ambient is None:
            _shine(dome, lights.ambient_radiance)
        else:
            dome.CreateTextureFileAttr(f"./{ambient}")
            dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    if chart is not None:
        dome = UsdLux.DomeLight.Define(stage, "/rig/map")
        dome.CreateTextureFileAttr(chart if chart.startswith("../") else f"./{chart}")
        dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
        if lights.turned:
            UsdGeom.Xformable(dome).AddRotateYOp().Set(lights.turned)
        dome.GetPrim().SetActive(False)
    stage.Save()


def _shine(light: Any, colour: np.ndarray) -> None:
    tint, strength = split(colour)
    light.CreateColorAttr(tuple(tint))
    light.CreateIntensityAttr(strength)


def _orient(light: Any, quaternion: list[float]) -> None:
    from pxr import Gf, UsdGeom

    x, y, z, w = quaternion
    UsdGeom.Xformable(light).AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, Gf.Vec3d(x, y, z)))
