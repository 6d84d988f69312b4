"""Numbers that are no radiance."""

from __future__ import annotations

import numpy as np
import pytest

from stratalux import EnvironmentMap, EnvironmentMapWarning
from stratalux.images.repair import LIMIT, repair


def ones() -> np.ndarray:
    return np.ones((4, 8, 3), dtype=np.float32)


def test_infinite_halves_are_the_largest_half() -> None:
    texels = ones().astype(np.float16)
    texels[1, 2] = np.inf
    with pytest.warns(
        EnvironmentMapWarning, match="1 infinite texel.*to 65504, the largest half, so that a sun may be"
    ):
        repaired = EnvironmentMap.from_array(texels, "m").texels
    assert repaired[1, 2].tolist() == [65504] * 3 and repaired[0, 0].tolist() == [1] * 3


def test_infinite_floats_outshine_all_others_by_a_factor_that_is_told() -> None:
    texels = ones()
    texels[1, 2, 0], texels[3, 3] = np.inf, 7
    repaired, said = repair(texels)
    assert repaired[1, 2].tolist() == [70, 1, 1]
    assert "to 70, 10 times the largest other" in said
    repaired, _ = repair(np.where(texels == np.inf, texels, 0))
    assert repaired[1, 2, 0] == 10  # even where nothing else shines
    texels[3, 3] = LIMIT
    assert repair(texels)[0].max() == np.float32(LIMIT)


def test_what_is_too_large_is_cut_off_and_what_is_doubtful_is_told() -> None:
    texels = ones()
    texels[1, 2] = 1e32
    repaired, said = repair(texels)
    assert repaired[1, 2].tolist() == [np.float32(LIMIT)] * 3 and "1 above 1e+30" in said
    texels[1, 2] = 1e25
    same, said = repair(texels)
    assert same is texels and said == "1 texel(s) above 1e+20, brighter than any light"
    texels[1, 2] = 1e19
    assert repair(texels)[1] == ""


def test_negative_numbers_may_be_kept_but_no_infinite_ones() -> None:
    texels = ones()
    texels[0, 0], texels[0, 1] = -2, -np.inf
    repaired, said = repair(texels, keep_negative=True)
    assert repaired[0, 0].tolist() == [-2] * 3 and repaired[0, 1].tolist() == [0] * 3
    assert "1 negative" in said
    assert repair(ones() * -1, keep_negative=True)[1] == ""


def test_doubles_beyond_floats() -> None:
    texels = ones().astype(np.float64)
    texels[0, 0] = 1e300
    with pytest.warns(EnvironmentMapWarning, match="infinite"):
        assert EnvironmentMap.from_array(texels).texels[0, 0].tolist() == [10] * 3


def test_halves_stay_halves() -> None:
    texels = np.ones((4, 5, 3), dtype=np.float16)
    assert repair(texels)[0] is texels
    texels[1, 2], texels[2, 3], texels[3, 3] = np.inf, np.nan, -1
    repaired, said = repair(texels)
    assert repaired.dtype == np.float16 and repaired[1, 2, 0] == 65504 and not repaired[[2, 3], [3, 3]].any()
    assert "1 NaN, 1 infinite, 1 negative texel(s) repaired" in said
