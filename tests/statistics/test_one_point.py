"""Light at one point, without a camera or a film: means of estimates against sums over directions.

Many estimates of one number show smaller errors than a picture, in less time.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from tests.helpers import MATERIALS, hall_map, sidak
from tests.variants import RGB

mi.set_variant(RGB)
LANES, RUNS = 1 << 12, 48
STEPS = 1024
"""Rows of directions of the sums."""
T = mi.ScalarTransform4f
BALL = {"type": "sphere", "center": [1.2, 0.4, 1.0], "radius": 0.7}
LAMPS = {
    "lamp": {
        "type": "rectangle",
        "to_world": T().look_at([-1, 0.4, 1.8], [0, 0, 0], [0, 1, 0]).scale(0.5),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [6, 4, 2]}, "sampling_weight": 0.3},
    },
    "bulb": {
        "type": "sphere",
        "center": [0.56, -0.93, 1.68],
        "radius": 0.6,
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [1, 3, 2]}, "sampling_weight": 2.0},
    },
}
POINT = {"type": "point", "position": [0.9, 0.6, 1.5], "intensity": {"type": "rgb", "value": [1, 2, 3]}}


def loaded(sky: bool = True, **things: dict[str, Any]) -> mi.Scene:
    described: dict[str, Any] = {"type": "scene", **things}
    if sky:
        turned = T().rotate([0, 1, 0], 37).rotate([1, 0, 0], -28)
        described["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(hall_map()), "scale": 0.5, "to_world": turned}
    return mi.load_dict(described)


@pytest.fixture(autouse=True, scope="module")
def let_go() -> Iterator[None]:
    """Dr.Jit traces all BSDFs that live along with those of later pictures."""
    yield
    material.cache_clear()
    gc.collect()


@cache
def material(variant: str, name: str) -> mi.BSDF:
    return mi.load_dict({**MATERIALS, "white": {"type": "diffuse", "reflectance": 1.0}}[name])


def point(lanes: int, name: str) -> tuple[mi.SurfaceInteraction3f, mi.BSDFPtr]:
    """At the origin, facing +z, seen from one side. What mirrors shows the bulb there; the mirror alone does not."""
    si = dr.zeros(mi.SurfaceInteraction3f, lanes)
    si.t, si.n, si.sh_frame = 1, mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Normal3f(0, 0, 1))
    si.wi = dr.normalize(mi.Vector3f(-0.3, -0.5 if name == "mirror" else 0.5, 0.9))
    return si, dr.gather(mi.BSDFPtr, mi.BSDFPtr(material(mi.variant(), name)), dr.zeros(mi.UInt32, lanes))


def summed(name: str, arriving: Callable[[mi.Ray3f], mi.Spectrum], other: mi.BSDF | None = None) -> NDArray[np.float64]:
    """∫ f cos L dω, (3,), by the midpoint rule over the hemisphere; ``arriving``: L along rays from the point.

    ``other``: a BSDF in place of that of the ``name``.
    """
    k = dr.arange(mi.UInt32, 2 * STEPS * STEPS)
    row = k // (2 * STEPS)
    cosine = (mi.Float(row) + 0.5) / STEPS  # even steps of it are even steps of solid angle
    sine, φ = dr.sqrt(1 - cosine * cosine), dr.pi / STEPS * (mi.Float(k - row * (2 * STEPS)) + 0.5)
    d = mi.Vector3f(dr.cos(φ) * sine, dr.sin(φ) * sine, cosine)
    si, bsdf = point(dr.width(k), name)
    g = (bsdf if other is None else other).eval(mi.BSDFContext(), si, d) * arriving(si.spawn_ray(d))
    return np.asarray(g.numpy().astype(np.float64).mean(axis=1) * 2 * np.pi)


def assert_mean(estimates: NDArray[Any], expected: NDArray[np.float64], comparisons: int, least: float = 0.01) -> None:
    """Student's t-test of ``estimates`` (runs, K), at the level of all comparisons together, with so small an error."""
    error = estimates.std(axis=0, ddof=1) / np.sqrt(len(estimates))
    assert (error < least * np.abs(expected)).all()  # it can tell
    off = np.abs(estimates.mean(axis=0) - expected)
    p = 2 * stats.t.sf(off / np.maximum(error, 1e-30), len(estimates) - 1)
    near = off < 2e-4 * np.abs(expected)  # that is how exact the sums are
    assert (near | (p > sidak(comparisons))).all(), f"{estimates.mean(axis=0)} and not {expected}, p = {p}"


