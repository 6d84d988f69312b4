"""What launches add up to, and what their halves tell of the error."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from stratalux.integrators.sums import Sums, added_noise


@pytest.mark.parametrize("channels", [2, 4, 5])
def test_the_mean_of_all_and_what_an_older_and_a_younger_half_tell(channels: int) -> None:
    rng = np.random.default_rng(1)
    launches = rng.random((5, 3, 2, channels)) + 0.5
    launches[..., -1] = 2
    memory: dict[str, Any] = {}
    sums = Sums(memory)
    assert sums.launches == 0 and sums.noise() is None
    colours = 3 if channels > 3 else 1
    grey = launches[..., :colours].mean(axis=-1) / 2
    told = {2: (grey[0] - grey[1]) / 2, 4: (grey[:2].mean(axis=0) - grey[2:4].mean(axis=0)) / 2}
    told[3], told[5] = told[2] * np.sqrt(2 / 3), told[4] * np.sqrt(4 / 5)
    for k, raw in enumerate(launches, 1):
        sums.add(raw)
        assert sums.launches == k
        if k in told:
            np.testing.assert_allclose(sums.noise(), told[k], rtol=1e-4, atol=1e-7)
    total = launches.sum(axis=0)
    np.testing.assert_allclose(sums.image(), total / total[..., -1:], rtol=1e-6)
    again = Sums(memory)  # goes on where the other was
    np.testing.assert_array_equal(again.image(), sums.image())
    np.testing.assert_array_equal(again.noise(), sums.noise())


@pytest.mark.parametrize("launches", [2, 16, 24])
def test_it_is_the_standard_error_of_independent_launches(launches: int) -> None:
    rng = np.random.default_rng(2)
    sums = Sums({})
    for _ in range(launches):
        raw = np.ones((100, 100, 4))
        raw[..., :3] = rng.normal(1, 0.4, (100, 100, 1))
        sums.add(raw)
    noise = sums.noise()
    assert noise is not None and np.sqrt(np.mean(noise**2)) == pytest.approx(0.4 / np.sqrt(launches), rel=0.03)


def test_what_one_half_has_not_seen_is_not_known() -> None:
    """And where samples are shared out otherwise, each counts as much as any."""
    first, second = np.ones((1, 3, 4)), np.ones((1, 3, 4))
    first[0, :, -1], second[0, :, -1] = [1, 0, 3], [1, 4, 1]
    first[..., :3] *= first[..., -1:]
    second[..., :3] *= 2 * second[..., -1:]
    sums = Sums({})
    sums.add(first)
    sums.add(second)
    np.testing.assert_allclose(sums.noise(), [[-1 / 2, np.nan, -np.sqrt(3) / 4]], rtol=1e-6)


def test_pixels_without_weight_are_black() -> None:
    sums = Sums({})
    sums.add(np.zeros((1, 2, 4)))
    sums.add(np.zeros((1, 2, 4)))
    np.testing.assert_array_equal(sums.image(), 0)
    assert sums.noise() is None


def test_of_two_pictures() -> None:
    a = np.ones((1, 1), dtype=np.float32)
    assert added_noise(None, a) is None and added_noise(a, None) is None
    np.testing.assert_array_equal(added_noise(a, a), 2)
