"""The share of each pixel: where the error is, and independent of the pixel's own samples."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from stratalux.integrators.automatic.adaptive import plan_samples


def pilot(height: int, width: int, seed: int = 0, parts: int = 4) -> NDArray[np.float32]:
    """Noise that differs from place to place by orders of magnitude."""
    rng = np.random.default_rng(seed)
    spread = np.exp2(3 * np.sin(np.arange(width) / 7) * np.cos(np.arange(height) / 9)[:, None])
    noise = rng.normal(size=(parts, height, width, 3)) * spread[None, :, :, None]
    return (100 + noise).astype(np.float32)


def plan(
    images: NDArray[Any],
    variate: NDArray[Any],
    dim: float,
    budget: float,
    least: int,
    footprint: int = 0,
    marks: NDArray[Any] | None = None,
    costs: NDArray[Any] | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Counts and shares (H, W) from images (P, H, W, C), from marks (K, H, W), and from costs (H, W)."""
    pilot, difference = (mi.TensorXf(np.moveaxis(x, -1, 0).astype(np.float32)) for x in (images, variate))
    marked = [mi.Float(mark.ravel().astype(np.float32)) for mark in (() if marks is None else marks)]
    costly = [] if costs is None else [mi.Float(costs.ravel().astype(np.float32))]
    plan = plan_samples(pilot, difference, dim, budget, least, footprint, marked, costly)
    return plan.counts, plan.share.numpy().reshape(plan.counts.shape)


def counts_of(images: NDArray[Any], dim: float, budget: float, least: int) -> NDArray[np.int64]:
    """Without a variate."""
    return plan(images, np.zeros_like(images), dim, budget, least)[0]


@pytest.mark.parametrize(("height", "width"), [(1, 1), (3, 5), (24, 16), (80, 120)])
@pytest.mark.parametrize("budget", [4, 16, 100])
def test_counts_are_powers_of_two_within_the_budget(height: int, width: int, budget: int) -> None:
    counts = counts_of(pilot(height, width), 0.1, budget, 2)
    assert counts.shape == (height, width) and counts.min() >= 2
    assert (counts & (counts - 1) == 0).all()
    assert 0.6 * budget < counts.mean() < 1.4 * budget


def test_samples_go_where_the_error_is() -> None:
    images = np.full((4, 80, 120, 3), 1.0, dtype=np.float32)
    images[:, :, 60:] += np.random.default_rng(1).normal(size=(4, 80, 60, 3)) * 0.5
    counts = counts_of(images, 0.1, 32, 2)
    assert counts[:, 70:].mean() > 8 * counts[:, :50].mean()


def test_dear_samples_are_fewer() -> None:
    """Eight times as dear, half as many: the third root."""
    images = 1 + 0.5 * np.random.default_rng(1).normal(size=(4, 160, 240, 3))
    costs = np.where(np.arange(240) < 120, 40.0, 5.0) * np.ones((160, 1))
    counts, _ = plan(images, np.zeros_like(images), 0.1, 32, 2, costs=costs)
    assert counts[:, 124:].mean() / counts[:, :116].mean() == pytest.approx(2, rel=0.1)


def test_noise_stays_on_its_side_of_a_mark() -> None:
    """Calm pixels beside a noisy shape get no more samples than those far away, if they show another."""
    images = np.full((4, 80, 120, 3), 1.0, dtype=np.float32)
    images[:, :, 60:] += np.random.default_rng(1).normal(size=(4, 80, 60, 3)) * 0.5
    side = np.broadcast_to(np.arange(120) >= 60, (80, 120))
    marks = np.stack([side, ~side])
    counts, _ = plan(images, np.zeros_like(images), 0.1, 32, 2, marks=marks)
    unmarked, _ = plan(images, np.zeros_like(images), 0.1, 32, 2)
    assert counts[:, 59].mean() < 0.5 * unmarked[:, 59].mean()
    assert counts[:, 60].mean() > unmarked[:, 60].mean()
    assert (counts[:, 62:].mean() / counts[:, :58].mean()) > 4


def test_black_images_and_images_without_error_are_sampled_evenly() -> None:
    for value in (0.0, 0.5):
        counts = counts_of(np.full((4, 40, 30, 3), value, dtype=np.float32), 0.1, 16, 2)
        assert (counts == 16).all()


@settings(max_examples=150)
@given(
    st.sampled_from([1, 4]),
    st.integers(0, 63),
    st.integers(0, 39),
    st.integers(0, 2),
    st.sampled_from([0.0, -3.0, 1.0, 1e4, 1e9, 1e15, 1e30]),
    st.integers(0, 2**32 - 1),
    st.booleans(),
)
def test_a_count_does_not_depend_on_the_samples_of_its_pixel(
    parts: int, y: int, x: int, footprint: int, value: float, seed: int, marked: bool
) -> None:
    """What makes the image unbiased: not even a firefly in its own pilot changes what a pixel gets."""
    before = [pilot(64, 40, 3, parts), pilot(64, 40, 4, parts) - 100]
    after = [images.copy() for images in before]
    near = np.s_[:, max(0, y - footprint) : y + footprint + 1, max(0, x - footprint) : x + footprint + 1]
    for images in after:
        images[near] = value * np.random.default_rng(seed).random(images[near].shape)
    marks = np.random.default_rng(5).random((2, 64, 40)).round() if marked else None
    costs = [np.random.default_rng(6).uniform(1, 9, (64, 40)) for _ in range(2)]
    costs[1][near[1:]] = 1e3
    first, second = (
        plan(*images, 0.1, 16, 2, footprint, marks, cost) for images, cost in zip((before, after), costs, strict=True)
    )
    for a, b in zip(first, second, strict=True):
        assert a[y, x] == b[y, x]


