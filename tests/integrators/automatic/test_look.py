"""What pixels show, against rays that are looked at one by one."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.helpers import scene_dict


def looked(scene: mi.Scene) -> tuple[NDArray[Any], NDArray[Any]]:
    """Marks (2, H, W) and detail (H, W)."""
    from stratalux.integrators.automatic.launch import Launcher  # of the active variant

    integrator = mi.load_dict({"type": "direct_stratified"})
    launcher = Launcher(integrator, scene, scene.sensors()[0])
    launcher.begin(integrator.prepare(scene))
    look = launcher.look()
    width, height = scene.sensors()[0].film().crop_size()
    marks = np.stack([mark.numpy() for mark in look.marks])
    return marks.reshape(2, height, width), look.detailed.numpy().reshape(height, width).astype(bool)


def shapes_at_corners(scene: mi.Scene) -> NDArray[Any]:
    """Number of the shape, 0 for none, (H + 1, W + 1)."""
    sensor = scene.sensors()[0]
    width, height = sensor.film().crop_size()
    y, x = np.mgrid[: height + 1, : width + 1].reshape(2, -1).astype(np.float32)
    ray, _ = sensor.sample_ray(0, 0.5, mi.Point2f(x / width, y / height), mi.Point2f(0.5))
    si = scene.ray_intersect(ray)
    shape = np.zeros(x.size, dtype=int)
    for number, one in enumerate(scene.shapes(), start=1):
        shape[(si.shape == mi.ShapePtr(one)).numpy()] = number
    return shape.reshape(height + 1, width + 1)


@pytest.mark.parametrize("crop", [{}, {"crop_width": 50, "crop_height": 30, "crop_offset_x": 11, "crop_offset_y": 9}])
def test_marks_and_rims(crop: dict[str, int]) -> None:
    description = scene_dict("diffuse", size=(90, 60))
    description["sensor"]["film"].update(crop)
    scene = mi.load_dict(description)
    marks, detailed = looked(scene)
    at = shapes_at_corners(scene)
    corners = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]])
    whole = (corners == corners[0]).all(axis=0)
    assert detailed[~whole].all() and (~whole).sum() > 50
    length = np.linalg.norm(marks, axis=0)
    np.testing.assert_allclose(length[whole], corners[0][whole] > 0, atol=1e-4)
    names = [shape.class_name() for shape in scene.shapes()]
    ball, floor, nothing = (
        whole & (corners[0] == number) for number in (names.index("Sphere") + 1, names.index("Rectangle") + 1, 0)
    )
    assert not detailed[floor].any() and not detailed[nothing].any()
    assert detailed[ball].mean() < 0.3  # where it turns away
    assert np.linalg.norm(marks[:, ball].mean(axis=1) - marks[:, floor].mean(axis=1)) > 0.5


def test_few_pixels_see_more_detail() -> None:
    """A ball of few pixels turns inside of each."""
    _, detailed = looked(mi.load_dict(scene_dict("diffuse", size=(9, 6))))
    assert detailed[2:4, 3:5].all()
