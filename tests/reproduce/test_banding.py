"""Bands and noise, measured on images whose bands and noise are known."""

from __future__ import annotations

import numpy as np
import pytest

from stratalux.reproduce.banding import quality, step_share

SIZE = 200
EVERYWHERE = np.ones((8, SIZE), dtype=bool)


def picture(row: np.ndarray) -> np.ndarray:
    return np.broadcast_to(row[None, :, None], (8, SIZE, 3))


def test_a_ramp_is_even_and_a_staircase_is_all_steps() -> None:
    ramp = picture(np.linspace(0, 1, SIZE))
    stairs = picture(np.floor(np.linspace(0, 3.999, SIZE)) / 3)
    # Half of the pairs are vertical, where nothing changes: the steepest 5 % of all are a tenth of the others.
    assert step_share(ramp, EVERYWHERE) == pytest.approx(0.1, rel=0.1)
    assert step_share(stairs, EVERYWHERE) == pytest.approx(1.0)


def test_what_is_masked_does_not_count() -> None:
    ramp = picture(np.linspace(0, 1, SIZE)).copy()
    ramp[:, 100:] += 50  # an edge
    mask = EVERYWHERE.copy()
    assert step_share(ramp, mask) > 0.9
    mask[:, 99] = False
    assert step_share(ramp, mask) == pytest.approx(0.1, rel=0.1)
    assert np.isnan(step_share(np.ones((8, SIZE, 3)), EVERYWHERE))


@pytest.mark.parametrize("bias", [0.0, 0.2])
def test_bias_and_noise_are_told_apart(bias: float) -> None:
    """Noise of 0.5 over a mean of 2, known from 40 renderings, over a reference with an error of its own."""
    rng = np.random.default_rng(5)
    truth = np.full((60, 60, 3), 2.0)
    renderings = truth + bias + rng.normal(0, 0.5, (40, *truth.shape))
    error = np.full(truth.shape, 0.05)
    reference = truth + rng.normal(0, 0.05, truth.shape)
    mask = np.ones(truth.shape[:2], dtype=bool)
    found = quality(renderings.mean(axis=0), renderings.var(axis=0, ddof=1), 40, reference, error, mask)
    assert found.noise == pytest.approx(0.25, rel=0.02)
    assert found.bias_seen == (bias > 0)
    assert found.bias == pytest.approx(bias / 2, abs=0.01)
