"""The environment map as an array, checked and cleaned at the border."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import EnvironmentMapWarning, InputError
from ..images.colour import LUMINANCE
from .energy_table import EnergyTable
from .geometry import row_weights

MIN_HEIGHT, MIN_WIDTH = 3, 2
"""Smaller maps are padded by replication of their edge, as Mitsuba's ``envmap`` does."""
_ROWS = 16


@dataclass(frozen=True)
class EnvironmentMap:
    """A latitude-longitude map of radiance: ``texels`` (H, W, 3), linear RGB, finite, non-negative, float32.

    Build one with :meth:`from_array` or :meth:`load`, which check and clean; the constructor trusts.
    """

    texels: NDArray[np.float32]

    @classmethod
    def from_array(cls, array: ArrayLike, name: str = "environment map") -> EnvironmentMap:
        """Take an array (H, W), (H, W, 1), (H, W, 3) or (H, W, 4); alpha is dropped.

        NaN and negative values become 0 and infinite ones the largest finite value, with an
        :class:`EnvironmentMapWarning` that counts the texels. Raises :class:`InputError` if the array is not an image.
        """
        texels = np.asarray(array)
        if texels.ndim == 2:
            texels = texels[..., None]
        if texels.ndim != 3 or texels.shape[2] not in (1, 3, 4) or texels.size == 0:
            raise InputError(f"{name}: shape {np.shape(array)} is not an image; give (height, width, 3)")
        if not (np.issubdtype(texels.dtype, np.number) or texels.dtype == bool):
            raise InputError(f"{name}: type {texels.dtype} is not numeric; give linear RGB radiance")
        if texels.shape[2] == 1:
            texels = np.repeat(texels, 3, axis=2)
        texels = np.ascontiguousarray(texels[..., :3], dtype=np.float32)
        texels = clean(texels, name)
        height, width = texels.shape[:2]
        if width != 2 * height and width * height > 1:
            warnings.warn(
                f"{name}: {width}x{height} is not 2:1; taken as a full latitude-longitude map all the same",
                EnvironmentMapWarning,
                stacklevel=2,
            )
        pad = (max(0, MIN_HEIGHT - height), max(0, MIN_WIDTH - width))
        if any(pad):
            texels = np.pad(texels, ((0, pad[0]), (0, pad[1]), (0, 0)), mode="edge")
        return cls(texels)

    @classmethod
    def load(cls, path: str | Path) -> EnvironmentMap:
        """Read an image file (.exr, .hdr, .pfm, or anything else that Mitsuba's ``Bitmap`` reads).

        Raises :class:`InputError` if the file is missing, truncated or not an image.
        """
        from ..images.files import read_rgb  # the codecs are Mitsuba's: import it only when a file is read

        return cls.from_array(read_rgb(path), name=str(path))

    @property
    def height(self) -> int:
        return self.texels.shape[0]

    @property
    def width(self) -> int:
        return self.texels.shape[1]

    @cached_property
    def luminance(self) -> NDArray[np.float32]:
        """Luminance of each texel, (H, W)."""
        return self.texels @ LUMINANCE

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


def clean(texels: NDArray[np.float32], name: str = "environment map") -> NDArray[np.float32]:
    """Return ``texels`` (H, W, C) without NaN, infinite and negative values, warning with their count."""
    if _sound(texels):
        return texels
    nan, infinite, negative = np.isnan(texels), np.isposinf(texels), texels < 0
    if not (nan | infinite | negative).any():  # but a zero with a sign
        return texels
    ceiling = texels[np.isfinite(texels)].max(initial=0)
    texels = np.where(nan | negative, 0, np.where(infinite, ceiling, texels)).astype(texels.dtype)
    counts = [
        f"{mask.any(axis=2).sum()} {kind}"
        for kind, mask in (("NaN", nan), ("infinite", infinite), ("negative", negative))
        if mask.any()
    ]
    warnings.warn(
        f"{name}: {', '.join(counts)} texel(s) repaired (NaN and negative to 0, infinite to {ceiling:g})",
        EnvironmentMapWarning,
        stacklevel=3,
    )
    return texels


def _sound(texels: NDArray[np.float32]) -> bool:
    """Whether there is nothing to repair, in one pass over blocks that stay in the cache.

    Taken as integers, infinity and NaN are above all finite numbers, and negative ones above those.
    """
    bits = np.dtype(f"u{texels.dtype.itemsize}")
    infinity = np.array(np.inf, texels.dtype).view(bits)
    blocks = (texels[first : first + _ROWS].view(bits) for first in range(0, len(texels), _ROWS))
    return all(block.max(initial=0) < infinity for block in blocks)