def estimates(name: str, estimate: Callable[..., mi.Spectrum]) -> NDArray[np.float64]:
    """The means (runs, 3) of ``estimate`` over lanes; samples may be shared by these. Some lanes have nothing to do."""
    sampler, found, active = mi.load_dict({"type": "independent"}), [], np.arange(LANES) % 8 > 0
    for run in range(RUNS):
        sampler.seed(run, LANES)
        si, bsdf = point(LANES, name)
        lanes = estimate(sampler, si, bsdf, mi.Bool(active)).numpy().astype(np.float64)
        assert np.isfinite(lanes).all() and (lanes[:, ~active] == 0).all()
        found.append(lanes[:, active].mean(axis=1))
    return np.array(found)


# ------------------------------- The map -------------------------------

TECHNIQUES: list[tuple[str, str, dict[str, Any]]] = [
    ("roughplastic", "stratified", {"strata": 1}),
    ("roughplastic", "stratified", {"strata": 5, "proposals": 3}),
    ("roughconductor", "stratified", {"strata": 5, "bsdf_samples": 2}),
    ("roughconductor", "stratified", {"strata": 3, "proposals": 4, "bsdf_samples": 1}),
    ("roughplastic", "importance", {"samples": 3}),
    ("roughplastic", "importance", {"samples": 1, "proposals": 2}),
    ("roughconductor", "importance", {"samples": 3, "bsdf_samples": 2, "sequence": "independent"}),
    ("roughplastic", "importance", {"samples": 3, "proposals": 8}),
    ("roughconductor", "importance", {"samples": 2, "proposals": 8, "bsdf_samples": 2}),
    ("roughplastic", "wavelet", {"samples": 3, "resolution": 8}),
    ("roughconductor", "wavelet", {"samples": 5, "resolution": 16}),
]


@cache
def of_map(variant: str, name: str, opacity: float, roughness: float | None = None) -> NDArray[np.float64]:
    scene, ball = loaded(), loaded(sky=False, ball=BALL)
    light = mi.load_dict({"type": "direct_stratified", "strata": 1}).prepare(scene)
    si = dr.zeros(mi.SurfaceInteraction3f)

    def arriving(ray: mi.Ray3f) -> mi.Spectrum:
        V = dr.select(ball.ray_test(ray), (1 - opacity) ** 2, mi.Float(1))  # it has two walls
        return light.radiance_towards(ray.d, si, mi.Bool(True)) * V

    return summed(name, arriving, None if roughness is None else rough(roughness))


@pytest.mark.parametrize(("name", "technique", "properties"), TECHNIQUES)
def test_light_of_the_map(name: str, technique: str, properties: dict[str, Any]) -> None:
    scene = loaded(ball=BALL)
    integrator = mi.load_dict({"type": f"direct_{technique}", **properties})
    light = integrator.prepare(scene)
    found = estimates(name, lambda *point: integrator.environment_light(scene, light, *point))
    assert_mean(found, of_map(mi.variant(), name, 1.0), 3 * len(TECHNIQUES))


@pytest.mark.parametrize("bsdf_samples", [0, 2])
def test_light_of_the_map_through_masks(bsdf_samples: int) -> None:
    from stratalux.integrators.straight import Obstacles  # of the active variant

    scene = loaded(ball={**BALL, "bsdf": {"type": "mask", "opacity": 0.4, "inside": {"type": "diffuse"}}})
    integrator = mi.load_dict({"type": "direct_stratified", "strata": 3, "bsdf_samples": bsdf_samples})
    light, obstacles = integrator.prepare(scene), Obstacles(scene)
    found = estimates("roughplastic", lambda *point: integrator.environment_light(obstacles, light, *point))
    assert_mean(found, of_map(mi.variant(), "roughplastic", 0.4), 3 * 2)


# ------------------------------- Other emitters -------------------------------


EVEN = {"type": "constant", "radiance": {"type": "rgb", "value": [0.3, 0.2, 0.5]}, "sampling_weight": 0.5}


