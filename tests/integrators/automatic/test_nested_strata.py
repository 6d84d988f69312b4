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


def shaded(material: str, seen: str) -> tuple[mi.Scene, Any, mi.SurfaceInteraction3f, mi.BSDFPtr]:
    """A scene and its light, and places on the shape that is ``seen``, under a sky so even that M is 1."""
    texels = np.random.default_rng(1).uniform(0.9, 1.1, (16, 32, 3)).astype(np.float32)
    scene = mi.load_dict(scene_dict(material, texels))
    light = mi.load_dict({"type": "direct_stratified"}).prepare(scene)
    x, y = np.meshgrid(np.linspace(0.05, 0.95, 40), np.linspace(0.05, 0.95, 40))
    ray, _ = scene.sensors()[0].sample_ray(0, 0.5, mi.Point2f(x.ravel(), y.ravel()), mi.Point2f(0.5))
    si = scene.ray_intersect(ray)
    shape = next(shape for shape in scene.shapes() if shape.class_name() == seen)
    at = dr.compress(si.shape == mi.ShapePtr(shape))
    si = dr.gather(mi.SurfaceInteraction3f, si, at)
    return scene, light, si, si.bsdf()


@pytest.mark.parametrize("material", ["diffuse", "roughplastic", "roughconductor"])
def test_derivatives_are_those_of_the_same_estimate(material: str) -> None:
    """Where there is one proposal for each ray; shadows and all."""
    from stratalux.integrators.automatic.nested_strata import NestedStrata, PixelPoints
    from stratalux.integrators.light_samples import FreshLight

    scene, light, si, bsdf = shaded(material, "Sphere")
    _, _, M, _ = light.allocation.of(si.shape, bsdf, mi.UInt32(0), mi.Bool(True))
    assert (M.numpy() == 1).all()
    index = dr.arange(mi.UInt32, dr.width(si.p)) % 8
    points = PixelPoints(index, mi.UInt32(5))
    assert int(points.detailed[0]) == 0 and (points.difference.numpy() == 0).all()
    strata = NestedStrata(light.allocation, points, FreshLight(light, points.seed))
    one = strata.estimate(scene, light, si, bsdf, mi.Bool(True)).numpy()
    other = strata.differentiable(scene, light, si, bsdf, mi.Bool(True)).numpy()
    np.testing.assert_allclose(other, one, rtol=1e-3, atol=1e-4)
    assert one.mean() > 0.01 and np.std(one[0]) > 0
    for method in (strata.estimate, strata.differentiable):
        assert (method(scene, light, si, bsdf, mi.Bool(False)).numpy() == 0).all()


@pytest.mark.parametrize("material", ["roughplastic", "roughconductor"])
def test_samples_of_lobes_bring_their_part(material: str) -> None:
    from stratalux.integrators.automatic.balance import Balance
    from stratalux.integrators.automatic.nested_strata import NestedStrata
    from stratalux.integrators.common import only
    from stratalux.sampling.points import mix

    _, light, si, bsdf = shaded(material, "Sphere")
    shares = light.allocation.of(si.shape, bsdf, mi.UInt32(0), mi.Bool(True))
    balance = Balance(light.allocation, light, si, bsdf, shares, mi.Bool(True))
    point = mix(dr.arange(mi.UInt32, dr.width(si.p)))
    d, g, found = NestedStrata._lobe_sample(light, balance, si, bsdf, point, mi.UInt32(3), mi.Bool(True))
    f, p = bsdf.eval_pdf(only(mi.BSDFFlags.Glossy), si, si.to_local(d))
    expected = balance.lobe_part(light.radiance_towards(d, si, found), p) * f
    lit = found.numpy()
    assert lit.mean() > 0.8 and (g.numpy()[:, ~lit] == 0).all()
    np.testing.assert_allclose(g.numpy()[:, lit], expected.numpy()[:, lit], rtol=2e-3, atol=1e-5)


@pytest.mark.parametrize(("seen", "origin"), [("metal", [0.2, 3, 0.1]), ("floor", [-3, 3, 2])])
def test_only_what_is_matte_has_a_variate(seen: str, origin: list[float]) -> None:
    from stratalux.integrators.automatic.nested_strata import NestedStrata, PixelPoints
    from stratalux.integrators.light_samples import FreshLight

    description = scene_dict("diffuse")
    description["ball"]["bsdf"] = {"type": "roughconductor", "alpha": 0.2}
    scene = mi.load_dict(description)
    light = mi.load_dict({"type": "direct_stratified"}).prepare(scene)
    si = scene.ray_intersect(mi.Ray3f(mi.Point3f(origin), mi.Vector3f(0, -1, 0)))
    metal = next(shape for shape in scene.shapes() if shape.class_name() == "Sphere")
    assert dr.all((si.shape == mi.ShapePtr(metal)) == (seen == "metal"))
    points = PixelPoints(dr.arange(mi.UInt32, 64), mi.UInt32(5))
    strata = NestedStrata(light.allocation, points, FreshLight(light, points.seed), light.tables.variate)
    strata.estimate(scene, light, si, si.bsdf(), mi.Bool(True))
    difference = points.difference.numpy()
    assert (difference == 0).all() if seen == "metal" else (difference != 0).any()
    # Over all 64 samples, which are one set of strata, little is left of it
    assert np.abs(difference.mean()) <= 0.2 * np.abs(difference).mean()
