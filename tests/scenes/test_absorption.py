"""Glass that absorbs: what is left of a white world behind a slab."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from stratalux.scenes.absorption import absorbing
from stratalux.scenes.model import NONE, ONE, Material, Part
from tests.scenes.models import parts, seen
from tests.variants import MONO

EVEN = {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}}
COLOUR, DISTANCE, THICK = (0.2, 0.5, 1.0), 0.6, 0.4
BOX = [[x, y, z] for z in (-THICK / 2, THICK / 2) for y in (-2.0, 2.0) for x in (-2.0, 2.0)]
SIDES = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]


def slab(bsdf: Any) -> dict[str, Any]:
    """At right angles to what is seen, and larger."""
    place = mi.ScalarTransform4f().scale([2, 2, THICK / 2])
    return {"slab": {"type": "cube", "to_world": place, "bsdf": bsdf}, "even": EVEN}


def white_behind(kept: Any, ior: float = 1.5) -> Any:
    """What a slab that keeps so much of the light on the way through shows of a world that is 1 everywhere."""
    R = ((ior - 1) / (ior + 1)) ** 2
    inside = 1 - (R * kept) ** 2
    return (1 - R) ** 2 * kept / inside + R + R * (1 - R) ** 2 * kept**2 / inside


@pytest.mark.parametrize("integrator", ["path", "path_stratified"])
def test_light_that_is_left_behind_a_slab(integrator: str) -> None:
    image = seen(slab(absorbing({"type": "dielectric", "int_ior": 1.5}, COLOUR, DISTANCE)), integrator, 256)
    expected = white_behind(np.array(COLOUR) ** (THICK / DISTANCE))
    np.testing.assert_allclose(image[2:6, 2:6, :3].mean(axis=(0, 1)), expected, rtol=0.01)


def test_a_way_of_a_known_length() -> None:
    """From within, and not from outside; where the way has no length, nothing is left out."""
    bsdf = absorbing({"type": "roughdielectric", "alpha": 0.3}, (0.25, 1, 0), 2.0)
    plain = mi.load_dict({"type": "roughdielectric", "alpha": 0.3})
    si = dr.zeros(mi.SurfaceInteraction3f, 4)
    si.t = mi.Float([1, 4, 1, dr.inf])
    si.wi = dr.normalize(mi.Vector3f([0.1] * 4, 0.2, mi.Float([-1, -1, 1, -1])))
    si.sh_frame = mi.Frame3f(mi.Normal3f(0, 0, 1))
    wo, context = dr.normalize(mi.Vector3f(0.1, -0.1, mi.Float([1, 1, -1, 1]))), mi.BSDFContext()
    share = np.array([[0.5, 0.0625, 1, 1], [1, 1, 1, 1], [0, 0, 1, 1]])
    ours, theirs = (b.eval(context, si, wo).numpy() for b in (bsdf, plain))
    assert (theirs > 0).all()
    np.testing.assert_allclose(ours, theirs * share, atol=1e-3 * theirs.max())
    both, pdf = bsdf.eval_pdf(context, si, wo)
    np.testing.assert_array_equal(both.numpy(), ours)
    np.testing.assert_array_equal(pdf.numpy(), plain.pdf(context, si, wo).numpy())
    u = mi.Float([0.3] * 4), mi.Point2f(0.4, 0.6)
    (drawn, weight), (same, full) = (b.sample(context, si, *u) for b in (bsdf, plain))
    np.testing.assert_array_equal(drawn.wo.numpy(), same.wo.numpy())
    np.testing.assert_allclose(weight.numpy(), full.numpy() * share, atol=1e-3)


def test_one_channel() -> None:
    mi.set_variant(MONO)
    bsdf, si = absorbing({"type": "dielectric"}, (0.25, 0.25, 0.25), 1.0), dr.zeros(mi.SurfaceInteraction3f)
    si.t, si.wi = mi.Float(2), mi.Vector3f(0, 0, -1)
    _, weight = bsdf.sample(mi.BSDFContext(), si, mi.Float(0.9), mi.Point2f(0.5))
    _, full = bsdf.nested.sample(mi.BSDFContext(), si, mi.Float(0.9), mi.Point2f(0.5))
    assert weight[0][0] == pytest.approx(0.0625 * full[0][0], rel=1e-3)


@pytest.mark.parametrize("thin", [False, True])
def test_glass_of_a_file(thin: bool) -> None:
    """In the colour that it says, where it has an inside."""
    faces = np.array([face for a, b, c, d in SIDES for face in ([a, b, c], [a, c, d])])
    glass = Material(
        metallic=NONE, roughness=NONE, transmission=ONE, thin=thin, attenuation=COLOUR, attenuation_distance=DISTANCE
    )
    image = seen({**parts(Part(np.array(BOX), faces, material=glass)), "even": EVEN}, "path_stratified", 256)
    kept = np.array(COLOUR) ** (0.0 if thin else THICK / DISTANCE)
    found = image[2:6, 2:6, :3].mean(axis=(0, 1))
    if thin:
        np.testing.assert_allclose(found, 1, rtol=0.02)
    else:
        np.testing.assert_allclose(found, white_behind(kept), rtol=0.05)
