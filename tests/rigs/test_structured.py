"""Structured importance sampling: components, allocation, k-centre, nested strata."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import EnvironmentMap
from stratalux.maps.geometry import texel_solid_angle
from stratalux.rigs.structured import components, gamma, k_centre, structured, thresholds
from stratalux.rigs.voronoi import texel_directions
from tests.helpers import asset
from tests.rigs.maps import MAPS


def site_texels(environment: EnvironmentMap, n: int) -> NDArray[np.int64]:
    """Flat index of the texel that each light was placed at."""
    rig = structured(environment, n, placement="site")
    closeness = rig.direction @ texel_directions(environment.height, environment.width).T
    assert (closeness.max(axis=1) > 1 - 1e-12).all()
    return closeness.argmax(axis=1)


def test_components_wrap_and_meet_at_the_poles() -> None:
    mask = np.zeros((6, 8), dtype=bool)
    mask[2, 0] = mask[3, 7] = True  # diagonal neighbours across the seam
    mask[2, 4] = True
    mask[0, 1] = mask[0, 5] = True  # one place: the pole
    mask[5, 3] = True
    image = components(mask)
    np.testing.assert_array_equal(image > 0, mask)
    assert image[2, 0] == image[3, 7]
    assert image[0, 1] == image[0, 5]
    assert len(np.unique(image)) == 1 + 4
    assert not components(np.zeros((4, 5), dtype=bool)).any()
    assert (components(np.ones((4, 5), dtype=bool)) == 1).all()


SEAM = [((3, 0), (2, 7), 1), ((3, 0), (3, 7), 1), ((3, 0), (4, 7), 1), ((3, 0), (5, 7), 2), ((3, 0), (3, 6), 2)]
POLES = [((0, 1), (0, 5), 1), ((6, 1), (6, 5), 1), ((0, 1), (6, 1), 2), ((1, 1), (1, 5), 2)]


@pytest.mark.parametrize(("first", "second", "count"), [*SEAM, *POLES])
def test_pairs_of_texels_are_one_component_or_two(first: tuple[int, int], second: tuple[int, int], count: int) -> None:
    mask = np.zeros((7, 8), dtype=bool)
    mask[first] = mask[second] = True
    assert components(mask).max() == count


def test_thresholds_are_multiples_of_the_standard_deviation() -> None:
    environment = EnvironmentMap(MAPS["random"])
    weight = texel_solid_angle(24, 48) / (4 * np.pi)
    mean = np.sum(weight * environment.luminance)
    sigma = np.sqrt(np.sum(weight * environment.luminance.astype(float) ** 2) - mean**2)
    np.testing.assert_allclose(thresholds(environment, 6), sigma * np.array([5, 4, 3, 2, 1, 0]), rtol=1e-5)


def test_gamma_is_capped() -> None:
    assert gamma(2.0, 0.0016, 0.01) == pytest.approx(2 * 0.0016**0.25)
    assert gamma(2.0, 1.0, 0.01) == gamma(2.0, 0.01, 0.01)


def test_k_centre_is_a_two_approximation() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(400, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    centres = np.concatenate([[7], k_centre(points, np.array([7]), 11, rng)])
    assert len(np.unique(centres)) == 12
    angle = np.arccos(np.clip(points @ points[centres].T, -1, 1))
    for k in range(1, 12):  # each was the farthest when it was added
        assert angle[:, :k].min(axis=1).argmax() == centres[k]
    # Centres and the worst covered point lie at least the covering radius apart: 12 discs of half of it cannot cover.
    between = angle[centres] + 9 * np.eye(12)
    assert between.min() >= angle.min(axis=1).max()


def test_k_centre_stops_at_coincident_points() -> None:
    points = np.repeat(np.eye(3), 5, axis=0)
    assert len(k_centre(points, np.array([], dtype=np.int64), 9, np.random.default_rng(0))) == 3


@pytest.mark.parametrize("n", [5, 24, 100])
@pytest.mark.parametrize("name", ["blobs", "hall", "random", "sun"])
def test_allocation_and_nesting(name: str, n: int) -> None:
    environment = EnvironmentMap(MAPS[name])
    height, width = environment.height, environment.width
    label = structured(environment, n, placement="site").label.ravel()
    sites = site_texels(environment, n)
    np.testing.assert_array_equal(label[sites], np.arange(n))  # a light owns its own texel
    points, weight = texel_directions(height, width), texel_solid_angle(height, width).ravel()
    energy = weight * environment.luminance.ravel()
    whole = gamma(energy.sum(), 4 * np.pi, 0.01)
    pole = np.isin(np.arange(height * width) // width, [0, height - 1])
    finer = np.zeros(height * width, dtype=bool)  # in a component with lights of a higher level
    for threshold in thresholds(environment, 6):
        image = components(environment.luminance >= threshold).ravel()
        occupied = finer.copy()
        for c in range(1, image.max() + 1):
            inside = image == c
            lights = np.flatnonzero(inside[sites])
            quota = np.floor(n * gamma(energy[inside].sum(), weight[inside].sum(), 0.01) / whole * (1 - 1e-12))
            room = np.count_nonzero(inside & ~pole) + np.count_nonzero(np.unique(points[inside & pole, 1].round()))
            assert len(lights) >= min(quota, room)
            if not len(lights):
                continue
            # The component's texels belong to lights in it, and no light outside has any of them.
            assert set(label[inside]) == set(lights)
            # Texels that no smaller component with lights contains are in plain Voronoi cells.
            rest = inside & ~finer
            own = np.searchsorted(lights, label[rest])
            closeness = points[rest] @ points[sites[lights]].T
            assert (closeness[np.arange(len(own)), own] >= closeness.max(axis=1, initial=-1) - 1e-12).all()
            occupied |= inside
        finer = occupied


def layer_counts(environment: EnvironmentMap, n: int) -> NDArray[np.int64]:
    """Number of lights whose texel is in each of the layers, from 0 to 1 σ up to above 5 σ."""
    luminance = environment.luminance.ravel()[site_texels(environment, n)]
    return np.bincount(np.searchsorted(thresholds(environment, 6)[::-1], luminance, side="right") - 1, minlength=6)


def test_bright_and_dim_layers_have_lights() -> None:
    environment = EnvironmentMap(MAPS["blobs"])
    counts = layer_counts(environment, 100)
    assert counts[0] >= 20
    assert counts[1:].sum() >= 20
    # The share of the bright layers is between that of their area and that of their energy.
    weight = texel_solid_angle(64, 128).ravel()
    energy = weight * environment.luminance.ravel()
    bright = environment.luminance.ravel() >= thresholds(environment, 2)[0]
    assert weight[bright].sum() / weight.sum() < counts[1:].sum() / 100 < energy[bright].sum() / energy.sum()


def test_placements_differ_in_directions_only() -> None:
    environment = EnvironmentMap(MAPS["blobs"])
    first, *others = [structured(environment, 40, placement=p) for p in ("centre", "energy", "site")]
    for rig in others:
        np.testing.assert_array_equal(rig.label, first.label)
        np.testing.assert_array_equal(rig.colour, first.colour)
        assert np.abs(rig.direction - first.direction).max() > 1e-3


def test_grace_has_lights_in_all_layers() -> None:
    environment = EnvironmentMap.load(asset("envmaps/grace_latlong.exr"))
    assert (layer_counts(environment, 300) > 0).all()
