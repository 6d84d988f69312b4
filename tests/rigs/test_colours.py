"""Colours of 8 bits."""

from __future__ import annotations

import numpy as np
import pytest

from stratalux.rigs.colours import decoded, eight_bits, encoded


def test_the_curve_is_that_of_srgb() -> None:
    np.testing.assert_allclose(encoded([0.0, 0.5, 1.0]), [0, 0.735357, 1], atol=1e-6)
    np.testing.assert_allclose(decoded(np.array([0, 128, 255])), [0, 0.2158605, 1], atol=1e-7)
    np.testing.assert_allclose(255 * np.array(encoded(decoded(np.arange(256)).tolist())), np.arange(256), atol=1e-3)


def test_bytes_times_strength_are_the_light() -> None:
    worst = 0.0
    for colour in np.random.default_rng(3).lognormal(0, 2, (300, 3)):
        codes, strength = eight_bits(colour)
        assert all(isinstance(code, int) and 0 <= code <= 255 for code in codes)
        worst = max(worst, float(np.abs(strength * decoded(np.array(codes)) - colour).max() / colour.max()))
    assert worst < 0.0035  # simply rounded, it is 0.0045
    assert eight_bits(np.array([7.0, 7, 7])) == ([255, 255, 255], pytest.approx(7))
    assert eight_bits(np.zeros(3)) == ([255, 255, 255], 0.0)