@pytest.mark.parametrize("parts", [1, 4])
@pytest.mark.parametrize("value", [1e20, 3e38])
def test_what_is_too_bright_for_squares_ends_nothing(value: float, parts: int) -> None:
    """Counts are within the budget, take no memory to speak of, and are most around such a pixel."""
    images, difference = pilot(64, 80, 3, parts), pilot(64, 80, 4, parts) - 100
    with np.errstate(over="ignore"):
        images[0, 20, 30], difference[0, 20, 30] = value, -value
    counts, share = plan(images, difference, 0.1, 16, 2)
    assert 0.6 * 16 < counts.mean() < 1.4 * 16
    assert np.isfinite(share).all() and share.min() >= 0 and share.max() <= 1
    assert counts[19:22, 29:32].sum() - counts[20, 30] == 8 * counts.max()


def test_the_share_of_a_variate_is_the_best_one() -> None:
    """On the left, the variate has the pilot's noise and nothing else; on the right, none of it."""
    rng = np.random.default_rng(1)
    for parts in (1, 4):
        noise, other = rng.normal(size=(2, parts, 80, 120, 3))
        variate = noise.copy()
        variate[:, :, 60:] = other[:, :, 60:]
        _, share = plan(10 + noise, -2 * variate, 0.1, 16, 2)
        assert share.min() >= 0 and share.max() <= 1
        assert share[:, :57].mean() == pytest.approx(0.5, abs=0.01)
        assert share[:, 63:].mean() < 0.1


def test_a_picture_upside_down_is_treated_alike() -> None:
    images, variate = pilot(40, 30), pilot(40, 30, 1) - 100
    (_, share), (_, turned) = (
        plan(a, b, 0.1, 16, 2) for a, b in ((images, variate), (images[:, ::-1, ::-1], variate[:, ::-1, ::-1]))
    )
    np.testing.assert_allclose(turned[::-1, ::-1], share, rtol=1e-4, atol=1e-5)
    assert share.std() > 0.01


@pytest.mark.parametrize("parts", [1, 4])
@pytest.mark.parametrize("footprint", [0, 1])
@pytest.mark.parametrize("marked", [False, True])
@pytest.mark.parametrize("dim", [0.0, 0.3])
def test_needs_level_and_share_are_those_of_sums_one_by_one(
    parts: int, footprint: int, marked: bool, dim: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once more in NumPy: a variance beside that of the mean, relative to its square, to the power 1 / 3."""
    images, difference = (pilot(9, 7, seed, parts).astype(np.float64) - less for seed, less in ((3, 99), (4, 100)))
    marks = np.random.default_rng(5).random((2, 9, 7)) if marked else np.empty((0, 9, 7))
    seen: list[NDArray[Any]] = []
    counts = "stratalux.integrators.automatic.adaptive._counts"
    monkeypatch.setattr(counts, lambda steps, *more: seen.append((steps, more)) or np.ones_like(steps))
    found = plan_samples(
        *(mi.TensorXf(np.ascontiguousarray(x.transpose(3, 0, 1, 2)).astype(np.float32)) for x in (images, difference)),
        dim, 16, 2, footprint, [mi.Float(mark.ravel().astype(np.float32)) for mark in marks],
    )  # fmt: skip
    steps, more = seen[0]
    outer = 2 + footprint
    assert more == (16, 2, outer + footprint)

    mean = images.mean(axis=(0, 3))
    e, v = (x - x.mean(axis=0) if parts > 1 else x for x in (images, difference))
    products = [(a * b).sum(axis=(0, 3)) for a, b in ((e, e), (e, v), (v, v))]
    for y in range(9):
        for x in range(7):
            weights = np.zeros((9, 7))
            for j in range(9):
                for i in range(7):
                    d = max(abs(j - y), abs(i - x))
                    inner = (2 * footprint + 1) ** 2
                    if footprint < d <= outer:
                        weights[j, i] = 0.5 / ((2 * outer + 1) ** 2 - inner)
                        weights[j, i] += 0.5 / ((2 * footprint + 3) ** 2 - inner) * (d == footprint + 1)
                    if marked:
                        apart = ((marks[:, j, i] - marks[:, y, x]) ** 2).sum() / 0.05
                        weights[j, i] *= 0.01 + 1 / (1 + apart**2)
            weights /= weights.sum()
            around = (weights * mean).sum()
            variance, covariance, squares = ((weights * p).sum() for p in products)
            if parts == 1:
                a, b = ((weights[..., None] * z[0]).sum(axis=(0, 1)) for z in (images, difference))
                variance, covariance, squares = variance - a @ a, covariance - a @ b, squares - b @ b
            share = np.clip(-covariance / squares, 0, 1)
            spread = variance + share * (2 * covariance + share * squares)
            near = mean[max(0, y - 2) : y + 3, max(0, x - 2) : x + 3]
            assert found.level[y * 7 + x] == pytest.approx(near.mean(), rel=1e-4)
            expected = share * min(1, around**2 / (3 * spread))
            assert found.share[y * 7 + x] == pytest.approx(expected, rel=1e-2, abs=1e-3)
            need = 64 * np.log2(spread / (around**2 + dim**2)) / 3
            assert abs(steps[y, x] - need) < 1
