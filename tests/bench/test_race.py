"""Interpolation, envelopes and ratios of the benchmark, against power laws that are known."""

from __future__ import annotations

import math

import pytest

from stratalux.bench.race import Curve, envelope, geometric_mean, race


def power_law(factor: float, slope: float, times: tuple[float, ...] = (0.1, 0.4, 1.6)) -> Curve:
    """error = factor · time^−slope, sampled at ``times``."""
    return Curve(tuple((time, factor * time**-slope) for time in times))


@pytest.mark.parametrize("slope", [0.5, 1.0, 1.7])
@pytest.mark.parametrize("time", [0.1, 0.13, 0.4, 1.1, 1.6])
def test_a_power_law_is_interpolated_exactly(slope: float, time: float) -> None:
    reach = power_law(2e-3, slope).reach(2e-3 * time**-slope)
    assert reach.seconds == pytest.approx(time)
    if time not in (0.1, 1.6):  # at the ends, rounding decides
        assert not reach.outside


def test_beyond_its_end_a_curve_goes_on_along_the_last_segment() -> None:
    reach = power_law(1, 1.5).reach(6.4**-1.5)
    assert reach.seconds == pytest.approx(6.4) and reach.outside


def test_beyond_its_end_a_curve_converges_at_least_like_independent_samples() -> None:
    flat = Curve(((0.1, 1.0), (0.4, 0.5), (1.6, 0.49)))
    reach = flat.reach(0.049)
    assert reach.seconds == pytest.approx(16) and reach.outside


def test_before_its_start_a_curve_falls_at_most_like_independent_samples() -> None:
    reach = power_law(1, 2).reach(10 * 0.1**-2)
    assert reach.seconds == pytest.approx(0.01) and reach.outside
    assert power_law(1, 0.5).reach(10 * 0.1**-0.5).seconds == pytest.approx(0.001)


def test_a_single_point_goes_on_like_independent_samples_on_both_sides() -> None:
    one = Curve(((2.0, 0.1),))
    assert one.reach(0.05).seconds == pytest.approx(4) and one.reach(0.2).seconds == pytest.approx(1)
    assert one.reach(0.1).seconds == 2 and not one.reach(0.1).outside


def test_points_that_are_beaten_in_time_and_error_do_not_count() -> None:
    assert Curve(((1.6, 0.01), (0.4, 0.2), (0.1, 0.1))).front == ((0.1, 0.1), (1.6, 0.01))


def test_the_envelope_changes_sides_where_the_curves_cross() -> None:
    # They meet at time 1: slow and steady is ahead before, the steeper one after.
    curves = {"steady": power_law(1, 1, (0.01, 1, 100)), "steep": power_law(1, 2, (0.01, 1, 100))}
    assert envelope(curves, 10.0)[0] == "steady" and envelope(curves, 0.1)[0] == "steep"
    assert envelope(curves, 10.0)[1].seconds == pytest.approx(0.1)
    assert envelope(curves, 0.1)[1].seconds == pytest.approx(math.sqrt(10))


def test_the_ratio_of_two_power_laws_is_that_of_their_times() -> None:
    ours = power_law(1, 1.3).points
    verdict = race(ours, {"theirs": power_law(2.0**1.3, 1.3, (0.05, 0.5, 5))})
    assert verdict is not None and not verdict.outside
    assert [duel.ratio for duel in verdict.duels] == pytest.approx([2, 2, 2])
    assert verdict.ratio == pytest.approx(2) and verdict.winners == ("theirs",)


def test_the_ratio_is_the_geometric_mean_of_the_budgets_against_the_best_of_each() -> None:
    curves = {"steady": power_law(1, 1, (0.001, 1, 1000)), "steep": power_law(1, 2, (0.001, 1, 1000))}
    verdict = race([(0.05, 10.0), (1.0, 0.01)], curves)
    assert verdict is not None
    assert (verdict.lowest, verdict.highest) == (pytest.approx(2), pytest.approx(10))
    assert verdict.ratio == pytest.approx(math.sqrt(20)) and verdict.winners == ("steady", "steep")


def test_a_continued_curve_is_marked_in_the_verdict() -> None:
    curve = power_law(1, 1)
    inside, beyond = race([(0.4, 2.5)], {"a": curve}), race([(0.4, 2.5), (1.6, 0.01)], {"a": curve})
    assert inside is not None and beyond is not None
    assert not inside.outside and [duel.outside for duel in beyond.duels] == [False, True]


def test_without_points_there_is_no_verdict() -> None:
    assert race([], {"a": power_law(1, 1)}) is None
    assert race([(1, 1)], {"a": Curve(())}) is None
    assert math.isnan(geometric_mean([]))
