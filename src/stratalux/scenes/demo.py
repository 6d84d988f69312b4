"""The built-in scene: a rope knot in a dim hall with a few bright windows, all of it computed here."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from .mesh import TriangleMesh
from .stage import stage

Array = npt.NDArray[np.float32]

# The hall, in metres with the eye at the origin: the planes x, y and z = const. that bound it.
_LOW = np.array([-6.0, -1.6, -9.0], dtype=np.float32)
_HIGH = np.array([6.0, 7.0, 9.0], dtype=np.float32)
_BAY = 3.6
"""The distance between the pillars along the walls."""

_PLASTER = np.array([0.060, 0.050, 0.040], dtype=np.float32)
_STONE = np.array([0.075, 0.068, 0.060], dtype=np.float32)
_PANELLING = np.array([0.026, 0.015, 0.009], dtype=np.float32)
_CEILING = np.array([0.022, 0.018, 0.016], dtype=np.float32)
_BEAMS = np.array([0.010, 0.007, 0.005], dtype=np.float32)
_FLOOR = np.array([[0.040, 0.034, 0.030], [0.020, 0.017, 0.016]], dtype=np.float32)

# Arched windows: wall ('x' or 'z' and its side), place along the wall, sill, width, height, radiance.
_WINDOWS: tuple[tuple[str, int, float, float, float, float, tuple[float, float, float]], ...] = (
    ("x", -1, 1.8, 1.0, 1.3, 4.4, (64.0, 73.0, 84.0)),
    ("x", -1, 5.4, 1.0, 1.3, 4.4, (26.0, 31.0, 37.0)),
    ("x", -1, -5.4, 1.0, 1.3, 4.4, (6.0, 11.0, 22.0)),
    ("x", 1, -1.8, 2.8, 0.5, 1.4, (75.0, 36.0, 10.0)),
    ("x", 1, 5.4, 2.8, 0.5, 1.4, (6.0, 12.0, 18.0)),
    ("z", 1, 1.8, 1.8, 0.8, 2.6, (7.0, 7.5, 8.0)),
    ("z", -1, 1.8, 1.4, 0.8, 3.0, (6.0, 17.0, 21.0)),
)
_ROSE = (-1.8, 4.3, 1.0, (110.0, 46.0, 9.0))
"""The round window in the wall at -z: its centre (x, y), its radius and its radiance."""

_LAMP = ((0.12, 0.66, 0.74), 0.018, (1150.0, 760.0, 390.0))
"""A lamp: its direction, its angular radius and its radiance."""


def demo_map(height: int = 512) -> Array:
    """The hall as a lat-long radiance map, (height, 2 * height, 3) float32, linear sRGB.

    Row 0 looks straight up and the last row straight down; the centre of column x lies at the azimuth
    2 pi (x + 0.5) / width, and azimuth p, polar angle t at (sin p sin t, cos t, -cos p sin t). The same
    for every call. Raises InputError for a height below 2.
    """
    if height < 2:
        raise InputError(f"demo map: height {height} is too small; use at least 2")
    oversampling = 3
    inside = (np.arange(oversampling) + 0.5) / oversampling
    azimuth = 2 * np.pi * (np.arange(2 * height)[:, None] + inside).ravel() / (2 * height)
    image = np.empty((height, 2 * height, 3), dtype=np.float32)
    for row in range(height):
        polar = np.clip(np.pi * (row + inside - 0.5) / (height - 1), 0, np.pi)
        theta, phi = np.meshgrid(polar.astype(np.float32), azimuth.astype(np.float32), indexing="ij")
        directions = np.stack([np.sin(phi) * np.sin(theta), np.cos(theta), -np.cos(phi) * np.sin(theta)])
        image[row] = _radiance(directions).reshape(oversampling, -1, oversampling, 3).mean(axis=(0, 2))
    return image


def demo_mesh(subdivisions: int = 7) -> TriangleMesh:
    """A trefoil knot of rope, 6144 * subdivisions**2 triangles, closed, y up, its lowest point at y = 0.

    The strands of the rope wind around its core and leave deep grooves between them. Raises InputError
    for less than 1 subdivision.
    """
    if subdivisions < 1:
        raise InputError(f"demo mesh: {subdivisions} subdivisions are too few; use at least 1")
    along, around = 192 * subdivisions, 16 * subdivisions
    t, s = np.meshgrid(2 * np.pi * np.arange(along) / along, 2 * np.pi * np.arange(around) / around, indexing="ij")

    # The core runs on a torus: twice around its axis (z) and three times around its tube.
    turn = 2 * t[:, :1]
    tube = 3 * t[:, :1] + np.pi / 2
    outwards = np.concatenate([np.cos(turn - np.pi / 2), np.sin(turn - np.pi / 2), np.zeros_like(turn)], axis=1)
    axis = np.array([0.0, 0.0, 1.0])
    core = outwards * (1 + 0.46 * np.cos(tube)) + axis * 0.44 * np.sin(tube)
    tangent = np.roll(core, -1, axis=0) - np.roll(core, 1, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # The normal of the torus turns with the core and comes back to itself, so that the rope closes.
    first = outwards * np.cos(tube) + axis * np.sin(tube)
    first -= tangent * np.sum(first * tangent, axis=1, keepdims=True)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(tangent, first)

    strand = np.sqrt(np.cos(2.5 * s + 16 * t) ** 2 + 0.004)
    radius = 0.27 * (0.42 + 0.58 * strand**0.8) * (1 + 0.10 * np.cos(3 * t + 0.4))
    ring = first[:, None] * np.cos(s)[..., None] + second[:, None] * np.sin(s)[..., None]
    points = core[:, None] + radius[..., None] * ring
    points[..., 1] -= points[..., 1].min()

    ahead, aside = (np.roll(points, -1, axis=k) - np.roll(points, 1, axis=k) for k in (0, 1))
    normals = np.cross(aside, ahead)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    index = np.arange(along * around).reshape(along, around)
    a, b = index, np.roll(index, -1, axis=0)
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    faces = np.stack([a, c, b, a, d, c], axis=-1).reshape(-1, 3).astype(np.uint32)
    return TriangleMesh(points.reshape(-1, 3).astype(np.float32), faces, normals.reshape(-1, 3).astype(np.float32))


def demo_scene(
    size: tuple[int, int] = (600, 400), spp: int = 64, height: int = 512, emitter: object | None = None
) -> dict[str, Any]:
    """The Mitsuba scene dictionary of the demo, without an integrator; needs a variant to be set.

    `size` is the (width, height) of the film in pixels, `spp` the samples per pixel and `height` that of
    the environment map, which an `emitter` replaces. Raises InputError as `stage`, `demo_map` and `demo_mesh` do.
    """
    import mitsuba as mi

    material = {
        "type": "twosided",
        "bsdf": {
            "type": "roughplastic",
            "distribution": "ggx",
            "alpha": 0.12,
            "nonlinear": True,
            "diffuse_reflectance": {"type": "rgb", "value": [0.86, 0.34, 0.12]},
        },
    }
    if emitter is None:
        emitter = {"type": "envmap", "bitmap": mi.Bitmap(_map_once(height))}
    return stage(demo_mesh(), material, emitter, size, spp)


@lru_cache(maxsize=1)
def _map_once(height: int) -> Array:
    """:func:`demo_map`, which takes about a second, for scenes one after the other."""
    return demo_map(height)


def _radiance(directions: Array) -> Array:
    """The radiance (M, N, 3) that arrives at the eye from unit `directions` (3, M, N)."""
    shape = directions.shape[1:]
    # A direction that runs along a wall meets it too far away to matter, but not at infinity.
    directions = np.where(directions == 0, np.float32(1e-9), directions).reshape(3, -1)
    reach = np.where(directions > 0, _HIGH[:, None], _LOW[:, None]) / directions
    plane = np.argmin(reach, axis=0)
    place = directions * np.min(reach, axis=0)
    radiance = np.empty((place.shape[1], 3), dtype=np.float32)
    for axis, name in enumerate("xyz"):
        for side in (-1, 1):
            hit = np.flatnonzero((plane == axis) & (place[axis] * side > 0))
            if hit.size:
                x, y, z = place[:, hit]
                radiance[hit] = _slab(x, z, side) if name == "y" else _wall(name, side, z if name == "x" else x, y)

    towards, angle, colour = _LAMP
    lamp = np.array(towards, dtype=np.float32) / np.float32(np.linalg.norm(towards))
    radiance[np.tensordot(lamp, directions, axes=1) > np.cos(angle)] = colour
    return radiance.reshape(*shape, 3)


def _wall(axis: str, side: int, along: Array, y: Array) -> Array:
    """One wall and its windows, (M, 3)."""
    radiance = _masonry(along, y)
    for its_axis, its_side, centre, sill, width, tall, colour in _WINDOWS:
        if (its_axis, its_side) == (axis, side):
            radiance[_arch(along - centre, y - sill, width, tall)] = colour
    if (axis, side) == ("z", -1):
        centre_x, centre_y, size, colour = _ROSE
        across, above = along - centre_x, y - centre_y
        distance = np.hypot(across, above)
        petals = np.abs(np.sin(4 * np.arctan2(above, across))) * distance > 0.05
        radiance[(distance < size) & petals & (np.abs(distance - 0.38 * size) > 0.04)] = colour
    return radiance


def _masonry(along: Array, y: Array) -> Array:
    """Plaster above a panelled base, with a round stone pillar in every bay, (..., 3)."""
    height = (y - _LOW[1]) / (_HIGH[1] - _LOW[1])
    base = height < 0.16
    plaster = _PLASTER * (1.25 - 0.8 * height)[..., None]
    across = (along / _BAY - np.round(along / _BAY)) * _BAY / 0.38
    shade = np.sqrt(np.clip(1 - across**2, 0, 1)) * (1 + 0.35 * across)
    pillar = _STONE * (0.25 + 0.9 * shade * (1.2 - 0.7 * height))[..., None]
    joint = np.abs(along * 1.25 - np.round(along * 1.25)) < 0.07
    panelling = np.where(joint[..., None], _PANELLING * np.float32(0.6), _PANELLING)
    return np.where((np.abs(across) < 1)[..., None], pillar, np.where(base[..., None], panelling, plaster))


def _slab(x: Array, z: Array, side: int) -> Array:
    """The chequered floor below and the beamed ceiling above, (M, 3)."""
    if side > 0:
        beam = (np.abs(z / _BAY - np.round(z / _BAY)) < 0.09) | (np.abs(x / 3 - np.round(x / 3)) < 0.05)
        return np.where(beam[:, None], _BEAMS, _CEILING)
    chequered = (np.round(x / 0.8) + np.round(z / 0.8)) % 2 == 0
    lit = 1 + 1.2 * np.exp(-((x + 3.4) ** 2) / 6 - (z - 2.5) ** 2 / 22)
    return np.where(chequered[:, None], _FLOOR[0], _FLOOR[1]) * lit[:, None]


def _arch(across: Array, above: Array, width: float, tall: float) -> npt.NDArray[np.bool_]:
    """Whether a point at (`across`, `above`) the sill's middle is glass of a round-arched window."""
    spring = tall - width / 2
    opening = np.where(above < spring, np.abs(across), np.hypot(across, above - spring)) < width / 2
    bars = (np.abs(across) < 0.04) | (np.abs(above / 0.8 - np.round(above / 0.8)) < 0.04)
    glass: npt.NDArray[np.bool_] = opening & (above > 0) & ~bars
    return glass
