"""What a layout is: how the sphere of directions lies in an image, as one face or six.

A point of a face has coordinates (s, t) in [0, 1]², to the right and down. Directions are those of :mod:`..geometry`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..geometry import texel_solid_angle

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Shape = tuple[int, int]

_NODES = 4
"""For integrals over a cell between four texels, along each axis."""


@dataclass(frozen=True)
class Layout:
    """A layout by its ``name``.

    ``direction``: face, s and t to unit vectors (..., 3), also for points that are a little beyond a face.
    ``position``: unit vectors (..., 3) to (face, s, t). ``density``: face, s and t to steradians per unit of s and t,
    0 where the layout has nothing. ``faces``: how many, each ``wide`` times as wide as high. ``edges``: whether the
    first and the last centres of columns, and of rows, are on the edges of the face; else they are half a texel within.
    ``disc``: whether only the disc in the square is used. ``closed``: whether the first column is beside the last.
    ``rows``: those of a latitude-longitude map that is as fine, over those of a face. ``grid``: rows and columns of
    faces in an image, and ``places``: which of them each face has, and whether it is turned by 180 degrees there.
    ``files``: the names of the faces, where each is a file of its own.
    """

    name: str
    direction: Callable[[int, Floats, Floats], Floats]
    position: Callable[[Floats], tuple[Indices, Floats, Floats]]
    density: Callable[[int, Floats, Floats], Floats]
    faces: int = 1
    wide: int = 1
    edges: tuple[bool, bool] = (False, False)
    disc: bool = False
    closed: bool = False
    rows: float = 1.0
    grid: tuple[int, int] = (1, 1)
    places: tuple[tuple[int, int, bool], ...] = ((0, 0, False),)
    files: tuple[str, ...] = ()

    @property
    def aspect(self) -> tuple[int, int]:
        """Width to height of an image, in the smallest numbers; of one face where each is a file."""
        rows, columns = (1, 1) if self.files else self.grid
        divisor = int(np.gcd(columns * self.wide, rows))
        return columns * self.wide // divisor, rows // divisor

    def fits(self, width: int, height: int) -> bool:
        """Whether an image of that size can have this layout."""
        across, down = self.aspect
        return width * down == height * across and height % (1 if self.files else self.grid[0]) == 0

    def to_texels(self, s: Floats, t: Floats, shape: Shape) -> tuple[Floats, Floats]:
        """Columns and rows of points, whole numbers at the centres of texels, of faces of that ``shape`` (H, W)."""
        return _to_texel(s, shape[1], self.edges[0]), _to_texel(t, shape[0], self.edges[1])

    def of_texels(self, x: Floats, y: Floats, shape: Shape) -> tuple[Floats, Floats]:
        """The inverse of :meth:`to_texels`."""
        return _of_texel(x, shape[1], self.edges[0]), _of_texel(y, shape[0], self.edges[1])


def _to_texel(s: Floats, count: int, edges: bool) -> Floats:
    return s * (count - 1) if edges else s * count - 0.5


def _of_texel(x: Floats, count: int, edges: bool) -> Floats:
    return x / max(count - 1, 1) if edges else (x + 0.5) / count


@lru_cache(maxsize=8)
def around(layout: Layout, shape: Shape) -> Indices:
    """For texels of faces of that ``shape`` (H, W) and of one more row and column on each side, (F, H + 2, W + 2): the
    texel that has the radiance there, as an index among (F, H, W).

    Beyond the edge of a face is another face, or another part of the same; beyond a disc is nothing, so that the
    nearest texel of the disc is taken.
    """
    height, width = shape
    own = np.arange(layout.faces * height * width).reshape(layout.faces, height, width)
    x, y = np.arange(-1.0, width + 1), np.arange(-1.0, height + 1)[:, None]
    s, t = layout.of_texels(x, y, shape)
    if layout.disc:
        from scipy.ndimage import distance_transform_edt

        outside = layout.density(0, *np.broadcast_arrays(s, t)) == 0
        row, column = distance_transform_edt(outside, return_distances=False, return_indices=True)
        return own[0, np.clip(row - 1, 0, height - 1), np.clip(column - 1, 0, width - 1)][None]
    found = np.empty((layout.faces, height + 2, width + 2), dtype=np.int64)
    for face in range(layout.faces):
        d = layout.direction(face, *np.broadcast_arrays(s, t))
        other, s_there, t_there = layout.position(d.reshape(-1, 3))
        column, row = (np.rint(a).astype(np.int64) for a in layout.to_texels(s_there, t_there, shape))
        nearest = own[other, np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
        found[face] = nearest.reshape(height + 2, width + 2)
    found[:, 1:-1, 1:-1] = own
    if layout.closed:  # at a pole, directions do not tell columns apart
        found[:, 1:-1, 0], found[:, 1:-1, -1] = own[:, :, -1], own[:, :, 0]
    return found


def solid_angles(layout: Layout, shape: Shape) -> Floats:
    """Steradians that each texel stands for, (F, H, W); their sum is 4π.

    They are integrals of the bilinear hat functions around the centres of texels, so that Σ L · weight is the integral
    of the bilinear radiance over the sphere.
    """
    return texel_solid_angle(*shape)[None] if layout.closed else integrated(layout, shape)


def integrated(layout: Layout, shape: Shape) -> Floats:
    """The same for any layout, by Gauss's rule in each cell between four texels."""
    height, width = shape
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    nodes, weights = (nodes + 1) / 2, weights / 2
    total = np.zeros((layout.faces, height + 2, width + 2))
    for face in range(layout.faces):
        for ty, wy in zip(nodes, weights, strict=True):
            for tx, wx in zip(nodes, weights, strict=True):
                x, y = np.arange(-1, width) + tx, (np.arange(-1, height) + ty)[:, None]
                density = layout.density(face, *np.broadcast_arrays(*layout.of_texels(x, y, shape)))
                add_hats(total[face], wx * wy * density, tx, ty)
    counted = np.bincount(around(layout, shape).ravel(), total.ravel(), layout.faces * height * width)
    return (counted * (4 * np.pi / counted.sum())).reshape(layout.faces, height, width)


def add_hats(total: Floats, values: Floats, tx: float, ty: float) -> None:
    """Give ``values`` (H + 1, W + 1, ...), at (tx, ty) between four texels each, to these: ``total`` (H + 2, W + 2)."""
    rows, columns = values.shape[:2]
    for row, share_y in ((0, 1 - ty), (1, ty)):
        for column, share_x in ((0, 1 - tx), (1, tx)):
            total[row : row + rows, column : column + columns] += share_x * share_y * values
