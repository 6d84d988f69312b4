"""A film that is too large for the memory there is: in bands, one below the other, each a picture of its own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import mitsuba as mi
import numpy as np

from ..integrators.memory import NoRoom
from ..integrators.sums import reach_of

NAME = "band:"
"""How the stages of a band are called, before its place."""
_SHARE = 0.5
"""Of the room there is, that a band is made for: what launches take besides comes and goes."""
_KEPT, _WRITTEN = 16, 40
"""Bytes that a pixel of the whole picture takes while others are rendered, and when files are made of it."""


@dataclass(frozen=True)
class Band:
    """Rows from ``top`` up to ``bottom`` of the film, rendered with those above and below that a pixel's filter
    reaches: from ``first`` up to ``last``."""

    top: int
    bottom: int
    first: int
    last: int

    @property
    def name(self) -> str:
        """Of its stages."""
        return f"{NAME}{self.first}-{self.last}"

    @classmethod
    def called(cls, name: str) -> Band:
        """The one with that name, as far as is known from it."""
        first, last = (int(row) for row in name.removeprefix(NAME).split("-"))
        return cls(first, last, first, last)


def bands(height: int, count: int, reach: int) -> list[Band]:
    """So many for a film of that ``height``, whose filter reaches so far beyond a pixel."""
    cuts = [height * k // count for k in range(count + 1)]
    return [Band(top, bottom, max(0, top - reach), min(height, bottom + reach)) for top, bottom in pairwise(cuts)]


def number(error: NoRoom, film: mi.Film) -> int:
    """How many bands have room each, where the whole ``film`` has none. Raises that ``error`` if the picture itself has
    none, or a band would be hardly more than what it shares with its neighbours."""
    width, height = (int(side) for side in film.crop_size())
    rows = int(_SHARE * (error.room - _KEPT * width * height) / (error.each * width))
    if rows < 8 * max(1, reach_of(film)) or error.most < _WRITTEN * width * height:
        raise error
    return -(-height // rows)


@contextmanager
def only(camera: mi.Sensor, first: int, last: int) -> Iterator[None]:
    """Rows of the film from ``first`` up to ``last`` alone are rendered meanwhile."""
    film = camera.film()
    size, offset = film.crop_size(), film.crop_offset()
    _crop(camera, [int(size[0]), last - first], [int(offset[0]), int(offset[1]) + first])
    try:
        yield
    finally:
        _crop(camera, [int(side) for side in size], [int(start) for start in offset])


def _crop(camera: mi.Sensor, size: list[int], offset: list[int]) -> None:
    parameters = mi.traverse(camera)
    parameters["film.crop_size"], parameters["film.crop_offset"] = size, offset
    parameters.update()


def empty_like(band: mi.Bitmap, height: int) -> mi.Bitmap:
    """A bitmap of the whole film, for one of a ``band``."""
    names = [field.name for field in band.struct_()]
    size = [band.width(), height]
    return mi.Bitmap(band.pixel_format(), band.component_format(), size, band.channel_count(), names)


def pixels_of(bitmap: mi.Bitmap) -> Any:
    """Its pixels (H, W, C), which may be written to."""
    pixels = np.asarray(bitmap)
    assert pixels.flags.writeable
    return pixels.reshape(bitmap.height(), bitmap.width(), -1)
