"""Stratalux: the fastest unbiased way from an environment map to a clean image, on Mitsuba 3 and Dr.Jit.

Importing the package registers its Mitsuba plugins. Everything else, NumPy and Mitsuba included, is imported when it is
asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .integrators.plugins import register_on_import
from .lazy import lazily

if TYPE_CHECKING:
    from .comparison.compare import Comparison, compare
    from .errors import EnvironmentMapWarning, InputError
    from .images.develop import develop
    from .integrators.accelerate import accelerate
    from .maps.envmap import EnvironmentMap
    from .maps.median_cut import median_cut
    from .maps.regions import Regions, describe_regions, region_content
    from .rendering.passes import RenderResult, render, render_passes
    from .rendering.settings import PictureSettings
    from .rigs.conversion import convert_map
    from .scenes.load import load_scene

__all__ = [
    "Comparison",
    "EnvironmentMap",
    "EnvironmentMapWarning",
    "InputError",
    "PictureSettings",
    "Regions",
    "RenderResult",
    "accelerate",
    "compare",
    "convert_map",
    "describe_regions",
    "develop",
    "load_scene",
    "median_cut",
    "region_content",
    "render",
    "render_passes",
]

_PLACES = {
    "Comparison": ".comparison.compare",
    "accelerate": ".integrators.accelerate",
    "compare": ".comparison.compare",
    "convert_map": ".rigs.conversion",
    "EnvironmentMap": ".maps.envmap",
    "EnvironmentMapWarning": ".errors",
    "InputError": ".errors",
    "PictureSettings": ".rendering.settings",
    "Regions": ".maps.regions",
    "RenderResult": ".rendering.passes",
    "describe_regions": ".maps.regions",
    "develop": ".images.develop",
    "load_scene": ".scenes.load",
    "median_cut": ".maps.median_cut",
    "region_content": ".maps.regions",
    "render": ".rendering.passes",
    "render_passes": ".rendering.passes",
}


_lazy = lazily(__name__, _PLACES)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("stratalux")
    return _lazy(name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})


register_on_import()
