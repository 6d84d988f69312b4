"""The environment map as an array, checked and cleaned at the border."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import EnvironmentMapWarning, InputError
from ..images.colour import LUMINANCE
from ..images.half import single
from ..images.repair import LARGEST_HALF, repair
from .energy_table import EnergyTable
from .geometry import row_weights
from .layouts import LATLONG
from .layouts.guess import about_size
from .resampling import Sheet, in_latlong
from .sheets import AUTO, read_sheet

if TYPE_CHECKING:
    from ..images.reading import Allocate

MIN_HEIGHT, MIN_WIDTH = 3, 2
"""Smaller maps are padded by replication of their edge, as Mitsuba's ``envmap`` does."""
_ROWS = 16


@dataclass(frozen=True)
class EnvironmentMap:
    """A latitude-longitude map of radiance: ``texels`` (H, W, 3), linear RGB, finite, non-negative, float32; float16
    where :meth:`load` was told to leave them so, as rendering does.

    Build one with :meth:`from_array` or :meth:`load`, which check and clean; the constructor trusts.
    """

    texels: NDArray[Any]

    @classmethod
    def from_array(cls, array: ArrayLike, name: str = "environment map") -> EnvironmentMap:
        """Take an array (H, W), (H, W, 1), (H, W, 3) or (H, W, 4); alpha is dropped.

        NaN and negative values become 0, infinite ones 10 times the largest other (65504 in an array of half floats,
        which they have overflowed), and those above 1e30 are cut off there, with an :class:`EnvironmentMapWarning` that
        counts the texels. Raises :class:`InputError` if the array is not an image.
        """
        texels = np.asarray(array)
        if texels.ndim == 2:
            texels = texels[..., None]
        if texels.ndim != 3 or texels.shape[2] not in (1, 3, 4) or texels.size == 0:
            raise InputError(f"{name}: shape {np.shape(array)} is not an image; give (height, width, 3)")
        if texels.dtype.kind not in "biuf":
            raise InputError(f"{name}: type {texels.dtype} is not numeric; give linear RGB radiance")
        largest = LARGEST_HALF if texels.dtype == np.float16 else None
        if texels.shape[2] == 1:
            texels = np.repeat(texels, 3, axis=2)
        with np.errstate(over="ignore"):  # float64 may become infinite
            texels = np.ascontiguousarray(texels[..., :3], dtype=np.float32)
        texels, said = repair(texels, largest)
        if said:
            warnings.warn(f"{name}: {said}", EnvironmentMapWarning, stacklevel=2)
        if about := about_size(texels.shape[1], texels.shape[0]):
            warnings.warn(f"{name}: {about}", EnvironmentMapWarning, stacklevel=2)
        return cls._padded(texels)

    @classmethod
    def _padded(cls, texels: NDArray[Any]) -> EnvironmentMap:
        height, width = texels.shape[:2]
        pad = (max(0, MIN_HEIGHT - height), max(0, MIN_WIDTH - width))
        if any(pad):
            texels = np.pad(texels, ((0, pad[0]), (0, pad[1]), (0, 0)), mode="edge")
        return cls(texels)

    @classmethod
    def load(
        cls, path: str | Path, *, layout: str = AUTO, max_memory: int | None = None, allocate: Allocate | None = None
    ) -> EnvironmentMap:
        """Read an image file (.exr, .hdr, .pfm, .tif, .png, .jpg, or anything else that OpenImageIO reads).

        ``layout``: how the map lies in the image, a name of :data:`.layouts.LAYOUTS`, or ``auto``: as the header or
        the name of the file say (see :func:`.sheets.read_sheet`). Other maps than those of latitude and longitude are
        resampled. ``max_memory``: bytes that its pixels may take, half of what the machine has unless given.
        ``allocate``: see :func:`.sheets.read_sheet`. An :class:`EnvironmentMapWarning` says what was chosen, converted
        or left out. Raises :class:`InputError` if the file is missing, damaged, too large or not an image, or cannot
        have the layout.
        """
        sheet, said = read_sheet(path, layout, max_memory, allocate)
        for line in said:
            warnings.warn(f"{path}: {line}", EnvironmentMapWarning, stacklevel=2)
        return cls.from_sheet(sheet)

    @classmethod
    def from_sheet(cls, sheet: Sheet) -> EnvironmentMap:
        """The map of a ``sheet`` whose texels are finite and not negative."""
        return cls._padded(in_latlong(sheet).texels[0])

    @cached_property
    def sheet(self) -> Sheet:
        """The map in its layout, to be converted to others."""
        return Sheet(LATLONG, self.texels[None])

    @property
    def height(self) -> int:
        return self.texels.shape[0]

    @property
    def width(self) -> int:
        return self.texels.shape[1]

    @cached_property
    def luminance(self) -> NDArray[np.float32]:
        """Luminance of each texel, (H, W)."""
        luminance = np.empty((self.height, self.width), dtype=np.float32)
        for first in range(0, self.height, _ROWS):
            rows = slice(first, first + _ROWS)
            np.matmul(single(self.texels[rows]), LUMINANCE, out=luminance[rows])
        return luminance

    def as_single(self) -> EnvironmentMap:
        """The same in float32; itself if it is so already."""
        return self if self.texels.dtype == np.float32 else EnvironmentMap(single(self.texels))

    @cached_property
    def energy_table(self) -> EnergyTable:
        """Integrals of the bilinear luminance over rectangles."""
        return EnergyTable.build(self.texels)

    @cached_property
    def cell_energy(self) -> NDArray[np.float64]:
        """Integral over solid angle of the bilinear luminance in each cell, (H − 1, W), exact."""
        return cell_energy(self.luminance)


def cell_energy(luminance: NDArray[np.float32]) -> NDArray[np.float64]:
    """Integral over solid angle of the bilinear ``luminance`` (H, W) in each cell, (H − 1, W); see ``row_weights``."""
    height, width = luminance.shape
    upper, lower = (np.pi / width * w[:, None] for w in row_weights(height))
    energy = np.empty((height - 1, width))
    pairs, scratch = np.empty((_ROWS + 1, width)), np.empty((_ROWS, width))
    for first in range(0, height - 1, _ROWS):  # blocks that stay in the cache
        last = min(first + _ROWS, height - 1)
        texels, pair, lowest = luminance[first : last + 1], pairs[: last - first + 1], scratch[: last - first]
        np.add(texels[:, :-1], texels[:, 1:], out=pair[:, :-1], dtype=np.float64)
        np.add(texels[:, -1], texels[:, 0], out=pair[:, -1], dtype=np.float64)
        np.multiply(upper[first:last], pair[:-1], out=energy[first:last])
        np.multiply(lower[first:last], pair[1:], out=lowest)
        energy[first:last] += lowest
    return energy
