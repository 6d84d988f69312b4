"""Textures that Mitsuba has none of: products, other coordinates than the mesh's own, and what a threshold leaves.

They are made for the variant that is active.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from types import SimpleNamespace
from typing import Any

import drjit as dr
import mitsuba as mi

from .model import Wrap


def product(parts: Sequence[Any]) -> Any:
    """The product of textures."""
    return _kinds(mi.variant()).Product(parts)


def elsewhere(texture: Any, attribute: str | None, wrap: tuple[Wrap, Wrap] | None, size: tuple[int, int]) -> Any:
    """A texture at the coordinates that a mesh's `attribute` has (u, v, 0), or its own where there is None.

    `wrap`: for a texture of `size` (width, height) that repeats itself, what is to be beyond its edges instead.
    """
    return _kinds(mi.variant()).Elsewhere(texture, attribute, wrap, size)


def at_least(texture: Any, threshold: float) -> Any:
    """1 where a texture reaches the `threshold`, else 0."""
    return _kinds(mi.variant()).AtLeast(texture, threshold)


@cache
def _kinds(variant: str) -> SimpleNamespace:
    """The classes for a variant, whose own texture class they derive from."""

    class Derived(mi.Texture):
        """A texture whose values are made from those of others at the same place."""

        def __init__(self, parts: Sequence[Any]) -> None:
            super().__init__(mi.Properties())
            self.parts = list(parts)

        def of(self, values: list[Any]) -> Any:
            """From a value of each part."""
            raise NotImplementedError

        def at(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.SurfaceInteraction3f:
            """Where the parts are looked up."""
            return si

        def eval(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Spectrum:
            place = self.at(si, active)
            return self.of([part.eval(place, active) for part in self.parts])

        def eval_1(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Float:
            place = self.at(si, active)
            return self.of([part.eval_1(place, active) for part in self.parts])

        def eval_3(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Color3f:
            place = self.at(si, active)
            return self.of([part.eval_3(place, active) for part in self.parts])

        def mean(self) -> mi.Float:
            return self.of([part.mean() for part in self.parts])

        def max(self) -> float:
            return self.of([part.max() for part in self.parts])

        def resolution(self) -> mi.ScalarVector2i:
            return self.parts[0].resolution()

        def is_spatially_varying(self) -> bool:
            return True

        def traverse(self, callback: Any) -> None:
            for number, part in enumerate(self.parts):
                callback.put(f"part{number}", part, mi.ParamFlags.Differentiable)

        def to_string(self) -> str:
            return f"{type(self).__name__}[{', '.join(map(str, self.parts))}]"

    class Product(Derived):
        def of(self, values: list[Any]) -> Any:
            result = values[0]
            for value in values[1:]:
                result = result * value
            return result

    class AtLeast(Derived):
        def __init__(self, part: Any, threshold: float) -> None:
            super().__init__([part])
            self.threshold = threshold

        def of(self, values: list[Any]) -> Any:
            return dr.select(values[0] >= self.threshold, type(values[0])(1), type(values[0])(0))

        def mean(self) -> mi.Float:
            return self.parts[0].mean()

        def max(self) -> float:
            return 1.0

    class Elsewhere(Derived):
        def __init__(
            self, part: Any, attribute: str | None, wrap: tuple[Wrap, Wrap] | None, size: tuple[int, int]
        ) -> None:
            super().__init__([part])
            self.attribute, self.wrap, self.size = attribute, wrap, size

        def of(self, values: list[Any]) -> Any:
            return values[0]

        def at(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.SurfaceInteraction3f:
            place = type(si)(si)
            if self.attribute is not None:
                uv = si.shape.eval_attribute_3(self.attribute, si, active)
                place.uv = mi.Point2f(uv[0], uv[1])
            if self.wrap is not None:
                pairs = zip(place.uv, self.wrap, self.size, strict=True)
                place.uv = mi.Point2f(*(_wrapped(x, wrap, texels) for x, wrap, texels in pairs))
            return place

    return SimpleNamespace(Product=Product, AtLeast=AtLeast, Elsewhere=Elsewhere)


def _wrapped(x: mi.Float, wrap: Wrap, texels: int) -> mi.Float:
    """A coordinate where a texture that repeats itself has what belongs there, up to the middles of the last texels."""
    half = 0.5 / texels
    if wrap == "clamp":
        return dr.clip(x, half, 1 - half)
    if wrap == "mirror":
        return dr.clip(1 - dr.abs(x - 2 * dr.floor(x / 2) - 1), half, 1 - half)
    return x