@pytest.mark.parametrize(
    ("name", "masked", "around"),
    [
        ("plastic", False, "map"),
        ("plastic", True, "map"),
        ("roughconductor", True, "even"),
        ("roughplastic", False, "nothing"),
        ("mirror", False, "map"),
    ],
)
def test_light_of_lamps(name: str, masked: bool, around: str) -> None:
    """A map is not theirs, but for what a delta lobe finds of it; another environment is one of them."""
    from stratalux.integrators.other_emitters import OtherEmitters
    from stratalux.integrators.straight import Obstacles

    half = {"type": "mask", "opacity": 0.4, "inside": {"type": "diffuse", "reflectance": 0.0}}
    veils = {} if not masked else {
        "veil": {"type": "rectangle", "to_world": T().translate([0, 0, 0.3]).scale([0.4, 8, 1]), "bsdf": half},
        "second": {"type": "rectangle", "to_world": T().translate([0.5, 0, 0.35]).scale([0.6, 8, 1]), "bsdf": half},
    }  # fmt: skip
    even = {"even": EVEN} if around == "even" else {}
    scene = loaded(around == "map", point=POINT, **LAMPS, **veils, **even)
    lamps, shapes = loaded(sky=False, **LAMPS), [loaded(sky=False, veil=veil) for veil in veils.values()]
    obstacles = Obstacles(scene) if masked else None
    others = OtherEmitters(scene, around == "map", obstacles=obstacles)
    assert others.lights and others.found_by_bsdf

    def through(ray: mi.Ray3f) -> mi.Float:
        V = mi.Float(1)
        for veil in shapes:
            V *= dr.select(veil.ray_test(ray), 0.6, mi.Float(1))
            dr.eval(V)  # OptiX knows one scene in each kernel
        return V

    def arriving(ray: mi.Ray3f) -> mi.Spectrum:
        hit = lamps.ray_intersect(ray)
        dr.eval(hit)
        beyond = mi.Spectrum(*EVEN["radiance"]["value"]) if even else mi.Spectrum(0)
        return dr.select(hit.is_valid(), hit.shape.emitter().eval(hit), beyond) * through(ray)

    expected = summed(name, arriving)
    si, bsdf = point(1, name)
    to_light = mi.Vector3f(*POINT["position"])
    ray = si.spawn_ray_to(mi.Point3f(to_light))
    intensity = mi.Spectrum(*POINT["intensity"]["value"]) / dr.squared_norm(to_light)
    lit = bsdf.eval(mi.BSDFContext(), si, dr.normalize(to_light)) * intensity * through(ray)
    assert not lamps.ray_test(ray).numpy().any() and lit.numpy().any() == (name != "mirror")
    expected += lit.numpy().ravel()
    if name in ("plastic", "mirror"):
        mirrored = si.spawn_ray(mi.reflect(si.wi))
        bs, weight = bsdf.sample(mi.BSDFContext(), si, mi.Float(0.0), mi.Point2f(0.5))
        assert mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta).numpy().all()
        unveiled = loaded(around == "map", **LAMPS)
        hit = unveiled.ray_intersect(mirrored)
        assert hit.is_valid().numpy().all() == (name == "plastic")
        expected += (weight * bs.pdf * hit.emitter(unveiled).eval(hit)).numpy().ravel() * through(mirrored).numpy()

    def both(sampler: mi.Sampler, *at: Any) -> mi.Spectrum:
        return others.emitter_sampling(scene, sampler, *at) + others.bsdf_sampling(scene, sampler, *at)

    assert_mean(estimates(name, both), expected, 3 * 5)


# ------------------------------- Derivatives -------------------------------

STEP = 0.01


def slope(at: Callable[[float], NDArray[np.float64]]) -> NDArray[np.float64]:
    """Of the sum of channels with the ``roughness``, by a difference."""
    ends = [float(at(0.3 + step).sum()) for step in (-STEP, STEP)]
    return np.array([(ends[1] - ends[0]) / (2 * STEP)])


