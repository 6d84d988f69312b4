"""The registry of techniques."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from stratalux import InputError
from stratalux.integrators.techniques import Property, Technique, parse_technique, techniques
from tests.helpers import scene_dict

NAMES = (
    "stratified",
    "importance",
    "wavelet",
    "median-cut",
    "structured",
    "kmeans",
    "lloyd",
    "penrose",
    "direct",
    "path",
)


def test_all_techniques_of_the_paper_are_there() -> None:
    assert set(NAMES) <= set(techniques())
    for name, technique in techniques().items():
        assert technique.name == name and technique.summary and technique.source


@pytest.mark.parametrize("name", NAMES)
def test_every_technique_renders_and_counts_its_rays(name: str) -> None:
    technique, _ = parse_technique(name)
    given, spp = technique.with_rays(8)
    rays = technique.shadow_rays(given) * spp
    assert rays == 8 or (technique.is_automatic(given) and rays == technique.automatic_rays)
    scene = mi.load_dict(scene_dict("roughplastic"))
    image = np.array(mi.render(scene, integrator=mi.load_dict(technique.integrator(given)), spp=spp))
    assert np.isfinite(image).all() and image.mean() > 0


def test_rays_are_divided_between_the_properties_that_cost_them() -> None:
    stratified, _ = parse_technique("stratified")
    assert stratified.with_rays(16, {"bsdf_samples": 4}) == ({"bsdf_samples": 4, "strata": 12}, 1)
    assert stratified.with_rays(16, {"strata": 4}) == ({"strata": 4}, 4)
    assert stratified.with_rays(10 * stratified.automatic_rays) == ({}, 10)
    path, _ = parse_technique("path")
    assert path.with_rays(16) == ({}, 8)
    direct, given = parse_technique("direct:emitter_samples=1,bsdf_samples=1")
    assert direct.with_rays(6, given) == (given, 3)
    # Of which Mitsuba takes 512 at once
    assert direct.with_rays(513) == ({"emitter_samples": 512}, 1)
    assert direct.with_rays(514) == ({"emitter_samples": 256}, 2)
    assert direct.with_rays(4096) == ({"emitter_samples": 511}, 8)
    assert direct.with_rays(1024, {"bsdf_samples": 512}) == ({"bsdf_samples": 512, "emitter_samples": 512}, 1)
    assert direct.with_rays(4, {"bsdf_samples": 8}) == ({"bsdf_samples": 8, "emitter_samples": 1}, 1)
    assert direct.with_rays(8, {"bsdf_samples": 0}) == ({"bsdf_samples": 0, "emitter_samples": 8}, 1)


def test_values_are_read_by_the_type_of_the_default() -> None:
    _, given = parse_technique("kmeans:lights=5,jitter=true")
    assert given == {"lights": 5, "jitter": True}
    assert parse_technique("kmeans:jitter=False")[1] == {"jitter": False}
    assert Property(0.5, "").parse("2", "x") == 2.0
    assert Property(0.5, "").check(2, "x") == 2.0
    assert Property("a", "", choices=("a", "b")).parse("b", "x") == "b"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nonsense", "technique 'nonsense' is unknown; use one of stratified"),
        ("stratified:strata", "'strata' is not key=value"),
        ("stratified:colour=3", "no property 'colour'; it has strata, proposals"),
        ("path:depth=3", "no property 'depth'; it has max_depth"),
        ("stratified:strata=-1", "strata: -1 is too small; give at least 0"),
        ("stratified:strata=1.5", "strata: '1.5' is not of type int"),
        ("kmeans:jitter=maybe", "jitter: 'maybe' is not of type bool"),
        ("importance:sequence=halton", "sequence: 'halton' is unknown; use one of independent, sobol"),
    ],
)
def test_bad_texts_are_refused(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        parse_technique(text)


def test_settings_refuse_what_the_technique_does_not_have() -> None:
    technique = Technique("a", "b", "c", "d", True, {"n": Property(1, "")})
    with pytest.raises(InputError, match="no property 'm'; it has n"):
        technique.settings({"m": 3})
    with pytest.raises(InputError, match="'x' is not of type int"):
        technique.settings({"n": "x"})
    with pytest.raises(InputError, match="no property 'm'; it has none"):
        Technique("a", "b", "c", "d", True).settings({"m": 3})
    assert technique.settings({"n": 1 << 20}) == {"n": 1 << 20}
    with pytest.raises(InputError, match="n: 1048577 is too large; give at most 1048576"):
        technique.settings({"n": (1 << 20) + 1})


def test_the_first_of_the_properties_that_cost_rays_has_its_own_limit() -> None:
    both = {"few": Property(1, "", minimum=0, maximum=8), "many": Property(1, "", minimum=0)}
    technique = Technique("a", "b", "c", "d", True, both, rays=("few", "many"))
    assert technique.with_rays(17) == ({"few": 8}, 2)
    assert technique.with_rays(9) == ({"few": 8}, 1)
    assert Technique("a", "b", "c", "d", True).with_rays(4) == ({}, 4)


def test_any_property_of_stratified_pins_the_paper_scheme() -> None:
    stratified, _ = parse_technique("stratified")
    automatic = {"strata": 0, "proposals": 0, "bsdf_samples": -1}
    assert stratified.settings() == stratified.settings({"strata": 0}) == automatic
    assert stratified.is_automatic() and not stratified.is_automatic({"bsdf_samples": 0})
    assert stratified.settings({"strata": 16}) == {"strata": 16, "proposals": 1, "bsdf_samples": 0}
    assert stratified.settings({"bsdf_samples": 0}) == {"strata": 64, "proposals": 1, "bsdf_samples": 0}
    assert stratified.settings({"proposals": 4, "bsdf_samples": 2}) == {"strata": 64, "proposals": 4, "bsdf_samples": 2}


RAYS = {"samples": (16, 1), "bsdf_samples": (0, 0)}
SAID: dict[str, tuple[bool, dict[str, tuple[Any, float | None]]]] = {
    "stratified": (True, {"strata": (0, 0), "proposals": (0, 0), "bsdf_samples": (-1, -1)}),
    "importance": (True, {**RAYS, "proposals": (1, 1), "sequence": ("sobol", None)}),
    "wavelet": (True, {"samples": (16, 1), "resolution": (16, 8)}),
    "direct": (True, {"emitter_samples": (1, 0), "bsdf_samples": (1, 0)}),
    "path": (True, {"max_depth": (2, -1)}),
    "path-stratified": (True, {"max_depth": (-1, -1), "rr_depth": (5, 1)}),
    "median-cut": (False, {"lights": (64, 1), "jitter": (False, None)}),
}


@pytest.mark.parametrize("name", SAID)
def test_what_techniques_say_of_themselves(name: str) -> None:
    """Whether they are unbiased, and the defaults of their properties and the least that these can be."""
    technique, _ = parse_technique(name)
    unbiased, properties = SAID[name]
    assert technique.unbiased == unbiased
    assert {key: (prop.default, prop.minimum) for key, prop in technique.properties.items()} == properties


def test_products_are_formed_in_a_power_of_two_of_cells() -> None:
    for resolution in (8, 16, 32):
        assert mi.load_dict({"type": "direct_wavelet", "resolution": resolution}).resolution == resolution
    for resolution in (12, 64):
        with pytest.raises((InputError, RuntimeError)) as stop:
            mi.load_dict({"type": "direct_wavelet", "resolution": resolution})
        assert f"{resolution} is not one of 8, 16 and 32" in str(stop.value) + str(stop.value.__cause__)


def test_direct_takes_samples_of_some_kind() -> None:
    with pytest.raises(InputError, match="emitter_samples and bsdf_samples are all 0"):
        parse_technique("direct")[0].settings({"emitter_samples": 0, "bsdf_samples": 0})
