"""Median cut lights, k-means and Lloyd relaxation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from stratalux import EnvironmentMap, median_cut, region_content
from stratalux.maps.geometry import texel_solid_angle
from stratalux.rigs.kmeans import _relax, cost, kmeans, reduced_points
from stratalux.rigs.lloyd import _Diagram, lloyd
from stratalux.rigs.median_cut_lights import median_cut_lights
from stratalux.rigs.voronoi import texel_directions
from tests.rigs.maps import MAPS, random_map


def test_median_cut_lights_are_the_content_of_the_regions() -> None:
    environment = EnvironmentMap(MAPS["hall"])
    regions = median_cut(environment, 32)
    content = region_content(environment, regions)
    rig, centred = (median_cut_lights(environment, 32, placement=p) for p in ("centroid", "centre"))
    np.testing.assert_array_equal(rig.colour, content.flux)
    np.testing.assert_array_equal(rig.direction, content.direction)
    np.testing.assert_array_equal(centred.direction, regions.centre)
    np.testing.assert_array_equal(rig.label[:-1], regions.index_map())
    np.testing.assert_array_equal(rig.label[-1], rig.label[-2])


def test_reduced_points_keep_the_energy() -> None:
    environment = EnvironmentMap(MAPS["black half"])
    points, weight = reduced_points(environment, (8, 16))
    assert len(points) == 8 * 16 // 2
    assert weight.min() > 0
    assert weight.sum() == pytest.approx(np.sum(environment.luminance * texel_solid_angle(24, 48)))
    assert (points[:, 0] > 0).all()  # the lit half
    whole, _ = reduced_points(environment, (64, 128))  # smaller than that: only the black is gone
    assert len(whole) == 24 * 24
    tall, _ = reduced_points(EnvironmentMap(random_map(24, 5)), (64, 128))
    assert len(tall) == 24 * 5


@pytest.mark.parametrize("name", ["random", "blobs", "hall"])
def test_kmeans_beats_random_centres(name: str) -> None:
    environment = EnvironmentMap(MAPS[name])
    points, weight = reduced_points(environment, (64, 128))
    rng = np.random.default_rng(0)
    found = cost(points, weight, kmeans(environment, 20).direction)
    for _ in range(20):
        chosen = rng.choice(len(points), 20, replace=False, p=weight / weight.sum())
        assert found < cost(points, weight, points[chosen])
    assert found < 1.02 * cost(points, weight, kmeans(environment, 20, restarts=1).direction)
    assert found < 0.97 * cost(points, weight, kmeans(environment, 20, iterations=1).direction)


def test_an_empty_cluster_goes_to_the_point_that_costs_most() -> None:
    points = np.array([[1, 0, 0], [0.6, 0.8, 0], [0, 0, 1]])
    centres = _relax(points, np.array([9.0, 1, 2]), points[[0, 0]], 1)
    assert sorted(centres.round(3).tolist()) == [[0, 0, 1], [0.997, 0.083, 0]]
    both = _relax(points, np.ones(3), points[[0, 0, 0]], 1)
    assert sorted(both.round(12).tolist()) == sorted(points.tolist())


@pytest.mark.parametrize("insert", ["brightest", "farthest"])
@pytest.mark.parametrize("weight", ["energy", "solid-angle"])
def test_lloyd_cells_are_those_of_their_centroids(insert: str, weight: str) -> None:
    environment = EnvironmentMap(MAPS["blobs"])
    rig = lloyd(environment, 30, insert=insert, weight=weight, iterations=60)
    assert len(rig) == 30
    points = texel_directions(environment.height, environment.width)
    solid_angle = np.ravel(texel_solid_angle(environment.height, environment.width))
    mass = solid_angle if weight == "solid-angle" else solid_angle * environment.luminance.ravel()
    moment = np.stack([np.bincount(rig.label.ravel(), mass * points[:, c]) for c in range(3)], axis=1)
    closeness = points @ (moment / np.linalg.norm(moment, axis=1, keepdims=True)).T
    own = closeness[np.arange(len(points)), rig.label.ravel()]
    assert np.mean(own >= closeness.max(axis=1) - 1e-9) > 0.99


@pytest.mark.parametrize(("insert", "alone"), [("brightest", 0), ("farthest", 2)])
def test_lloyd_inserts_where_it_is_told_to(insert: str, alone: int) -> None:
    """A bright texel, a dim one beside it and one opposite: the first generator is between the first two."""
    texels = np.zeros((9, 16, 3), np.float32)
    columns = [2, 3, 10]
    texels[4, columns] = [[10], [1], [1]]
    label = lloyd(EnvironmentMap(texels), 2, insert=insert, iterations=0).label[4, columns]
    assert (label == label[alone]).tolist() == [k == alone for k in range(3)]
    # No light is put on black: there is one for each lit texel, and what the first generator is left with.
    assert len(lloyd(EnvironmentMap(texels), 9, insert=insert)) == 4


@pytest.mark.parametrize(("growth", "counts"), [(None, [2, 4, 8, 16, 20]), (3.0, [2, 6, 18, 20])])
def test_lloyd_relaxes_on_the_way(monkeypatch: pytest.MonkeyPatch, growth: float | None, counts: list[int]) -> None:
    relax, seen = _Diagram.relax, []

    def watched(self: _Diagram, *arguments: Any) -> None:
        seen.append(self.count)
        relax(self, *arguments)

    monkeypatch.setattr(_Diagram, "relax", watched)
    lloyd(EnvironmentMap(MAPS["blobs"]), 20, **({} if growth is None else {"growth": growth}))
    assert seen == counts


@pytest.mark.parametrize("insert", ["brightest", "farthest"])
def test_lloyd_spreads_energy(insert: str) -> None:
    rig = lloyd(EnvironmentMap(MAPS["random"]), 40, insert=insert)
    share = rig.colour.sum(axis=1) / rig.colour.sum()
    assert len(rig) == 40
    assert share.max() < 4 / 40


@pytest.mark.parametrize("n", [28, 32, 45, 59])
def test_lloyd_replaces_cells_that_relaxation_empties(n: int) -> None:
    # A sun of a few texels with nearly all of the energy, where relaxed generators crowd between texels.
    i, j = np.mgrid[:32, :64]
    distance = np.hypot(i - 10, j - 20)
    sky = 1 + 5 * np.exp(-distance / 4) + 1e5 * np.exp(-((distance / 1.5) ** 2))
    assert len(lloyd(EnvironmentMap.from_array(sky), n)) == n