def slopes(
    of: mi.Scene, estimate: Callable[..., mi.Spectrum], key: str = "alpha", value: float = 0.3
) -> NDArray[np.float64]:
    """Derivatives (runs, 1) of the sum of the channels of ``estimate`` with what the ball is made of: its roughness."""
    params, found = mi.traverse(of), []
    sampler = mi.load_dict({"type": "independent"})
    kind = type(params[f"ball.bsdf.{key}.value"])
    ball = next(shape for shape in of.shapes() if shape.id() == "ball")
    bsdf = dr.gather(mi.BSDFPtr, mi.BSDFPtr(ball.bsdf()), dr.zeros(mi.UInt32, 4 * LANES))
    for run in range(RUNS):
        parameter = mi.Float(value)
        dr.enable_grad(parameter)
        params[f"ball.bsdf.{key}.value"] = kind(parameter)
        params.update()
        sampler.seed(run, 4 * LANES)
        si, _ = point(4 * LANES, "roughconductor")
        dr.backward(dr.sum(dr.sum(estimate(sampler, si, bsdf, mi.Bool(True)))) / (4 * LANES))
        found.append(dr.grad(parameter).numpy().astype(np.float64))
    params[f"ball.bsdf.{key}.value"] = kind(value)  # or all scenes that live had derivatives
    params.update()
    return np.array(found)


def rough(roughness: float) -> mi.BSDF:
    return mi.load_dict({**MATERIALS["roughconductor"], "alpha": roughness})


@pytest.mark.parametrize(
    ("technique", "properties"),
    [
        pytest.param("stratified", {"strata": 3, "proposals": 2, "bsdf_samples": 2}, marks=pytest.mark.slow),
        ("importance", {"samples": 3, "proposals": 6, "bsdf_samples": 2}),
        pytest.param("wavelet", {"samples": 4, "resolution": 8}, marks=pytest.mark.slow),
    ],
)
def test_derivatives_of_light_of_the_map(technique: str, properties: dict[str, Any]) -> None:
    of = loaded(ball={**BALL, "bsdf": {**MATERIALS["roughconductor"], "id": "rough"}})
    integrator = mi.load_dict({"type": f"direct_{technique}", **properties})

    def estimate(*at: Any) -> mi.Spectrum:
        light = integrator.prepare(of)
        assert light.differentiated
        return integrator.environment_light(of, light, *at)

    expected = slope(lambda roughness: of_map(mi.variant(), "roughconductor", 1.0, roughness))
    assert_mean(slopes(of, estimate), expected, 4, 0.04)


def test_derivatives_of_light_of_lamps() -> None:
    from stratalux.integrators.other_emitters import OtherEmitters

    of = loaded(ball={**BALL, "bsdf": {**MATERIALS["roughconductor"], "id": "rough"}}, **LAMPS)
    others, lamps = OtherEmitters(of, True, True), loaded(False, ball=BALL, **LAMPS)

    def arriving(ray: mi.Ray3f) -> mi.Spectrum:
        hit = lamps.ray_intersect(ray)
        return dr.select(hit.is_valid(), hit.shape.emitter().eval(hit), 0)

    def both(sampler: mi.Sampler, *at: Any) -> mi.Spectrum:
        return others.emitter_sampling(of, sampler, *at) + others.bsdf_sampling(of, sampler, *at)

    expected = slope(lambda roughness: summed("roughconductor", arriving, rough(roughness)))
    assert_mean(slopes(of, both), expected, 4, 0.04)


GREY = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}


def test_what_is_black_can_learn_to_reflect_the_map() -> None:
    """Its light is in proportion to the reflectance, the samples' q is 0."""
    of = loaded(ball={**BALL, "bsdf": {**GREY, "id": "grey"}})
    integrator = mi.load_dict({"type": "direct_importance", "samples": 3, "proposals": 6, "bsdf_samples": 1})
    expected = np.array([of_map(mi.variant(), "white", 1.0).sum()])
    found = slopes(
        of, lambda *at: integrator.environment_light(of, integrator.prepare(of), *at), "reflectance", value=0.0
    )
    assert_mean(found, expected, 2)


def test_what_is_black_can_learn_to_reflect_lamps() -> None:
    from stratalux.integrators.other_emitters import OtherEmitters

    of, lamps = loaded(ball={**BALL, "bsdf": {**GREY, "id": "grey"}}, **LAMPS), loaded(False, ball=BALL, **LAMPS)
    others = OtherEmitters(of, True, True)

    def arriving(ray: mi.Ray3f) -> mi.Spectrum:
        hit = lamps.ray_intersect(ray)
        return dr.select(hit.is_valid(), hit.shape.emitter().eval(hit), 0)

    def both(sampler: mi.Sampler, *at: Any) -> mi.Spectrum:
        return others.emitter_sampling(of, sampler, *at) + others.bsdf_sampling(of, sampler, *at)

    expected = np.array([summed("white", arriving).sum()])
    assert_mean(slopes(of, both, "reflectance", value=0.0), expected, 2)
