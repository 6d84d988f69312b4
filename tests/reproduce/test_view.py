"""Fixed camera rays, what they hit, and what is hidden from there."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from stratalux.maps.envmap import EnvironmentMap
from stratalux.reproduce.occlusion import bright_directions, hidden_share
from stratalux.reproduce.pinned import stratified, structured
from stratalux.reproduce.view import View
from stratalux.reproduce.visibility import costs_of, visibility_costs
from tests.helpers import hall_map, sun_map

SIZE = (24, 16)


def scene(texels: np.ndarray | None = None) -> mi.Scene:
    """A ball on a ground that has an end, seen from the side."""
    T = mi.ScalarTransform4f
    return mi.load_dict(
        {
            "type": "scene",
            "object": {"type": "sphere", "center": [0, 1, 0]},
            "ground": {"type": "disk", "to_world": T().rotate([1, 0, 0], -90).scale(4)},
            "sky": {"type": "envmap", "bitmap": mi.Bitmap(hall_map() if texels is None else texels)},
            "sensor": {
                "type": "perspective",
                "fov": 40,
                "to_world": T().look_at([0, 1.5, 6], [0, 1, 0], [0, 1, 0]),
                "film": {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1]},
            },
        }
    )


def test_without_random_numbers_every_image_is_the_same() -> None:
    view, technique = View(scene(), SIZE, 2), structured(8)
    integrator = technique.load()
    first, second = (view.render(integrator, technique.samples, seed).image for seed in (1, 2))
    assert first.shape == (16, 24, 3) and first.mean() > 0
    np.testing.assert_allclose(first, second, rtol=1e-5)


def test_a_crop_is_a_part_of_the_whole() -> None:
    technique = structured(8)
    whole = View(scene(), SIZE, 2).render(technique.load(), technique.samples, 0).image
    part = View(scene(), SIZE, 2, (5, 3, 15, 12)).render(technique.load(), technique.samples, 0).image
    np.testing.assert_allclose(part, whole[3:12, 5:15], rtol=1e-5)


def test_chunks_make_one_image(monkeypatch: pytest.MonkeyPatch) -> None:
    view, technique = View(scene(), SIZE), stratified(8)
    integrator = technique.load()
    whole = view.render(integrator, technique.samples, 3)
    seen: list[float] = []
    monkeypatch.setattr("stratalux.reproduce.view._SAMPLES_PER_LAUNCH", 8 * 100)
    cut = view.render(integrator, technique.samples, 3, seen.append)
    assert seen == pytest.approx([100 / 384, 200 / 384, 300 / 384, 1])
    assert cut.seconds > 0 and np.abs(cut.image - whole.image).max() > 0  # random numbers of their own
    assert cut.image.mean() == pytest.approx(whole.image.mean(), rel=0.05)
    assert (cut.image.reshape(-1, 3)[300:].mean(axis=0) > 0).all()


def test_hits() -> None:
    hits = View(scene(), SIZE, 2).hits()
    assert hits.object[8, 12] and not hits.object[0, 0] and not hits.surface[0, 0]
    assert hits.ground[15, 12] and not hits.ground[8, 12]
    assert not (hits.object & hits.ground).any() and (hits.surface >= hits.object).all()


def test_bright_directions_find_the_sun() -> None:
    environment = EnvironmentMap(sun_map())
    height, width = environment.height, environment.width
    theta, phi = np.pi * (height // 3) / (height - 1), 2 * np.pi * (width // 4 + 0.5) / width
    sun = [np.sin(phi) * np.sin(theta), np.cos(theta), -np.cos(phi) * np.sin(theta)]
    np.testing.assert_allclose(bright_directions(environment, 5), [sun] * 5, atol=1e-6)
    even = bright_directions(EnvironmentMap(np.ones((17, 32, 3), dtype=np.float32)), 64, share=1.0)
    assert np.linalg.norm(even.mean(axis=0)) < 0.1


def test_hidden_lights() -> None:
    """From straight above nothing is hidden but what lies below the ball; from straight below, everything is."""
    view = View(scene(), SIZE)
    hits = view.hits()
    above, facing = hidden_share(view, np.array([[0.0, 1.0, 0.0]]))
    assert np.isnan(above[0, 0])
    assert (above[15] == 0).all()  # ground in front of the ball
    assert above[hits.object][0] == 0 and above[hits.object][-1] == 1  # its top, and its lower half
    assert 0.5 < facing < 1
    below, facing = hidden_share(view, np.array([[0.0, -1.0, 0.0]]))
    assert (
        below[hits.surface] == 1
    ).all() and facing < 0.5  # the ball's lower half faces it, and the ground is between
    both, _ = hidden_share(view, np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]))
    assert (both[15] == 0.5).all()


def test_every_kernel_is_timed() -> None:
    """What it took is not told here: the differences between kernels of microseconds are noise."""
    costs = visibility_costs(View(scene(), SIZE), stratified(16), 0.8, 3)
    assert costs.sample > 0 and costs.tests == 0.8 and np.isfinite([costs.surface, costs.test]).all()


def test_costs_are_differences_of_medians() -> None:
    """A machine that is half as fast in one round, and busy with something else in another, changes nothing."""
    rounds = [(2.0, 3.0, 5.0), (1.0, 1.5, 2.5), (1.0, 9.0, 2.5), (1.0, 1.5, 2.5), (7.0, 1.5, 2.5)]
    costs = costs_of(list(zip(*rounds, strict=True)), 1_000_000, 0.5)
    assert (costs.sample, costs.surface, costs.test) == pytest.approx((1000, 500, 2000))
    assert costs.ratio == pytest.approx(2) and costs.ratio_with_surface == pytest.approx(4 / 3)
