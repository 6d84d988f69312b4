"""What regions say of themselves, on a partition made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from stratalux import EnvironmentMap, Regions, describe_regions, region_content
from stratalux.maps.geometry import direction

HEIGHT, WIDTH = 5, 8
BOUNDS = np.array([[0, 2, 0, 8], [2, 4, 0, 3], [2, 3, 3, 8], [3, 4, 3, 8]])


def regions() -> Regions:
    return Regions(BOUNDS, np.array([1.0, 2, 3, 4]), (HEIGHT, WIDTH))


def test_centres_and_solid_angles() -> None:
    centre = direction(np.array([4.5, 2, 6, 6]) / 8, np.array([1, 3, 2.5, 3.5]) / 4)
    np.testing.assert_allclose(regions().centre, centre, atol=1e-15)
    half = np.sqrt(0.5)  # cos π/4
    heights = np.array([1, 1, half, 1 - half])
    np.testing.assert_allclose(regions().solid_angle, 2 * np.pi / 8 * np.array([8, 3, 5, 5]) * heights)


def test_every_cell_has_its_owner() -> None:
    expected = np.array([[0] * 8, [0] * 8, [1] * 3 + [2] * 5, [1] * 3 + [3] * 5])
    np.testing.assert_array_equal(regions().index_map(), expected)


def test_content_of_black_regions_is_in_their_middle() -> None:
    texels = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    texels[1, 6] = [1, 2, 3]
    content = region_content(EnvironmentMap(texels), regions())
    np.testing.assert_array_equal(content.flux[1:], 0)
    np.testing.assert_array_equal(content.direction[1:], regions().centre[1:])
    np.testing.assert_allclose(content.direction[0], direction(np.array(6.5 / 8), np.array(0.25)), atol=1e-15)
    np.testing.assert_allclose(content.flux[0] / content.flux[0, 0], [1, 2, 3])


def test_a_description_is_of_plain_numbers() -> None:
    colour = [0.25, 0.5, 1.0]
    environment = EnvironmentMap(np.full((HEIGHT, WIDTH, 3), colour, np.float32))
    described = describe_regions(environment, regions())
    assert (described["width"], described["height"], len(described["regions"])) == (8, 5, 4)
    last = described["regions"][3]
    assert last["texels"] == {"x": [3, 8], "y": [3, 4]}
    assert last["u"] == [3.5 / 8, 8.5 / 8]
    assert last["v"] == [0.75, 1]
    assert last["solid_angle"] == regions().solid_angle[3]
    assert last["energy"] == 4
    assert last["mean_colour"] == pytest.approx(colour)
    np.testing.assert_array_equal(last["direction"], region_content(environment, regions()).direction[3])
