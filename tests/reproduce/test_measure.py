"""What the figures measure, on data with a known answer."""

from __future__ import annotations

import numpy as np
import pytest

from stratalux.reproduce.balance import Balance, best_cell, more_proposals_against_more_regions
from stratalux.reproduce.figure3 import regions_of
from stratalux.reproduce.figure5 import captured, highlights
from stratalux.reproduce.measure import Moments
from stratalux.reproduce.scenes import subdivided
from stratalux.reproduce.settings import TINY
from stratalux.reproduce.unbiased import deviations
from stratalux.scenes.mesh import TriangleMesh


def test_moments() -> None:
    images = np.random.default_rng(3).normal(5, 2, (7, 3, 4, 3))
    moments = Moments()
    for image in images:
        moments.add(image)
    np.testing.assert_allclose(moments.mean, images.mean(axis=0))
    np.testing.assert_allclose(moments.variance, images.var(axis=0, ddof=1))


def test_regions_by_hidden_share() -> None:
    share = np.array([[0.0, 0.3, 0.5, 0.51, 0.8, 1.0, np.nan]])
    thing = np.array([[True, True, True, True, True, True, False]])
    regions = regions_of(share, thing)
    assert regions["occluded"].sum() == 3 and regions["open"].sum() == 3 and regions["object"].sum() == 6
    bins = [mask for name, mask in regions.items() if "%" in name]
    assert sum(mask.sum() for mask in bins) == 6 and np.sum(bins, axis=0).max() == 1
    assert "occluded" not in regions_of(np.zeros((1, 7)), thing)


def test_highlights_and_what_is_caught_of_them() -> None:
    reference = np.linspace(0, 1, 100)[None, :, None] * np.ones(3)
    mask = np.ones((1, 100), dtype=bool)
    mask[0, 99] = False
    bright = highlights(reference, mask, 0.05)
    assert bright[0, 94:99].all() and bright.sum() == 5
    assert captured(reference, reference, bright) == pytest.approx(1)
    assert captured(2 * reference, reference, bright) == pytest.approx(1)
    assert captured(0 * reference, reference, bright) == 0
    uneven = reference * np.where(np.arange(100) % 2, 2.0, 0.0)[None, :, None]
    assert captured(uneven, reference, bright) == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize(("bias", "sound"), [(0.0, True), (0.05, False)])
def test_bias_is_seen(bias: float, sound: bool) -> None:
    rng = np.random.default_rng(7)
    a, b = 1 + rng.normal(0, 0.5, (2, 60, 20, 30, 3))
    a += bias
    mean, outliers = deviations(a.mean(axis=0), a.var(axis=0, ddof=1), b.mean(axis=0), b.var(axis=0, ddof=1), 60)
    assert (abs(mean) < 3) == sound
    assert outliers < 3
    assert deviations(*np.zeros((4, 2, 2, 3)), 5) == (0.0, 0.0)


def test_the_best_cell_and_the_trade() -> None:
    one = np.zeros((2, 2, 1))
    balance = Balance("glossy", np.array([[4.0, 1.0], [2.0, np.nan]]), one, one)
    assert best_cell(TINY, balance) == (4, 2, 2.0)
    assert more_proposals_against_more_regions(balance) == [2.0]


def test_subdivision_keeps_the_surface() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float32)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.uint32)
    mesh = subdivided(TriangleMesh(vertices, faces, vertices / 2 + np.float32(0.5)), 2)
    assert len(mesh.faces) == 4 * 16
    assert mesh.normals is not None
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(1.5 + np.sqrt(3) / 2, rel=1e-5)
