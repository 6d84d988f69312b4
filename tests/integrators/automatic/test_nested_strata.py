"""The points of a pixel, who survives, and rays at random: exactly, or over all random numbers there are."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import scene_dict

LANES = 1 << 16


def test_points_of_a_pixel_are_stratified_in_every_dimension() -> None:
    from stratalux.integrators.automatic.nested_strata import PixelPoints  # of the active variant

    sampler = mi.load_dict({"type": "independent", "sample_count": 16})
    sampler.set_samples_per_wavefront(16)
    sampler.seed(1, 16 * 50)
    points = PixelPoints.of(sampler)
    np.testing.assert_array_equal(points.index.numpy(), np.tile(np.arange(16), 50))
    seeds = points.seed.numpy().reshape(50, 16)
    assert (seeds == seeds[:, :1]).all() and len(np.unique(seeds)) == 50
    drawn = []
    for _ in range(3):
        u = points.next_1d().numpy().reshape(50, 16)
        assert (np.sort(np.floor(u * 16), axis=1) == np.arange(16)).all()
        x, y = points.next_2d().numpy().reshape(2, 50, 16)
        cells = np.sort(4 * np.floor(4 * x) + np.floor(4 * y), axis=1)
        assert (cells == np.arange(16)).all()
        drawn += [u, x, y]
    correlation = np.corrcoef(np.array(drawn).reshape(9, -1))
    assert np.abs(correlation - np.eye(9)).max() < 0.2  # dimensions know nothing of each other


def survivors(offers: list[list[float]], direction: list[list[float]]) -> tuple[Any, Any]:
    """Directions and what they stand for, over random numbers that are all there are, as good as."""
    from stratalux.integrators.automatic.nested_strata import Survivor

    n = 1 << 8
    kept = Survivor()
    for k, (g, d) in enumerate(zip(offers, direction, strict=True)):
        lane = dr.arange(mi.UInt32, n ** len(offers))
        random = ((lane // n**k) % n) * (1 << 24) + (1 << 23)
        kept.offer(mi.Vector3f(d), mi.Color3f(g), random)
    return kept.d.numpy(), kept.g.numpy()


def test_a_survivor_stands_for_all() -> None:
    """E[1(kept) g] of each offer is the offer itself, in every channel."""
    offers = [[0.25, 0.25, 0.25], [1.0, 2.0, 0.5]]
    directions = [[1.0, 0, 0], [0, 1.0, 0]]
    d, g = survivors(offers, directions)
    for k in range(2):
        mean = np.where(d[k] == 1, g, 0).mean(axis=1)
        np.testing.assert_allclose(mean, offers[k], rtol=2e-2)
    luminance = mi.luminance(mi.Color3f(g)).numpy()
    np.testing.assert_allclose(luminance, luminance[0], rtol=1e-5)  # whoever it is


@pytest.mark.parametrize("place", [0, 1])
def test_what_brings_nothing_does_not_survive(place: int) -> None:
    offers, directions = [[0.5, 0.5, 0.5]], [[1.0, 0, 0]]
    offers.insert(place, [0, 0, 0])
    directions.insert(place, [0, 1.0, 0])
    d, g = survivors(offers, directions)
    assert (d[0] == 1).all()
    np.testing.assert_allclose(g, 0.5, rtol=1e-6)
    _, g = survivors([[0, 0, 0]], [[1.0, 0, 0]])
    assert (g == 0).all()


@pytest.mark.parametrize("known", [0.2, None])
@pytest.mark.parametrize("bright", [0.02, 0.2, 5.0])
@pytest.mark.parametrize("blocked", [False, True])
def test_rays_at_random_change_no_mean(blocked: bool, bright: float, known: float | None) -> None:
    """Over all random numbers: g V with any V̂ and any probability of a ray."""
    from stratalux.integrators.automatic.nested_strata import WORTH_A_RAY, NestedStrata, PixelPoints, Survivor
    from stratalux.integrators.automatic.visibility import Visibility

    scene = mi.load_dict(scene_dict())
    points = PixelPoints(mi.UInt32(0), mi.UInt32(0), None, mi.Float(1.0))
    learned = None if known is None else mi.Float([known] * 64)
    counts = dr.zeros(mi.UInt32, 64), dr.zeros(mi.UInt32, 64)
    points.visibility = Visibility(mi.UInt32(0), counts, learned)
    si = dr.zeros(mi.SurfaceInteraction3f, LANES)
    si.p, si.n = mi.Point3f(0, 5, 0), mi.Normal3f(0, 1, 0)
    kept = Survivor()
    d = mi.Vector3f(0, -1, 0) if blocked else mi.Vector3f(0, 1, 0)
    kept.offer(d, mi.Color3f(bright / 4), mi.UInt32(0))
    random = dr.arange(mi.UInt32, LANES) * mi.UInt32((1 << 32) // LANES)
    strata = NestedStrata(None, points, None)
    found = strata._shadowed(scene, si, kept, mi.UInt32(4), random, mi.Bool(True)).numpy()
    V = 0 if blocked else 1
    doubt = 1 if known is None else 2 * np.sqrt(known * (1 - known))
    chance = min(doubt * bright / WORTH_A_RAY, 1)
    traced, free = (int(dr.sum(c)[0]) for c in counts)
    assert traced == pytest.approx(chance * LANES, abs=1) and free == V * traced
    guess = known or 0
    expected = {bright / 4 * guess} if chance < 1 else set()
    expected |= {bright / 4 * (guess + (V - guess) / chance)}
    values = np.unique(found)
    assert len(values) == len(expected)
    np.testing.assert_allclose(values, sorted(expected), atol=1e-6)
    np.testing.assert_allclose(found.mean(axis=1), bright / 4 * V, atol=1e-4 * bright)
    dark = Survivor()
    assert (strata._shadowed(scene, si, dark, mi.UInt32(4), random, mi.Bool(True)).numpy() == 0).all()
    points.expected = None  # then every one gets its ray
    always = strata._shadowed(scene, si, kept, mi.UInt32(4), random, mi.Bool(True)).numpy()
    np.testing.assert_allclose(always, bright / 4 * V, atol=1e-6)
