"""Every technique that claims to be unbiased, as the registry lists them, against an estimator of another family."""

from __future__ import annotations

from itertools import product

import mitsuba as mi
import pytest

from stratalux.integrators.techniques import parse_technique, techniques
from tests.helpers import assert_same_mean, lamp, reference, runs, scene_dict
from tests.variants import MONO, RGB, SPECTRAL

mi.set_variant(RGB)
OF_THEIR_OWN = ("direct", "stratified", "path-stratified")
"""The other side, and those that have tests of their own."""
UNBIASED = [name for name, technique in techniques().items() if technique.unbiased and name not in OF_THEIR_OWN]
SLOW = pytest.mark.slow
RUNS = 32
MATERIALS = ("diffuse", "roughconductor")
VARIATIONS = {
    "stratified:strata=16,bsdf_samples=1": "roughconductor",
    "stratified:strata=5,proposals=8,bsdf_samples=3": None,
    "importance:samples=1": None,
    "importance:samples=7,sequence=independent": None,
    "importance:samples=4,proposals=32": None,
    "importance:samples=1,proposals=9,sequence=independent": None,
    "importance:samples=4,bsdf_samples=2": None,
    "importance:samples=4,proposals=16,bsdf_samples=2": None,
}
"""Properties, and the material that they matter most for: the other one is left to the slow tests. Of what has None,
the quick tests are those at one point."""


@pytest.mark.parametrize(
    ("text", "material"),
    [
        *product(UNBIASED, MATERIALS),
        *(
            pytest.param(text, material, marks=() if material == quick else SLOW)
            for text, quick in VARIATIONS.items()
            for material in MATERIALS
        ),
    ],
)
def test_no_bias(text: str, material: str) -> None:
    technique, given = parse_technique(text)
    scene = mi.load_dict(scene_dict(material))
    spp = max(32, 1024 // technique.shadow_rays(given))
    # Dark pixels of a conductor get their light from few directions, which the samples of a run may have in common.
    shared = technique.name in ("stratified", "importance") and given.get("sequence") != "independent"
    more = 8 if material == "roughconductor" and shared else 1
    assert_same_mean(runs(scene, technique.integrator(given), spp // more, more * RUNS, seed=0), reference(material))


@pytest.mark.parametrize(
    ("material", "text"),
    [
        ("plastic", "stratified:strata=8,bsdf_samples=2"),
        pytest.param("mirror", "importance:samples=8,bsdf_samples=2", marks=SLOW),
        pytest.param("mirror", "stratified:strata=8,bsdf_samples=2", marks=SLOW),
        pytest.param("plastic", "importance:samples=8,bsdf_samples=2", marks=SLOW),
    ],
)
def test_delta_lobes_are_counted_once(text: str, material: str) -> None:
    technique, given = parse_technique(text)
    scene = mi.load_dict(scene_dict(material))
    assert_same_mean(runs(scene, technique.integrator(given), 128, RUNS, 0), reference(material))


@SLOW
@pytest.mark.parametrize("text", ["stratified:strata=8,bsdf_samples=2", "importance:samples=8,bsdf_samples=2"])
def test_area_lights_are_counted_once(text: str) -> None:
    technique, given = parse_technique(text)
    scene = mi.load_dict(scene_dict("roughconductor", lamp=lamp()))
    ours = runs(scene, technique.integrator(given), 256, RUNS, 0)
    assert_same_mean(ours, reference("roughconductor", lit_by_lamp=True))


@SLOW
@pytest.mark.parametrize("text", ["stratified:strata=8,bsdf_samples=1", "importance:samples=4,proposals=16"])
@pytest.mark.parametrize("variant", [MONO, SPECTRAL])
def test_other_variants(variant: str, text: str) -> None:
    mi.set_variant(variant)
    technique, given = parse_technique(text)
    scene = mi.load_dict(scene_dict("roughconductor"))
    ours = runs(scene, technique.integrator(given), 128, RUNS, 0)
    assert_same_mean(ours, reference("roughconductor"))


def test_low_discrepancy_points_beat_independent_ones() -> None:
    scene = mi.load_dict(scene_dict("diffuse"))
    spread = {
        sequence: runs(
            scene,
            parse_technique(f"importance:sequence={sequence}")[0].integrator({"sequence": sequence, "samples": 64}),
            4,
            16,
            0,
        )
        .var(axis=0)
        .mean()
        for sequence in ("sobol", "independent")
    }
    assert spread["sobol"] < 0.8 * spread["independent"]


def test_bsdf_samples_help_on_shiny_surfaces() -> None:
    description = scene_dict("roughconductor")
    description["ball"]["bsdf"] = {"type": "roughconductor", "alpha": 0.05}
    scene = mi.load_dict(description)
    technique, _ = parse_technique("stratified")
    without, with_samples = (
        runs(scene, technique.integrator({"strata": 16, "bsdf_samples": k}), 4, 16, 0).var(axis=0).mean()
        for k in (0, 1)
    )
    assert with_samples < 0.5 * without
