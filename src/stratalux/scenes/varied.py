"""Textures whose numbers and images differ from shape to shape, so that many materials are one BSDF (Dr.Jit).

Each BSDF of Mitsuba is compiled by itself, and a `bitmap` keeps two copies of its texels, of two bytes a channel. Here,
the images of all materials are one array, of a byte a channel (:class:`.Album`), and a table says what each shape has.
They are made for the variant that is active, which has to be of RGB.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from .album import Album, Place
from .model import Wrap
from .number_texture import number_texture

CHANNELS = {"rgb": -1, "r": 0, "g": 1, "b": 2, "a": 3}


class How(NamedTuple):
    """What all shapes have in common. `image`: whether there are images; `channels`, `wrap` and `nearest` are those of
    :class:`.Value` and :class:`.Texture`. `attribute`: of the mesh, for other coordinates than its own. `moved`:
    whether coordinates are transformed. `curved`: whether some images follow the curve of sRGB. `scaled`: whether there
    are factors and offsets. `clipped`: to [0, 1].
    """

    image: bool
    channels: str
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    nearest: bool = False
    attribute: str | None = None
    moved: bool = False
    curved: bool = True
    scaled: bool = True
    clipped: bool = True


@dataclass(frozen=True)
class Row:
    """What the shapes of one material have: an image, its transform (6 numbers), and a factor and an offset."""

    place: Place | None
    curved: bool
    transform: tuple[float, ...]
    factor: tuple[float, ...]
    offset: tuple[float, ...]


class Tables:
    """Arrays on the device; those that are equal are one, so that what is looked up in them is one, too."""

    def __init__(self) -> None:
        self._known: dict[tuple[Any, bytes], Any] = {}

    def of(self, kind: Any, rows: Sequence[Sequence[float]]) -> Any:
        """An array of that kind, row after row."""
        numbers = np.array(rows, dtype=np.uint32 if kind is mi.UInt32 else np.float32).ravel()
        key = kind, numbers.tobytes()
        if key not in self._known:
            self._known[key] = kind(numbers)
        return self._known[key]


def varied(how: How) -> Any:
    """A texture that is yet to be given its rows, with its method `fill(rows, album, numbers, tables)`.

    `numbers`: the row of each shape, by the identity that Dr.Jit gives that.
    """
    return _kind(mi.variant())(how)


@cache
def _kind(variant: str) -> Any:
    """The class for a variant, whose own texture class it derives from."""

    class Varied(number_texture(variant)):  # type: ignore[misc]
        def __init__(self, how: How) -> None:
            super().__init__()
            self.how = how

        def fill(self, rows: Sequence[Row], album: Album, numbers: mi.UInt32, tables: Tables) -> None:
            self.numbers = numbers
            self.last = tables.of(mi.UInt32, [[dr.width(numbers) - 1]])  # kernels are the same for any
            if self.how.image:
                self.texels, self.curves = album.texels, album.curves
                places = [(row.place, row.curved) for row in rows if row.place is not None]
                self.places = tables.of(mi.UInt32, [(p.start, p.width, p.height, 256 * srgb) for p, srgb in places])
            if self.how.moved:
                self.transforms = tables.of(mi.Float, [(*row.transform[:3], 0, *row.transform[3:], 0) for row in rows])
            if self.how.scaled:
                scales = [(*_three(row.factor), 0, *_three(row.offset), 0) for row in rows]
                self.scales = tables.of(mi.Float, scales)

        # ------------------------------- Mitsuba's interface -------------------------------

        def eval(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Spectrum:
            if self.how.channels == "rgb":
                return mi.Spectrum(self.eval_3(si, active))
            return mi.Spectrum(self.eval_1(si, active))

        def eval_1(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Float:
            if self.how.channels == "rgb":
                return mi.luminance(self.eval_3(si, active))
            return self._values(si, [CHANNELS[self.how.channels]])[0]

        def eval_3(self, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> mi.Color3f:
            if self.how.channels == "rgb":
                return mi.Color3f(self._values(si, [0, 1, 2]))
            return mi.Color3f(self.eval_1(si, active))

        def to_string(self) -> str:
            return f"Varied[{self.how}]"

        # ------------------------------- Values -------------------------------
        # No mask: whatever lanes hold that are not active, all indices are in range. So what several BSDFs ask for, one
        # inside of the other, or for either of their sides, is the same for Dr.Jit, and looked up once.

        def _values(self, si: mi.SurfaceInteraction3f, channels: list[int]) -> list[mi.Float]:
            identity = dr.minimum(dr.reinterpret_array(mi.UInt32, si.shape), self.last)
            row = dr.gather(mi.UInt32, self.numbers, identity)
            values = self._looked_up(si, row, channels) if self.how.image else [mi.Float(1)] * len(channels)
            if self.how.scaled:
                factor, offset = (dr.gather(mi.Vector4f, self.scales, 2 * row + k) for k in (0, 1))
                at = range(3) if len(channels) == 3 else [0]
                values = [dr.fma(value, factor[c], offset[c]) for c, value in zip(at, values, strict=True)]
            return [dr.clip(value, 0, 1) for value in values] if self.how.clipped else values

        def _looked_up(self, si: mi.SurfaceInteraction3f, row: mi.UInt32, channels: list[int]) -> list[mi.Float]:
            """The channels of the image of each lane."""
            start, width, height, curve = dr.gather(mi.Vector4u, self.places, row)
            u, v = self._coordinates(si, row)
            kinds = self.how.wrap
            if self.how.nearest:
                x, y = _nearest(u, kinds[0], width), _nearest(v, kinds[1], height)
                return self._decoded(start + y * width + x, curve, channels)
            (x0, x1, s), (y0, y1, t) = _two(u, kinds[0], width), _two(v, kinds[1], height)
            corners = [[self._decoded(start + y * width + x, curve, channels) for x in (x0, x1)] for y in (y0, y1)]
            rows = [[dr.lerp(a, b, s) for a, b in zip(*pair, strict=True)] for pair in corners]
            return [dr.lerp(a, b, t) for a, b in zip(*rows, strict=True)]

        def _coordinates(self, si: mi.SurfaceInteraction3f, row: mi.UInt32) -> tuple[mi.Float, mi.Float]:
            u, v = si.uv.x, si.uv.y
            if self.how.attribute is not None:
                found = si.shape.eval_attribute_3(self.how.attribute, si)
                u, v = found[0], found[1]
            if self.how.moved:
                a, b = (dr.gather(mi.Vector4f, self.transforms, 2 * row + k) for k in (0, 1))
                u, v = (dr.fma(each[0], u, dr.fma(each[1], v, each[2])) for each in (a, b))
            return u, v

        def _decoded(self, index: mi.UInt32, curve: mi.UInt32, channels: list[int]) -> list[mi.Float]:
            texel = dr.gather(mi.UInt32, self.texels, index)
            codes = [(texel >> (8 * channel)) & 0xFF for channel in channels]
            if not self.how.curved:
                return [mi.Float(code) / 255 for code in codes]
            return [dr.gather(mi.Float, self.curves, code + curve) for code in codes]

    return Varied


def _two(x: mi.Float, wrap: Wrap, size: mi.UInt32) -> tuple[mi.UInt32, mi.UInt32, mi.Float]:
    """The texels before and after a coordinate along an axis of so many, and the share of the later one."""
    at = _wrapped(x, wrap) * mi.Float(size) - 0.5
    before = dr.floor(at)
    i = mi.Int32(before)
    last = mi.Int32(size) - 1
    if wrap == "repeat":
        first, second = dr.select(i < 0, last, i), dr.select(i >= last, 0, i + 1)
    else:
        first, second = i, i + 1
    return mi.UInt32(dr.clip(first, 0, last)), mi.UInt32(dr.clip(second, 0, last)), at - before


def _nearest(x: mi.Float, wrap: Wrap, size: mi.UInt32) -> mi.UInt32:
    """The texel at a coordinate along an axis of so many."""
    return mi.UInt32(dr.clip(mi.Int32(dr.floor(_wrapped(x, wrap) * mi.Float(size))), 0, mi.Int32(size) - 1))


def _wrapped(x: mi.Float, wrap: Wrap) -> mi.Float:
    """The coordinate in [0, 1] that stands for one anywhere."""
    if wrap == "repeat":
        return x - dr.floor(x)
    if wrap == "mirror":
        return 1 - dr.abs(x - 2 * dr.floor(x / 2) - 1)
    return dr.clip(x, 0, 1)


def _three(numbers: Sequence[float]) -> list[float]:
    return [float(x) for x in np.broadcast_to(numbers, 3)]
