"""Stratalux: the fastest unbiased way from an environment map to a clean image, on Mitsuba 3 and Dr.Jit.

Importing the package registers its Mitsuba plugins; Mitsuba itself is imported only by what needs it.
"""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from .errors import InputError
from .integrators.plugins import register_on_import
from .maps.envmap import EnvironmentMap, EnvironmentMapWarning
from .maps.median_cut import median_cut
from .maps.regions import Regions, describe_regions, region_content

if TYPE_CHECKING:
    from .comparison.compare import Comparison, compare
    from .rendering.passes import RenderResult, render, render_passes
    from .scenes.load import load_scene

__all__ = [
    "Comparison",
    "EnvironmentMap",
    "EnvironmentMapWarning",
    "InputError",
    "Regions",
    "RenderResult",
    "compare",
    "describe_regions",
    "load_scene",
    "median_cut",
    "region_content",
    "render",
    "render_passes",
]

__version__ = version("stratalux")

_NEEDS_MITSUBA = {
    "Comparison": ".comparison.compare",
    "compare": ".comparison.compare",
    "RenderResult": ".rendering.passes",
    "render": ".rendering.passes",
    "render_passes": ".rendering.passes",
    "load_scene": ".scenes.load",
}


def __getattr__(name: str) -> Any:
    if name in _NEEDS_MITSUBA:
        from importlib import import_module

        value = globals()[name] = getattr(import_module(_NEEDS_MITSUBA[name], __name__), name)
        return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


register_on_import()
