"""Error figures, by hand."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

from stratalux.images.metrics import flip, relative_mse, rmse, why_no_flip

REFERENCE = np.array([[[0.0, 1.0, 2.0], [3.0, 0.5, 0.0]]])
IMAGE = np.array([[[1.0, 1.0, 0.0], [3.0, 0.0, 0.0]]])
FIRST = np.array([[True, False]])


def test_rmse_by_hand() -> None:
    assert rmse(REFERENCE, REFERENCE) == 0
    assert rmse(IMAGE, REFERENCE) == pytest.approx(np.sqrt((1 + 4 + 0.25) / 6))
    assert rmse(IMAGE, REFERENCE, FIRST) == pytest.approx(np.sqrt(5 / 3))


def test_relative_mse_by_hand() -> None:
    assert relative_mse(REFERENCE, REFERENCE) == 0
    terms = 1 / 0.01 + 4 / 4.01 + 0.25 / 0.26
    assert relative_mse(IMAGE, REFERENCE) == pytest.approx(terms / 6)
    assert relative_mse(IMAGE, REFERENCE, ~FIRST) == pytest.approx(0.25 / 0.26 / 3)


def test_sums_are_taken_in_double_precision() -> None:
    reference = np.full((300, 300, 3), 2000, dtype=np.float16)
    image = reference + np.float16(100)  # whose square no half float can hold
    assert rmse(image, reference) == 100


def test_what_is_no_number_stays_none() -> None:
    image = IMAGE.copy()
    image[0, 0, 0] = np.nan
    assert np.isnan(rmse(image, REFERENCE)) and np.isnan(relative_mse(image, REFERENCE))
    assert np.isfinite(rmse(image, REFERENCE, ~FIRST))


def test_without_flip_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert "pip install" in (why_no_flip() or "")


@pytest.mark.skipif(why_no_flip() is not None, reason=str(why_no_flip()))
def test_flip() -> None:
    reference = np.random.default_rng(0).random((32, 48, 3))
    assert flip(reference, reference) == 0
    slightly, much = flip(reference * 1.05, reference), flip(reference * 3, reference)
    assert 0 < slightly < much < 1
    image, left = reference.copy(), np.zeros((32, 48), dtype=bool)
    image[:, :8] = 0
    left[:, :8] = True
    assert flip(image, reference, left) > 0.5 and flip(image, reference, np.roll(left, 40, axis=1)) < 0.01
    grey = reference[..., :1]
    assert flip(grey * 1.1, grey) == pytest.approx(flip(np.repeat(grey * 1.1, 3, 2), np.repeat(grey, 3, 2)))
    # None of these may end the process, as the library does by itself.
    black = np.zeros_like(reference)
    assert np.isnan(flip(reference, black)) and np.isnan(flip(reference * np.nan, reference))
    assert flip(-reference, reference) == flip(black, reference)
    assert np.isfinite(flip(reference, np.ones_like(reference)))
