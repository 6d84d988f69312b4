"""Stratalux: the fastest unbiased way from an environment map to a clean image, on Mitsuba 3 and Dr.Jit."""

from .envmap import EnvironmentMap, EnvironmentMapWarning
from .errors import InputError
from .median_cut import median_cut
from .plugins import register_on_import
from .regions import Regions, region_content

__all__ = ["EnvironmentMap", "EnvironmentMapWarning", "InputError", "Regions", "median_cut", "region_content"]

register_on_import()
