"""What light paths and paths from the camera agree about."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from stratalux.integrators.kinds import made_of
from tests.helpers import MATERIALS, scene_dict, sidak

SIDES = np.array([1.0, 3.0, 0.5])
MIDDLE = np.array([2.0, -1.0, 4.0])


def box(bsdf: dict[str, Any] | None = None) -> Any:
    """The ways of a scene that has one, a cube, under a camera that sees the ground besides."""
    from stratalux.integrators.both_ways import BothWays  # of the active variant

    description = scene_dict("diffuse")
    place = mi.ScalarTransform4f().translate(MIDDLE.tolist()).scale((SIDES / 2).tolist())
    description["box"] = {"type": "cube", "to_world": place, "bsdf": bsdf or MATERIALS["roughconductor"]}
    scene = mi.load_dict(description)
    ways = BothWays.of(scene, scene.sensors()[0], 0.5)
    assert ways is not None
    return ways


directions = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda d: np.linalg.norm(d) > 0.1)


@given(d=directions, u=st.tuples(*[st.floats(0, 1, exclude_max=True)] * 2))
def test_rays_begin_outside_and_meet_the_box(d: tuple[float, ...], u: tuple[float, ...]) -> None:
    ways, ω = box(), np.array(d) / np.linalg.norm(d)
    ray = ways.ray(mi.Vector3f(ω), mi.Point2f(*u))
    o, along = np.ravel(ray.o), np.ravel(ray.d)
    np.testing.assert_allclose(along, -ω, atol=1e-6)
    t = -(o - MIDDLE) @ along  # where it is closest to the middle
    assert np.linalg.norm(o - MIDDLE) > np.linalg.norm(SIDES) / 2
    near = o + along * np.linspace(t - 4, t + 4, 40_001)[:, None]
    assert (np.abs(near - MIDDLE) <= SIDES / 2 + 1e-3).all(axis=1).any()


@pytest.mark.parametrize("d", [(0.3, 0.5, -0.8), (-0.9, 0.1, 0.2), (0.0, 1.0, 0.0)])
def test_rays_are_spread_evenly(d: tuple[float, ...]) -> None:
    """Over the area that the direction sees: a chi-square test of cells of a plane across it."""
    ways, ω = box(), np.array(d) / np.linalg.norm(d)
    count = 1 << 16
    u = np.random.default_rng(1).random((2, count))
    o = np.array(ways.ray(mi.Vector3f(ω), mi.Point2f(*u)).o).T
    frame = np.linalg.svd(ω[None])[2][1:]  # a basis of the plane
    corners = MIDDLE + SIDES / 2 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    low, high = (corners @ frame.T).min(axis=0), (corners @ frame.T).max(axis=0)
    cells = 12
    edges = [np.linspace(a, b, cells + 1) for a, b in zip(low, high, strict=True)]
    found, *_ = np.histogram2d(*(o @ frame.T).T, bins=edges)
    # The share of each cell that the box covers, by rays through a fine grid of it.
    fine = 40
    s, t = (np.linspace(a, b, cells * fine, endpoint=False) + (b - a) / (2 * cells * fine) for a, b in zip(low, high))  # noqa: B905
    p = s[:, None, None] * frame[0] + t[None, :, None] * frame[1] + ω * (MIDDLE @ ω)
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = ((MIDDLE + side * SIDES / 2 - p) / ω for side in (-1, 1))
    inside = np.abs(p - MIDDLE) <= SIDES / 2
    enter = np.where(ω == 0, np.where(inside, -np.inf, np.inf), np.minimum(a, b)).max(axis=-1)
    leave = np.where(ω == 0, np.where(inside, np.inf, -np.inf), np.maximum(a, b)).min(axis=-1)
    covered = (enter <= leave).reshape(cells, fine, cells, fine).mean(axis=(1, 3))
    area = float(np.prod((high - low) / cells)) * covered.sum()
    assert float(ways.area(mi.Vector3f(ω))[0]) == pytest.approx(area, rel=0.01)
    whole = covered > 0.999
    expected = count * covered[whole] / covered.sum()
    _, p_value = stats.chisquare(found[whole], expected * found[whole].sum() / expected.sum())
    assert p_value > sidak(3)


@pytest.mark.parametrize("name", ["diffuse", "roughconductor", "roughplastic", "plastic", "mirror", "two-sided"])
def test_what_is_drawn_one_way_is_drawn_the_other_way(name: str) -> None:
    """Where c counts as 1: or there would be light that no path finds."""
    from stratalux.integrators import both_ways  # of the active variant

    described = {"type": "twosided", "of": MATERIALS["roughconductor"]} if name == "two-sided" else MATERIALS[name]
    bsdf = mi.load_dict(described)
    assert made_of(bsdf, both_ways.ALIKE)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, 1 << 14)
    si = dr.zeros(mi.SurfaceInteraction3f, 1 << 14)
    si.wi = mi.warp.square_to_uniform_sphere(sampler.next_2d())
    wo, ctx = mi.warp.square_to_uniform_sphere(sampler.next_2d()), mi.BSDFContext()
    other = both_ways.turned(si, wo)
    there, back = bsdf.pdf(ctx, si, wo).numpy() > 0, bsdf.pdf(ctx, other, si.wi).numpy() > 0
    lit = (bsdf.eval(ctx, si, wo).numpy() != 0).any(axis=0)
    assert lit.sum() > 1000 or name == "mirror"
    np.testing.assert_array_equal(there[lit], back[lit])
    np.testing.assert_array_equal(lit, (bsdf.eval(ctx, other, si.wi).numpy() != 0).any(axis=0))


def test_what_is_not_known_is_looked_up() -> None:
    from stratalux.integrators import both_ways  # of the active variant

    bumpy = {"type": "bumpmap", "of": MATERIALS["roughconductor"], "texture": {"type": "checkerboard"}}
    for described in ({"type": "principled"}, bumpy):
        assert not made_of(mi.load_dict(described), both_ways.ALIKE)
    assert not made_of(None, both_ways.ALIKE)


def test_the_area_that_a_pixel_sees() -> None:
    """κ of a surface that is looked at straight on, in its numbers."""
    ways = box()
    scene = mi.load_dict(scene_dict("diffuse"))
    sensor = scene.sensors()[0]
    to_world = mi.traverse(sensor)["to_world"].matrix.numpy().reshape(4, 4)
    eye, axis = to_world[:3, 3], to_world[:3, 2]
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.p, si.n = mi.Point3f(eye + 3 * axis), mi.Normal3f(-axis)
    side = 2 * 3 * np.tan(np.radians(40) / 2) / 18  # of a pixel there
    κ = ways.first(si, mi.Vector3f(-axis), mi.Float(0.25))
    assert float(κ[0]) == pytest.approx(0.5 * 18 * 12 * side**2 / 0.25, rel=1e-4)
