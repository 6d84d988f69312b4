"""USD: .usd, .usda, .usdc and .usdz, by Pixar's own library.

Source: "OpenUSD", openusd.org: the schemas UsdGeom, UsdShade, UsdLux and UsdSkel, and the "UsdPreviewSurface
Specification".
"""

from __future__ import annotations

from pathlib import Path

from ....errors import InputError
from ...model import Model


def read(path: Path) -> Model:
    """All surfaces, lights and cameras of a stage, as it is at its first moment.

    Surfaces that are subdivided are shown as their cages. Raises InputError without the package that reads them.
    """
    try:
        import pxr  # noqa: F401
    except ImportError:
        raise InputError(f"{path}: USD needs another package: pip install 'stratalux[usd]'") from None
    from .stage import read_stage

    return read_stage(path)
