"""Fast hierarchical importance sampling with blue noise properties (Ostromoukhov, Donohue and Jodoin 2004).

A Penrose tiling is subdivided by substitution. Each of its points has a code, which read as a number in the Fibonacci
number system is its rank: the points with rank <= x lie evenly spread, with a density in proportion to x. Keeping a
point where the importance reaches its rank therefore gives points with the density of the importance. A table of
corrections, indexed by the structure around a point and by the importance, then moves the points apart, which makes
their spectrum close to that of blue noise.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..maps.envmap import EnvironmentMap
from ..maps.geometry import direction
from .rig import LightRig, check_count, importance, rig_from_labels
from .voronoi import nearest, texel_directions

PHI = (1 + np.sqrt(5)) / 2
BINS = 21
"""Size of the correction table, both in structural and in importance indices: 6 bits of code have 21 values."""

DENSITY = 1 / (PHI**3 * np.sin(np.pi / 5))
"""Points of rank <= x per x and per area s²: half a point in the area of the root, φ³ sin 36° / 2."""

MAX_PER_TEXEL = 3.0
"""Importance is cut off where it asks for more points in a texel than this: enough to be sure that there is one."""

_A, _C, _D, _E, _F = 0, 2, 3, 4, 5  # types of tiles; a B is what an A is after an odd number of subdivisions

# Children as (type, origin, turn of direction, bits of code); an origin is a vertex of the parent or of child 0 or 1.
_CHILDREN = {
    _C: [(_F, "p3", 14, 0), (_C, "p2", 6, 1), (_A, "c0.p3", 1, 1)],
    _D: [(_E, "p2", 6, 0), (_D, "c0.p3", 14, 1)],
    _E: [(_C, "p3", 12, 1), (_E, "p2", 8, 2), (_F, "p1", 0, 0), (_A, "c0.p2", 7, 1)],
    _F: [(_F, "p3", 12, 2), (_E, "c0.p3", 0, 0), (_D, "c1.p3", 8, 1), (_A, "c0.p3", 15, 2)],
}
_AXES = np.stack([-np.sin(np.arange(20) * np.pi / 10), np.cos(np.arange(20) * np.pi / 10)], axis=1)
_FIBONACCI = [0, 1]
while len(_FIBONACCI) < 70:
    _FIBONACCI.append(_FIBONACCI[-1] + _FIBONACCI[-2])


def penrose(environment: EnvironmentMap, n: int, *, correction: bool = True) -> LightRig:
    """Lights at ``n`` points with the density of the map's energy, each with ∫ L dω over its Voronoi cell.

    The points are laid out in the latitude-longitude plane, a texel being a square of side 1 and the poles being its
    upper and lower edge; the importance there is luminance times sin θ. Without ``correction`` the points stay at the
    vertices of the tiling.

    Differences from the publication: ``n`` is met exactly, by the choice of the factor on the importance, with at most
    one light in a texel; a tile is subdivided as long as the largest importance in its bounding box demands it, instead
    of that at its vertices and its centroid, so that no bright texel is missed and no uniform subdivision has to come
    first; Voronoi cells are those on the sphere. The correction table is our own (``scripts/penrose_table.py``).

    There are fewer than ``n`` lights if the map has fewer texels with energy. Nothing is random. Raises
    :class:`InputError` if ``n`` is less than 1 or more than the number of texels.
    """
    check_count(environment, n)
    height, width = environment.height, environment.width
    weight = importance(environment).reshape(height, width)
    density = weight / weight.sum()
    density[[0, -1]] *= 2  # the poles are edges: half of their texels lies outside

    limit = float(n)
    while True:
        points = tiling_points(density, limit)
        order = np.argsort(points.appears, kind="stable")
        points = points[order]
        texel, _ = _place(points, density, limit, correction)
        if len(np.unique(texel)) >= n or np.all((density == 0) | (limit * density >= MAX_PER_TEXEL)):
            break
        limit *= 2
    # The fewest points in n texels: bisect for their number.
    few, enough = 0, len(points)
    while enough - few > 1:
        middle = (few + enough) // 2
        texel, _ = _place(points[:middle], density, points.appears[middle - 1], correction)
        few, enough = (few, middle) if len(np.unique(texel)) >= n else (middle, enough)
    if enough < len(points):
        limit, points = points.appears[enough - 1], points[:enough]
    texel, position = _place(points, density, limit, correction)
    first = np.sort(np.unique(texel, return_index=True)[1])[:n]
    texel, position = texel[first], position[first]

    texels = texel_directions(height, width)
    label = nearest(texels[texel], texels).reshape(height, width)
    lights = direction(position[:, 0] / width, position[:, 1] / (height - 1))
    return rig_from_labels(environment, label, "penrose", lights)


@dataclass(frozen=True)
class TilingPoints:
    """Points of the tiling as they are born (arrays of length P).

    ``origin`` (P, 2): x and y in texels. ``direction``: that of the tile, in 18° counter-clockwise from the y axis.
    ``level``: subdivisions from the root. ``code``: two bits a level. ``appears``: the number of points over the whole
    map, as a factor on the density, from which on the point is kept.
    """

    origin: NDArray[np.float64]
    direction: NDArray[np.int64]
    level: NDArray[np.int64]
    code: NDArray[np.int64]
    appears: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.origin)

    def __getitem__(self, chosen: NDArray | slice) -> TilingPoints:
        return TilingPoints(*(field[chosen] for field in vars(self).values()))


def tiling_points(density: NDArray[np.float64], limit: float) -> TilingPoints:
    """The points of the tiling that have appeared at ``limit``.

    ``density`` (H, W): points per texel, for a total of one. The plane is [0, W) x [0, H − 1]; texel (i, j) is at
    (j + ½, i) in it.
    """
    height, width = density.shape
    root = root_scale(density.shape)
    per_density = root**2 / DENSITY  # importance (a rank) for one point per texel
    pyramid = _max_pyramid(density)

    kind = np.array([_F])
    origin = -root * np.array([[PHI**2 / 2 - 0.25, 0.125]])
    turn, code, rank = np.array([15]), np.array([0]), np.array([0])
    found = []
    level, scale = 0, root
    while len(kind):
        corners = _vertices(kind, origin, turn, scale)
        demand = limit * _box_maximum(pyramid, corners.min(axis=1), corners.max(axis=1), density.shape)
        split = _required_level(per_density * np.minimum(demand, MAX_PER_TEXEL)) > level
        kind, corners, turn, code, rank = kind[split], corners[split], turn[split], code[split], rank[split]
        level, scale = level + 1, scale / PHI
        kind, origin, turn, code, rank = _subdivide(kind, corners, turn, code, rank, level, scale)

        x, y = origin.T
        inside = (kind == _A) & (x >= 0) & (x < width) & (y >= 0) & (y <= height - 1)
        local = density[_texel(origin[inside], density.shape)]
        rarity = np.divide(rank[inside], per_density, out=np.full(len(local), np.inf), where=local > 0)
        visible = rarity <= np.minimum(limit * local, MAX_PER_TEXEL)
        where = np.flatnonzero(inside)[visible]
        appears = rarity[visible] / local[visible]
        found.append(TilingPoints(origin[where], turn[where], np.full(len(where), level), code[where], appears))
        triangles = kind != _A
        kind, origin, turn, code, rank = (field[triangles] for field in (kind, origin, turn, code, rank))
    return TilingPoints(*(np.concatenate(fields) for fields in zip(*(vars(f).values() for f in found), strict=True)))


def root_scale(shape: tuple[int, ...]) -> float:
    """Scale s of the root tile for a map of (H, W) texels."""
    return 2.0 * max(shape[0] - 1, shape[1])


def correction_frame(
    points: TilingPoints, rank: NDArray[np.float64], root: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """What the correction of points at importance ``rank`` (P,) depends on.

    Returns the structural index (P,), the importance index (P,) and the vectors (P, 2, 2) in texels by which the two
    entries of the table are multiplied.
    """
    level = np.maximum(_required_level(rank), points.level)
    age = level - points.level
    last_bits = np.left_shift(points.code, 2 * np.minimum(age, 3)) & 63
    structure = sum(((last_bits >> (5 - i)) & 1) * _FIBONACCI[i + 2] for i in range(6))
    phase = np.log1p(np.sqrt(5) * rank) / np.log(PHI**2)
    turn = points.direction + 10 * (age // 2)  # every second subdivision turns a point around
    scale = root / PHI**level
    return (
        np.asarray(structure),
        (BINS * (phase - np.floor(phase))).astype(np.int64),
        scale[:, None, None] * np.stack([_axis(turn), _axis(turn + 5)], axis=1),
    )


@cache
def correction_table() -> NDArray[np.float64]:
    """Displacements (structural index, importance index, 2) in units of the tile's scale, in its frame."""
    table = json.loads(files(__package__).joinpath("penrose_table.json").read_text())
    return np.array(table, dtype=np.float64)


