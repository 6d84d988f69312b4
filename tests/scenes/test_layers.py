"""Coats and sheen: their known values, that they keep what energy there is, and that samples follow their density."""

from __future__ import annotations

import math
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from mitsuba.chi2 import ChiSquareTest, SphericalDomain

from stratalux.scenes.layers import SMOOTHEST, albedos, coated, sheened
from tests.variants import MONO, SPECTRAL

WHITE, BLACK = ({"type": "diffuse", "reflectance": {"type": "rgb", "value": value}} for value in (1.0, 0.0))
COLOUR = (0.9, 0.3, 0.0)
SIGNIFICANCE = 0.01


def seen_at(cos: float, count: int = 1) -> mi.SurfaceInteraction3f:
    """What is seen at an angle to its normal, z."""
    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.wi = mi.Vector3f(math.sqrt(1 - cos * cos), 0, cos)
    si.sh_frame = mi.Frame3f(mi.Normal3f(0, 0, 1))
    si.dp_du = mi.Vector3f(1, 0, 0)
    return si


def reflected(bsdf: mi.BSDF, cos: float, count: int = 1 << 19) -> Any:
    """How much of an even light is reflected, of each channel, by samples."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, count)
    _, weight = bsdf.sample(mi.BSDFContext(), seen_at(cos, count), sampler.next_1d(), sampler.next_2d())
    assert np.isfinite(weight.numpy()).all()
    return weight.numpy().mean(axis=1)


def rgb(*colour: float) -> dict[str, Any]:
    return {"type": "rgb", "value": list(colour)}


def khronos(cos_i: float, cos_o: float, cos_h: float, roughness: float) -> float:
    """D V of KHR_materials_sheen, as its text has them."""
    alpha = roughness * roughness

    def mix(x: float, y: float) -> float:
        a = (1 - alpha) * (1 - alpha)
        return x * (1 - a) + y * a

    def low(x: float) -> float:
        a, b, c = mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801)
        return a / (1 + b * x**c) + mix(-1.97760, -1.27393) * x + mix(-4.32054, -4.85967)

    def shadowing(x: float) -> float:
        return math.exp(low(x)) if x < 0.5 else math.exp(2 * low(0.5) - low(1 - x))

    D = (2 + 1 / alpha) * (1 - cos_h * cos_h) ** (0.5 / alpha) / (2 * math.pi)
    return D / ((1 + shadowing(cos_i) + shadowing(cos_o)) * 4 * cos_i * cos_o)


@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
def test_fibres_reflect_as_khronos_has_it(roughness: float) -> None:
    for cos_i, cos_o, turned in ((0.9, 0.8, 0.0), (0.3, 0.6, math.pi), (0.4, 0.2, 2.0)):
        si = seen_at(cos_i)
        sin_o = math.sqrt(1 - cos_o * cos_o)
        wo = mi.Vector3f(sin_o * math.cos(turned), sin_o * math.sin(turned), cos_o)
        cos_h = float(dr.normalize(si.wi + wo).z[0])
        bsdf = sheened(BLACK, rgb(*COLOUR), roughness)
        expected = np.array(COLOUR) * khronos(cos_i, cos_o, cos_h, roughness) * cos_o
        np.testing.assert_allclose(bsdf.eval(mi.BSDFContext(), si, wo).numpy()[:, 0], expected, rtol=1e-3)


@pytest.mark.parametrize("roughness", [0.0, 0.12, 0.5, 1.0])
@pytest.mark.parametrize("cos", [0.02, 0.1, 0.5, 1.0])
def test_white_under_sheen_neither_gains_nor_loses(roughness: float, cos: float) -> None:
    """Of the channel that fibres take most; of the others, they take as much, and reflect less."""
    found = reflected(sheened(WHITE, rgb(1, 0.5, 0), roughness), cos)
    assert found[0] == pytest.approx(1, abs=0.01)
    taken = 1 - found[2]
    assert found[1] == pytest.approx(1 - taken / 2, abs=0.01)
    row = (max(roughness, SMOOTHEST) - SMOOTHEST) / (1 - SMOOTHEST) * (len(albedos()) - 1)
    nearest = albedos()[round(row), round(math.sqrt(cos) * (albedos().shape[1] - 1))]
    assert taken == pytest.approx(min(nearest, 1), abs=0.07)


def test_a_coat_reflects_what_glass_does() -> None:
    """4 % head on, and at a grazing angle nearly all, of its own colour; what is below gets the rest."""
    for cos, least, most in ((1.0, 0.0399, 0.0401), (0.1, 0.5, 0.7)):
        share = float(mi.fresnel(mi.Float(cos), 1.5)[0][0])
        assert least < share < most
        assert reflected(coated(BLACK, 1.0, 0.05), cos)[0] == pytest.approx(share, rel=0.03)
        assert reflected(coated(BLACK, 0.5, 0.05), cos)[0] == pytest.approx(share / 2, rel=0.03)
        below = {"type": "diffuse", "reflectance": rgb(0.2, 0.4, 0.6)}
        found = reflected(coated(below, 1.0, 0.05), cos)
        np.testing.assert_allclose(found, share + (1 - share) * np.array([0.2, 0.4, 0.6]), rtol=0.03)


@pytest.mark.parametrize("roughness", [0.0, 0.3, 1.0])
def test_white_under_a_coat_never_gains(roughness: float) -> None:
    for cos in (0.05, 0.3, 1.0):
        found = reflected(coated(WHITE, 1.0, roughness), cos)[0]
        assert (0.6 if roughness == 1 else 0.85) < found < 1.002


def test_normals_of_a_coat_turn_its_reflection_alone() -> None:
    normals = mi.load_dict({"type": "rgb", "value": [0.5 + 0.3, 0.5, 0.5 + 0.4]})  # (0.6, 0, 0.8)
    turned, straight = coated(WHITE, 1.0, 0.1, normals), coated(WHITE, 1.0, 0.1)
    below = mi.load_dict(WHITE)
    si = seen_at(0.8)  # along the turned normal: what comes back along it is mirrored
    towards, away = si.wi, mi.Vector3f(-0.6, 0, 0.8)
    for bsdf, bright, dark in ((turned, towards, away), (straight, away, towards)):
        value = {name: bsdf.eval(mi.BSDFContext(), si, wo)[0][0] for name, wo in (("bright", bright), ("dark", dark))}
        assert value["bright"] > 1
        assert value["dark"] < below.eval(mi.BSDFContext(), si, dark)[0][0]
    # The share is that of the turned normal, too.
    lost = 1 - turned.eval(mi.BSDFContext(), si, away)[0][0] / below.eval(mi.BSDFContext(), si, away)[0][0]
    assert lost == pytest.approx(0.04, abs=0.001)


@pytest.mark.parametrize("cos", [0.15, 0.8])
@pytest.mark.parametrize("kind", ["sheen", "coat"])
def test_samples_follow_their_density(kind: str, cos: float) -> None:
    """χ² of directions, at a significance level of 1 % for all four together."""
    bsdf = sheened(WHITE, rgb(*COLOUR), 0.4) if kind == "sheen" else coated(WHITE, 1.0, 0.4)
    count = 200_000

    def sample(numbers: Any) -> tuple[mi.Vector3f, mi.Float]:
        si = seen_at(cos, dr.width(numbers))
        bs, weight = bsdf.sample(mi.BSDFContext(), si, numbers[0], [numbers[1], numbers[2]])
        return bs.wo, dr.select(dr.any(weight > 0), mi.Float(1), 0)  # a coat's may be below the horizon

    def density(wo: mi.Vector3f) -> mi.Float:
        return bsdf.pdf(mi.BSDFContext(), seen_at(cos, dr.width(wo)), wo)

    test = ChiSquareTest(SphericalDomain(), sample, density, sample_dim=3, sample_count=count, res=40, ires=16)
    assert test.run(significance_level=SIGNIFICANCE, test_count=4, quiet=True), test.messages


@pytest.mark.parametrize("variant", [MONO, SPECTRAL])
def test_one_channel_and_spectra(variant: str) -> None:
    mi.set_variant(variant)
    for bsdf in (sheened(WHITE, rgb(0.5, 0.5, 0.5), 0.5), coated(WHITE, 1.0, 0.3)):
        assert reflected(bsdf, 0.5, 1 << 14)[0] == pytest.approx(0.95, abs=0.06)


def test_the_colour_is_that_of_what_is_below() -> None:
    below = {"type": "diffuse", "reflectance": rgb(0.2, 0.4, 0.6)}
    for bsdf in (sheened(below, rgb(1, 1, 1), 0.5), coated(below, 1.0, 0.3)):
        np.testing.assert_allclose(bsdf.eval_diffuse_reflectance(seen_at(1.0)).numpy()[:, 0], [0.2, 0.4, 0.6])


def test_nothing_from_behind() -> None:
    """What is below has the back to itself."""
    si = seen_at(1.0)
    si.wi = mi.Vector3f(0.1, 0, -1)
    glass = {"type": "roughdielectric", "alpha": 0.3}
    plain = mi.load_dict(glass).eval(mi.BSDFContext(), si, mi.Vector3f(0.2, 0, 1))
    for bsdf in (sheened(glass, rgb(1, 1, 1), 0.5), coated(glass, 1.0, 0.3)):
        np.testing.assert_allclose(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(0.2, 0, 1)).numpy(), plain.numpy())


def test_what_goes_straight_through_is_less_by_what_a_coat_reflects() -> None:
    thin = mi.load_dict({"type": "thindielectric"})
    si = seen_at(0.6)
    share = mi.fresnel(mi.Float(0.6), 1.5)[0]
    expected = thin.eval_null_transmission(si) * (1 - share)
    assert expected[0][0] > 0.5
    np.testing.assert_allclose(coated(thin, 1.0, 0.1).eval_null_transmission(si).numpy(), expected.numpy(), rtol=1e-5)
