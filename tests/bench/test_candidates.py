"""The cases of the suites, the configurations of the other side, and the search for its best on a fake renderer."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import pytest

from stratalux import InputError
from stratalux.assets import ASSETS
from stratalux.bench.candidates import OURS, Configuration, Trial, mitsuba_configurations, ours, search
from stratalux.bench.cases import FULL, MAPS, MATERIALS, QUICK, SCENES, find_suite
from stratalux.bench.measure import our_ladder
from stratalux.integrators.techniques import parse_technique
from stratalux.scenes.materials import MATERIALS as KNOWN_MATERIALS
from stratalux.scenes.stage import SAMPLERS
from tests.bench.made_up import TINY


def test_full_is_every_map_in_every_material_in_every_scene() -> None:
    assert len(FULL.cases) == len(set(FULL.cases)) == 96
    assert {(c.map, c.material, c.scene) for c in FULL.cases} == {
        (m, material, scene) for m in MAPS for material in MATERIALS for scene in SCENES
    }


def test_quick_has_all_materials_and_scenes_and_several_maps() -> None:
    cases = QUICK.cases
    assert {case.material for case in cases} == set(MATERIALS) and {case.scene for case in cases} == set(SCENES)
    assert len({case.map for case in cases}) >= 3


@pytest.mark.parametrize("suite", [QUICK, FULL])
def test_suites_name_what_exists(suite: object) -> None:
    suite = find_suite(suite)  # type: ignore[arg-type]
    assert len({case.name for case in suite.all_cases}) == len(suite.all_cases)
    assert len(suite.ladder) >= 3 and list(suite.ladder) == sorted(suite.ladder)
    for case in suite.all_cases:
        assert case.map in ASSETS and case.scene in ASSETS and case.material in KNOWN_MATERIALS


def test_an_unknown_suite_is_refused() -> None:
    with pytest.raises(InputError, match="suite 'tiny' is unknown; use one of quick, full"):
        find_suite("tiny")


def test_all_samplers_and_splits_take_part_and_compensation_only_where_it_is_unbiased() -> None:
    configurations = mitsuba_configurations()
    assert {c.sampler for c in configurations} == set(SAMPLERS)
    assert len({c.label for c in configurations}) == len(configurations) == len(SAMPLERS) * 7
    for configuration in (*configurations, OURS):
        technique, given = parse_technique(configuration.technique)
        settings = technique.settings(given)
        if configuration is not OURS:
            assert configuration.rays == settings["emitter_samples"] + settings["bsdf_samples"]
        if configuration.compensated:
            assert settings["emitter_samples"] and settings["bsdf_samples"]


def test_whole_light_is_that_of_path_with_every_sampler_on_both_kinds_of_map() -> None:
    configurations = mitsuba_configurations(8)
    assert {(c.sampler, c.compensated) for c in configurations} == set(product(SAMPLERS, (False, True)))
    assert len({c.label for c in configurations}) == len(configurations)
    for text, name in (*((c.technique, "path") for c in configurations), (ours(8).technique, "path-stratified")):
        technique, given = parse_technique(text)
        assert (technique.name, technique.settings(given)["max_depth"]) == (name, 8)
    assert ours(2) is OURS and not any("path" in c.technique for c in mitsuba_configurations(2))


def test_ours_is_the_default_of_the_package() -> None:
    technique, given = parse_technique(OURS.technique)
    assert technique.name == "stratified" and not given


@pytest.mark.parametrize(("rays", "spp"), [(1, 64), (2, 64), (4, 32), (8, 16), (1000, 1)])
def test_budgets_count_rays(rays: int, spp: int) -> None:
    assert Configuration("direct", "independent", "", rays).spp(64) == spp


def test_the_search_finds_the_best_at_either_budget() -> None:
    names = ["early", "late", "middling", "bad", "worst"]
    configurations = [Configuration("direct", "independent", name) for name in names]
    low, high = TINY.ladder[:2]
    errors = {
        low: {"early": 1.0, "late": 1.5, "middling": 2.0, "bad": 3.0, "worst": 4.0},
        high: {"early": 1.0, "late": 0.2, "middling": 0.5, "bad": 0.01, "worst": 0.01},
    }
    asked: list[tuple[str, int]] = []

    def fake(configuration: Configuration, budget: int) -> Trial:
        asked.append((configuration.label, budget))
        return Trial(configuration, budget, budget, 1.0, errors[budget][configuration.label])

    trials, finalists = search(configurations, replace(TINY, screened=3, finalists=2), fake)
    assert [label for label, budget in asked if budget == low] == names
    assert sorted(label for label, budget in asked if budget == high) == ["early", "late", "middling"]
    assert [finalist.label for finalist in finalists] == ["late", "early"]
    assert len(trials) == 8
    assert [f.label for f in search(configurations, replace(TINY, screened=3, finalists=3), fake)[1]] == [
        "late",
        "middling",
        "early",
    ]


def test_the_search_weighs_time_against_error() -> None:
    quick, slow = (Configuration("direct", "independent", name) for name in ("quick", "slow"))

    def fake(configuration: Configuration, budget: int) -> Trial:
        return Trial(configuration, budget, budget, *((1.0, 1.0) if configuration is quick else (8.0, 0.2)))

    assert search([slow, quick], TINY, fake)[1] == [quick, slow]


@pytest.mark.parametrize(
    ("cost", "targets", "ladder"),
    [
        ((0.0, 0.1), (0.1, 0.4, 1.6), [1, 4, 16]),
        ((0.1, 0.1), (0.2, 0.9, 3.3), [1, 8, 32]),
        ((0.0, 1.0), (0.1, 0.2, 0.3), [1, 2, 4]),
        ((0.0, 0.001), (0.1, 0.1, 0.1), [128, 256, 512]),
    ],
)
def test_our_budgets_span_the_times_of_theirs(
    cost: tuple[float, float], targets: tuple[float, ...], ladder: list[int]
) -> None:
    assert our_ladder(cost, targets) == ladder
