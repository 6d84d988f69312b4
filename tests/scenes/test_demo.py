"""The built-in scene: the hall and its windows, the knot, and that it all renders."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from stratalux.errors import InputError
from stratalux.scenes.demo import demo_map, demo_mesh, demo_scene
from tests.variants import RGB

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@pytest.fixture(scope="module")
def hall() -> np.ndarray:
    return demo_map(256)


def test_the_map_has_a_high_dynamic_range(hall: np.ndarray) -> None:
    luminance = hall @ LUMINANCE
    assert hall.shape == (256, 512, 3) and hall.dtype == np.float32
    assert np.isfinite(hall).all() and luminance.min() > 0
    assert luminance.max() / luminance.min() >= 1e4


def test_most_of_the_light_comes_from_small_windows(hall: np.ndarray) -> None:
    weight = np.sin(np.pi * np.arange(256) / 255)[:, None] * np.ones(512)
    bright = (hall @ LUMINANCE) > 1
    assert 0.002 < weight[bright].sum() / weight.sum() < 0.05
    power = (hall @ LUMINANCE) * weight
    assert power[bright].sum() > 0.8 * power.sum()


def test_the_map_is_the_same_every_time(hall: np.ndarray) -> None:
    np.testing.assert_array_equal(hall, demo_map(256))


def test_the_map_has_the_same_light_at_every_resolution(hall: np.ndarray) -> None:
    def irradiance(image: np.ndarray) -> np.ndarray:
        height = len(image)
        weight = np.sin(np.pi * np.arange(height) / (height - 1))
        total: np.ndarray = np.einsum("yxc,y->c", image, weight) / weight.sum() / image.shape[1]
        return total

    np.testing.assert_allclose(irradiance(demo_map(64)), irradiance(hall), rtol=0.05)


def test_up_is_the_ceiling_and_down_the_floor(hall: np.ndarray) -> None:
    for row in (0, -1):
        assert np.isfinite(hall[row]).all()
        assert np.ptp(hall[row] @ LUMINANCE) < 0.02
    # The lamp hangs towards +z, which is the middle column, and in the upper half.
    y, x = np.unravel_index(np.argmax(hall @ LUMINANCE), hall.shape[:2])
    assert y < 128 and abs(x - 256) < 64


def test_the_map_is_anti_aliased(hall: np.ndarray) -> None:
    luminance = hall @ LUMINANCE
    # Between the darkest window (about 5) and the brightest wall (about 0.1) only mixed pixels exist.
    assert np.count_nonzero((luminance > 0.2) & (luminance < 4)) > 50


@pytest.mark.parametrize("height", [1, 0, -3])
def test_a_map_without_rows_is_an_input_error(height: int) -> None:
    with pytest.raises(InputError, match=f"height {height}"):
        demo_map(height)


def test_the_knot_is_fine_closed_and_stands_on_the_ground() -> None:
    mesh = demo_mesh()
    assert mesh.normals is not None
    assert 200_000 <= len(mesh.faces) <= 400_000
    assert np.isfinite(mesh.vertices).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    assert mesh.bounds[0, 1] == pytest.approx(0, abs=1e-6)


def test_the_knot_is_watertight_and_its_normals_point_outwards() -> None:
    mesh = demo_mesh(subdivisions=3)
    assert mesh.normals is not None and len(mesh.faces) == 6144 * 9
    sides = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]).astype(int)
    forwards = np.sort(sides @ [len(mesh.vertices), 1])
    backwards = np.sort(sides @ [1, len(mesh.vertices)])
    np.testing.assert_array_equal(forwards, backwards)
    assert np.all(np.diff(forwards) > 0)
    a, b, c = np.moveaxis(mesh.vertices.astype(np.float64)[mesh.faces], 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0
    shading = mesh.normals[mesh.faces].sum(axis=1)
    assert np.mean(np.sum(np.cross(b - a, c - a) * shading, axis=1) > 0) > 0.999


def test_too_few_subdivisions_are_an_input_error() -> None:
    with pytest.raises(InputError, match="0 subdivisions"):
        demo_mesh(0)


def test_the_demo_renders_the_same_every_time() -> None:
    before = mi.variant()
    mi.set_variant(RGB)
    try:
        images = [
            np.array(mi.render(mi.load_dict({**demo_scene((60, 40), 8, 128), "integrator": {"type": "direct"}})))
            for _ in range(2)
        ]
    finally:
        if before is not None:
            mi.set_variant(before)
    # Threads add to the film in any order: equal but for rounding.
    np.testing.assert_allclose(images[0], images[1], rtol=1e-4, atol=1e-6)
    assert images[0].shape == (40, 60, 3) and np.isfinite(images[0]).all()
    assert 0.2 < images[0].mean() < 0.8
