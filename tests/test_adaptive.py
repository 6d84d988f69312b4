"""The share of each pixel: where the error is, and independent of the pixel's own samples."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from stratalux.adaptive import plan_samples


def pilot(height: int, width: int, seed: int = 0) -> NDArray[np.float32]:
    """Noise that differs from place to place by orders of magnitude."""
    rng = np.random.default_rng(seed)
    spread = np.exp2(3 * np.sin(np.arange(width) / 7) * np.cos(np.arange(height) / 9)[:, None])
    noise = rng.normal(size=(4, height, width, 3)) * spread[None, :, :, None]
    return (100 + noise).astype(np.float32)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (3, 5), (24, 16), (80, 120)])
@pytest.mark.parametrize("budget", [4, 16, 100])
def test_counts_are_powers_of_two_within_the_budget(height: int, width: int, budget: int) -> None:
    counts = plan_samples(pilot(height, width), 0.1, budget, 2).counts
    assert counts.shape == (height, width) and counts.min() >= 2
    assert (counts & (counts - 1) == 0).all()
    assert 0.6 * budget < counts.mean() < 1.4 * budget


def test_samples_go_where_the_error_is() -> None:
    images = np.full((4, 80, 120, 3), 1.0, dtype=np.float32)
    images[:, :, 60:] += np.random.default_rng(1).normal(size=(4, 80, 60, 3)) * 0.5
    counts = plan_samples(images, 0.1, 32, 2).counts
    assert counts[:, 70:].mean() > 8 * counts[:, :50].mean()


def test_black_images_and_images_without_error_are_sampled_evenly() -> None:
    for value in (0.0, 0.5):
        counts = plan_samples(np.full((4, 40, 30, 3), value, dtype=np.float32), 0.1, 16, 2).counts
        assert (counts == 16).all()


@settings(deadline=None, max_examples=150)
@given(
    st.integers(0, 63),
    st.integers(0, 39),
    st.integers(0, 2),
    st.sampled_from([0.0, -3.0, 1.0, 1e4, 1e9, 1e15]),
    st.integers(0, 2**32 - 1),
)
def test_a_count_does_not_depend_on_the_samples_of_its_pixel(
    y: int, x: int, footprint: int, value: float, seed: int
) -> None:
    """What makes the image unbiased: not even a firefly in its own pilot changes what a pixel gets."""
    before: NDArray[Any] = pilot(64, 40, 3)
    after = before.copy()
    near = np.s_[:, max(0, y - footprint) : y + footprint + 1, max(0, x - footprint) : x + footprint + 1]
    after[near] = value * np.random.default_rng(seed).random(after[near].shape)
    first, second = (plan_samples(images, 0.1, 16, 2, footprint) for images in (before, after))
    assert first.counts[y, x] == second.counts[y, x]
