"""Verdicts follow the figures, both ways."""

from __future__ import annotations

import pytest

from stratalux.reproduce.verdicts import all_of, by_size, by_spread, when


@pytest.mark.parametrize(
    ("ratios", "verdict"),
    [((1.1, 1.2, 1.3), "holds"), ((0.9, 1.2, 1.3), "partly"), ((0.9, 0.95, 1.3), "fails"), ((1.0,), "fails")],
)
def test_ratios_have_to_be_beyond_their_spread(ratios: tuple[float, ...], verdict: str) -> None:
    assert by_spread(ratios) == verdict


def test_bounds_other_than_one() -> None:
    assert by_spread([1.4, 1.6], 1.5) == "fails" and by_spread([1.4, 1.7], 1.5) == "partly"


@pytest.mark.parametrize(
    ("ratios", "verdict"),
    [((2.1, 3.0), "holds"), ((1.9, 3.0), "partly"), ((0.9, 1.2), "partly"), ((0.7, 1.2), "fails")],
)
def test_size_and_direction(ratios: tuple[float, ...], verdict: str) -> None:
    assert by_size(ratios, 2.0) == verdict


def test_cases_of_one_claim() -> None:
    assert all_of(["holds", "holds"]) == "holds"
    assert all_of(["fails", "fails"]) == "fails"
    assert all_of(["holds", "fails"]) == all_of(["partly", "partly"]) == all_of(["holds", "partly"]) == "partly"
    assert when(True) == "holds" and when(False) == "fails"
