"""Textures of our own, whose values are numbers from 0 to 1."""

from __future__ import annotations

from functools import cache
from typing import Any

import mitsuba as mi


@cache
def number_texture(variant: str) -> Any:
    """The base class for a variant, whose own texture it derives from; one of its own has `eval_1`."""

    class Numbers(mi.Texture):
        def __init__(self) -> None:
            super().__init__(mi.Properties())

        def eval(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Spectrum:
            return mi.Spectrum(self.eval_1(si, active))

        def mean(self) -> mi.Float:
            return mi.Float(0.5)

        def max(self) -> float:
            return 1.0

        def is_spatially_varying(self) -> bool:
            return True

        def traverse(self, callback: Any) -> None:
            pass

        def to_string(self) -> str:
            return f"{type(self).__name__}[]"

    return Numbers