def _place(
    points: TilingPoints, density: NDArray[np.float64], limit: float, correction: bool
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Texel (P,) and corrected position (P, 2) of each point, when ``limit`` points are wanted."""
    height, width = density.shape
    position = points.origin
    if correction:
        root = root_scale(density.shape)
        local = density[_texel(position, density.shape)]
        structure, phase, frame = correction_frame(
            points, root**2 / DENSITY * np.minimum(limit * local, MAX_PER_TEXEL), root
        )
        position = position + np.einsum("pk,pkc->pc", correction_table()[structure, phase], frame)
        position = np.stack([position[:, 0] % width, np.clip(position[:, 1], 0, height - 1)], axis=1)
    row, column = _texel(position, density.shape)
    column = np.where((row == 0) | (row == height - 1), 0, column)  # a polar row is one place
    return row * width + column, position


def _texel(position: NDArray[np.float64], shape: tuple[int, ...]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and column of the texel at each position (P, 2) in the plane."""
    column, row = np.floor(position + np.array([0, 0.5])).astype(np.int64).T
    return np.clip(row, 0, shape[0] - 1), np.clip(column, 0, shape[1] - 1)


def _axis(turn: NDArray[np.int64]) -> NDArray[np.float64]:
    return _AXES[turn % 20]


def _required_level(rank: ArrayLike) -> NDArray[np.int64]:
    """Number of subdivisions after which all points up to ``rank`` are there."""
    rank = np.asarray(rank)
    order = np.floor(np.log(rank * np.sqrt(5) + 1) / np.log(PHI))
    level = np.ceil(0.5 * np.maximum(1, order - 1)).astype(np.int64)
    return np.where(rank > 0, level, 0)


def _vertices(
    kind: NDArray[np.int64], origin: NDArray[np.float64], turn: NDArray[np.int64], scale: float
) -> NDArray[np.float64]:
    """The corners (T, 3, 2) of triangular tiles."""
    thin = (kind == _C) | (kind == _D)
    second = np.where(thin, 1, PHI**2)[:, None] * _axis(turn)
    third = PHI * _axis(turn + np.where(thin, 4, 2))
    return np.stack([origin, origin + scale * second, origin + scale * third], axis=1)


def _subdivide(
    kind: NDArray[np.int64],
    corners: NDArray[np.float64],
    turn: NDArray[np.int64],
    code: NDArray[np.int64],
    rank: NDArray[np.int64],
    level: int,
    scale: float,
) -> tuple[NDArray, ...]:
    """Types, origins, directions, codes and ranks of the children of triangular tiles, at ``level`` and ``scale``."""
    # Codes grow at their low end, where the digits of the Fibonacci number system weigh most.
    digit = {0: 0, 1: _FIBONACCI[2 * level + 1], 2: _FIBONACCI[2 * level]}
    children: list[tuple[NDArray, ...]] = []
    for parent, rules in _CHILDREN.items():
        lanes = np.flatnonzero(kind == parent)
        siblings = [corners[lanes]]  # the parent, then child 0 and child 1
        for child, where, rotation, bits in rules:
            owner, vertex = ("", where) if "." not in where else where.split(".")
            source = siblings[0] if not owner else siblings[int(owner[1]) + 1]
            origin = source[:, int(vertex[1]) - 1]
            turned = (turn[lanes] + rotation) % 20
            kinds = np.full(len(lanes), child)
            siblings.append(_vertices(kinds, origin, turned, scale))
            children.append((kinds, origin, turned, code[lanes] << 2 ^ bits, rank[lanes] + digit[bits]))
    return tuple(np.concatenate(fields) for fields in zip(*children, strict=True))


def _max_pyramid(image: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Maxima over squares of 1, 2, 4, … texels, down to one."""
    pyramid = [image]
    while pyramid[-1].size > 1:
        height, width = pyramid[-1].shape
        padded = np.pad(pyramid[-1], ((0, height % 2), (0, width % 2)))
        pyramid.append(padded.reshape((height + 1) // 2, 2, (width + 1) // 2, 2).max(axis=(1, 3)))
    return pyramid


def _box_maximum(
    pyramid: list[NDArray[np.float64]], low: NDArray[np.float64], high: NDArray[np.float64], shape: tuple[int, ...]
) -> NDArray[np.float64]:
    """An upper bound of the image in each of the boxes from ``low`` to ``high`` (T, 2); 0 where a box is outside."""
    outside = np.any(high < 0, axis=1) | (low[:, 0] > shape[1]) | (low[:, 1] > shape[0] - 1)
    top, left = _texel(low - 1e-6, shape)
    bottom, right = _texel(high + 1e-6, shape)
    span = np.maximum(bottom - top, right - left)
    floor = np.minimum(np.ceil(np.log2(np.maximum(span, 1))).astype(np.int64), len(pyramid) - 1)
    result = np.zeros(len(low))
    for k in np.unique(floor):  # of squares at least as wide as the box, four cover it
        lanes = np.flatnonzero((floor == k) & ~outside)
        rows, columns = (top[lanes] >> k, bottom[lanes] >> k), (left[lanes] >> k, right[lanes] >> k)
        result[lanes] = np.max([pyramid[k][i, j] for i in rows for j in columns], axis=0)
    return result
