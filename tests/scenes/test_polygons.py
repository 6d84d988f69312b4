"""Polygons: their triangles cover them once, whatever their outline and wherever they are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from stratalux.scenes.polygons import fan, strip, triangulated

Array = NDArray[np.float64]

L_SHAPE = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
COMB = np.array([[0, 0], [7, 0], *[[7 - k, 1 + 3 * (k % 2)] for k in range(8)]], dtype=float)
TURNS = np.linspace(0.5, 5 * np.pi, 60)[:, None]
SPIRAL = np.concatenate([r * TURNS * np.hstack([np.cos(TURNS), np.sin(TURNS)]) for r in (1.0, 1.1)])
SPIRAL[60:] = SPIRAL[60:][::-1]
DART = np.array([[0, 0], [2, 1], [0, 2], [0.5, 1]], dtype=float)
KEYHOLE = np.array(
    [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0], [1, 1], [1, 3], [3, 3], [3, 1], [1, 1]], dtype=float
)  # a square with a square hole, and the way to it and back


def shoelace(outline: Array) -> float:
    x, y = outline.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


def in_space(outline: Array, seed: int, offset: float = 0.0) -> Array:
    """A plane outline in a random plane, up to rounding."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return np.pad(outline, ((0, 0), (0, 1))) @ turn.T + offset * rng.normal(size=3)


def check(points: Array, sizes: list[int], areas: list[float], tolerance: float = 1e-9) -> None:
    """Triangles, in the order of the polygons, that turn the way of their polygon and add up to its area."""
    triangles, doubtful = triangulated(points, np.array(sizes))
    assert doubtful == 0
    ends = np.cumsum(sizes)
    owner = np.searchsorted(ends, triangles, side="right")
    assert np.all(owner == owner[:, :1]), "a triangle has corners of two polygons"
    assert np.all(np.diff(owner[:, 0]) >= 0)
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    vectors = np.cross(b - a, c - a) / 2
    for polygon, area in enumerate(areas):
        own = vectors[owner[:, 0] == polygon]
        total = own.sum(axis=0)
        assert np.linalg.norm(total) == pytest.approx(area, rel=tolerance)
        assert np.linalg.norm(own, axis=1).sum() == pytest.approx(area, rel=tolerance), "triangles overlap"
        corners = points[ends[polygon] - sizes[polygon] : ends[polygon]]
        local = corners - corners[0]
        assert total @ np.cross(local, np.roll(local, -1, axis=0)).sum(axis=0) > 0, "turned around"


@pytest.mark.parametrize("outline", [L_SHAPE, COMB, SPIRAL, DART, KEYHOLE], ids=["L", "comb", "spiral", "dart", "hole"])
@pytest.mark.parametrize("backwards", [False, True])
def test_notches_stay_open_from_every_first_corner(outline: Array, backwards: bool) -> None:
    outline = outline[::-1] if backwards else outline
    for first in range(len(outline)):
        check(in_space(np.roll(outline, first, axis=0), first), [len(outline)], [abs(shoelace(outline))])


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    radii=st.lists(st.floats(0.05, 1), min_size=5, max_size=40),
    seed=st.integers(0, 2**31),
    doubled=st.lists(st.integers(0, 39), max_size=3),
    halved=st.lists(st.integers(0, 39), max_size=3),
    offset=st.sampled_from([0.0, 1e3, 1e7]),
)
def test_any_outline_around_a_point(
    radii: list[float], seed: int, doubled: list[int], halved: list[int], offset: float
) -> None:
    """With corners that come twice, and corners on straight lines."""
    angles = 2 * np.pi * np.arange(len(radii)) / len(radii)
    outline = np.array(radii)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for corner in doubled:
        outline = np.insert(outline, corner % len(outline), outline[corner % len(outline)], axis=0)
    for corner in halved:
        corner %= len(outline)
        outline = np.insert(outline, corner + 1, (outline[corner] + outline[(corner + 1) % len(outline)]) / 2, axis=0)
    # What a coordinate of 1e7 loses in double precision, relative to a polygon of size 1.
    check(in_space(outline, seed, offset), [len(outline)], [shoelace(outline)], 1e-9 + 1e-15 * 50 * offset)


def test_many_polygons_keep_their_order_and_convex_ones_are_fans() -> None:
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    triangle = square[:3]
    shapes = [square, L_SHAPE, triangle, DART, square * 2, COMB, triangle]
    points = np.concatenate([in_space(shape, 5) + np.array([3.0 * k, 0, 0]) for k, shape in enumerate(shapes)])
    check(points, [len(shape) for shape in shapes], [shoelace(shape) for shape in shapes])
    hexagon = np.stack([np.cos(np.arange(6)), np.sin(np.arange(6)), np.zeros(6)], axis=1)
    triangles, _ = triangulated(hexagon, np.array([6]))
    np.testing.assert_array_equal(triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])


def test_a_quadrilateral_that_is_not_flat_is_cut_into_two() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0.2], [1, 1, 0], [0, 1, 0.2]])
    triangles, doubtful = triangulated(points, np.array([4]))
    np.testing.assert_array_equal(triangles, [[0, 1, 2], [0, 2, 3]])
    assert doubtful == 0


def test_outlines_that_cross_themselves_are_counted() -> None:
    bow_tie = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
    angles = 4 * np.pi / 5 * np.arange(5)
    pentagram = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    triangle = bow_tie[:3]
    _, doubtful = triangulated(np.concatenate([triangle, bow_tie, pentagram]), np.array([3, 4, 5]))
    assert doubtful == 2


def test_polygons_without_an_area_or_with_two_corners_do_no_harm() -> None:
    line = np.stack([np.arange(5.0), np.zeros(5), np.zeros(5)], axis=1)
    triangles, doubtful = triangulated(np.concatenate([line, line[:2]]), np.array([5, 2]))
    assert doubtful == 0
    assert triangles.max(initial=0) < 5


def test_strips_and_fans() -> None:
    np.testing.assert_array_equal(strip(5), [[0, 1, 2], [1, 3, 2], [2, 3, 4]])
    np.testing.assert_array_equal(fan(5), [[1, 2, 0], [2, 3, 0], [3, 4, 0]])
    for count in range(3):
        assert strip(count).shape == fan(count).shape == (0, 3)
