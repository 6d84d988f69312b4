"""The light rig itself, and what every technique promises."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from stratalux import EnvironmentMap, InputError
from stratalux.maps.geometry import texel_solid_angle
from stratalux.rigs import RIGS, LightRig, light_rig, rig_from_labels
from stratalux.rigs.voronoi import texel_directions
from tests.helpers import asset
from tests.rigs.maps import MAPS, integral, random_map

methods = pytest.mark.parametrize("method", RIGS)

small_texels = hnp.arrays(
    np.float32,
    st.tuples(st.integers(3, 8), st.integers(2, 12), st.just(3)),
    elements=st.one_of(st.just(0.0), st.floats(0.015625, 1e5, width=32)),
)


def check(rig: LightRig, environment: EnvironmentMap, n: int) -> None:
    """Everything that holds for every rig."""
    assert 1 <= len(rig) <= n
    assert rig.label.shape == (environment.height, environment.width)
    assert rig.label.dtype == np.int32
    assert rig.label.min() >= 0
    assert rig.label.max() == len(rig) - 1
    assert (np.bincount(rig.label.ravel(), minlength=len(rig)) >= 1).all()
    np.testing.assert_allclose(np.linalg.norm(rig.direction, axis=1), 1, rtol=1e-9)
    total = integral(environment)
    np.testing.assert_allclose(rig.total_colour, total, rtol=1e-5, atol=1e-7 * total.max())
    assert rig.solid_angle.sum() == pytest.approx(4 * np.pi)
    assert rig.colour.min() >= 0


@pytest.mark.parametrize("shape", [(3, 2), (4, 9), (64, 128)])
def test_texel_solid_angles_are_the_quadrature_of_the_bilinear_map(shape: tuple[int, int]) -> None:
    weight = texel_solid_angle(*shape)
    assert weight.shape == shape
    assert weight.min() > 0
    assert weight.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    environment = EnvironmentMap(random_map(*shape))
    expected = integral(environment)
    np.testing.assert_allclose(np.einsum("ij,ijc->c", weight, environment.texels), expected, rtol=1e-6)
    assert environment.cell_energy.sum() == pytest.approx(np.sum(weight * environment.luminance), rel=1e-6)


def test_texel_directions_follow_the_rows() -> None:
    points = texel_directions(5, 8).reshape(5, 8, 3)
    np.testing.assert_allclose(points[0], [[0, 1, 0]] * 8, atol=1e-12)
    np.testing.assert_allclose(points[4], [[0, -1, 0]] * 8, atol=1e-12)
    phi = 2 * np.pi * 3.5 / 8
    np.testing.assert_allclose(points[2, 3], [np.sin(phi), 0, -np.cos(phi)], atol=1e-12)


@methods
@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("n", [1, 7, 40])
def test_strata_cover_the_map_and_conserve_energy(method: str, name: str, n: int) -> None:
    environment = EnvironmentMap(MAPS[name])
    rig = light_rig(method, environment, n)
    check(rig, environment, n)
    assert len(rig) == n
    assert rig.method == method


@methods
@given(texels=small_texels, n=st.integers(1, 30))
@settings(max_examples=30)
def test_any_small_map(method: str, texels: NDArray[np.float32], n: int) -> None:
    environment = EnvironmentMap(texels)
    n = min(n, environment.height * environment.width)
    check(light_rig(method, environment, n), environment, n)


@methods
def test_all_black(method: str) -> None:
    environment = EnvironmentMap(np.zeros((12, 24, 3), np.float32))
    rig = light_rig(method, environment, 10)
    check(rig, environment, 10)
    assert len(rig) == (1 if method == "median-cut" else 10)
    assert not rig.colour.any()


@methods
def test_smallest_map(method: str) -> None:
    environment = EnvironmentMap(random_map(3, 2))
    for n in range(1, 7):
        check(light_rig(method, environment, n), environment, n)
    with pytest.raises(InputError, match="7 is more than the map's 6 texels"):
        light_rig(method, environment, 7)


@methods
def test_lit_texel_on_black(method: str) -> None:
    texels = np.zeros((16, 32, 3), np.float32)
    texels[5, 9] = [3, 2, 1]
    environment = EnvironmentMap(texels)
    # Structured lights stand in the middle of their strata unless told otherwise.
    options = {"placement": "energy"} if method == "structured" else {}
    rig = light_rig(method, environment, 9, **options)
    check(rig, environment, 9)
    sun = texel_directions(16, 32).reshape(16, 32, 3)[5, 9]
    assert np.average(rig.direction @ sun, weights=rig.colour.sum(axis=1)) > np.cos(np.pi / 16)


@methods
def test_few_lit_texels_of_all_sizes(method: str) -> None:
    """What is left to a cell that has lost all its texels is no energy, but may be a rest of rounding."""
    texels = np.zeros((5, 12, 3), np.float32)
    texels[[0, 1], 0, 0], texels[2, 1, 0], texels[3, 1, 2] = [10, 2], 1, 1
    check(light_rig(method, EnvironmentMap(texels), 7), EnvironmentMap(texels), 7)


@methods
def test_same_seed_same_rig(method: str) -> None:
    environment = EnvironmentMap(MAPS["random"])
    first, second = light_rig(method, environment, 25), light_rig(method, environment, 25)
    for field in dataclasses.fields(LightRig):
        np.testing.assert_array_equal(getattr(first, field.name), getattr(second, field.name))


@pytest.mark.parametrize("method", ["structured", "kmeans"])
def test_other_seed_other_rig(method: str) -> None:
    environment = EnvironmentMap(MAPS["blobs"])
    first, second = (light_rig(method, environment, 25, seed=seed) for seed in (1, 2))
    assert not np.array_equal(first.label, second.label)


@methods
@pytest.mark.parametrize("name", ["hall", "sun", "random", "blobs"])
def test_scale_changes_nothing_but_colours(method: str, name: str) -> None:
    dim, bright = (light_rig(method, EnvironmentMap(MAPS[name] * np.float32(s)), 30) for s in (1, 4))
    np.testing.assert_array_equal(dim.label, bright.label)
    np.testing.assert_allclose(dim.direction, bright.direction, atol=1e-9)
    np.testing.assert_allclose(4 * dim.colour, bright.colour, rtol=1e-9)


@methods
def test_irradiance_converges(method: str) -> None:
    environment = EnvironmentMap(MAPS["blobs"])
    points = texel_directions(environment.height, environment.width)
    flux = environment.texels.reshape(-1, 3) * texel_solid_angle(environment.height, environment.width).reshape(-1, 1)
    normals = points[::97]
    exact = np.maximum(normals @ points.T, 0) @ flux

    def error(n: int) -> float:
        rig = light_rig(method, environment, n)
        return float(np.abs(np.maximum(normals @ rig.direction.T, 0) @ rig.colour - exact).mean() / exact.mean())

    assert error(200) < 0.01
    assert error(200) < error(6) / 4


@methods
def test_texels_by_light(method: str) -> None:
    rig = light_rig(method, EnvironmentMap(MAPS["hall"]), 20)
    order, offset = rig.texels_by_light()
    assert offset[0] == 0
    assert offset[-1] == rig.label.size
    np.testing.assert_array_equal(np.sort(order), np.arange(rig.label.size))
    for k in range(len(rig)):
        np.testing.assert_array_equal(order[offset[k] : offset[k + 1]], np.flatnonzero(rig.label.ravel() == k))


@methods
@pytest.mark.parametrize("n", [0, -3])
def test_too_few_lights(method: str, n: int) -> None:
    with pytest.raises(InputError, match=f"^number of lights: {n} is too few; give at least 1$"):
        light_rig(method, EnvironmentMap(MAPS["constant"]), n)


def test_unknown_technique() -> None:
    with pytest.raises(
        InputError, match="'voronoi' is unknown; give one of median-cut, structured, kmeans, lloyd, penro"
    ):
        light_rig("voronoi", EnvironmentMap(MAPS["constant"]), 4)


@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("median-cut", {"seed": 1}),
        ("median-cut", {"placement": "top"}),
        ("structured", {"placement": "top"}),
        ("structured", {"levels": 0}),
        ("structured", {"cap": 0.0}),
        ("kmeans", {"restarts": 0}),
        ("kmeans", {"iterations": 0}),
        ("kmeans", {"resolution": (0, 4)}),
        ("lloyd", {"insert": "top"}),
        ("lloyd", {"weight": "top"}),
        ("lloyd", {"growth": 1.0}),
        ("lloyd", {"iterations": -1}),
        ("penrose", {"seed": 1}),
    ],
)
def test_bad_options(method: str, options: dict[str, object]) -> None:
    with pytest.raises(InputError):
        light_rig(method, EnvironmentMap(MAPS["constant"]), 4, **options)


def test_rig_from_labels_sums_and_leaves_out_the_empty() -> None:
    environment = EnvironmentMap(MAPS["random"])
    label = np.repeat(np.array([[0, 2, 3, 5]]), 12, axis=1).repeat(24, axis=0)
    directions = np.eye(3)[[0, 1, 2, 0, 1, 2]]
    rig = rig_from_labels(environment, label, "by hand", directions)
    check(rig, environment, 4)
    assert len(rig) == 4
    np.testing.assert_array_equal(rig.direction, directions[[0, 2, 3, 5]])
    weight = texel_solid_angle(24, 48)[:, 12:24, None]
    np.testing.assert_allclose(rig.colour[1], np.sum(weight * environment.texels[:, 12:24], axis=(0, 1)), rtol=1e-6)
    # Without directions, a light is at the energy centroid.
    points = texel_directions(24, 48).reshape(24, 48, 3)[:, 12:24]
    moment = np.sum(weight * environment.luminance[:, 12:24, None] * points, axis=(0, 1))
    centroid = rig_from_labels(environment, label, "by hand").direction[1]
    np.testing.assert_allclose(centroid, moment / np.linalg.norm(moment), rtol=1e-6)


def test_a_light_of_one_texel_is_no_empty_one() -> None:
    environment = EnvironmentMap(MAPS["random"])
    label = np.zeros((24, 48), np.int32)
    label[5, 7] = 2
    rig = rig_from_labels(environment, label, "by hand", np.eye(3))
    np.testing.assert_array_equal(rig.direction, np.eye(3)[[0, 2]])
    np.testing.assert_array_equal(rig.label, label // 2)
    np.testing.assert_allclose(rig.colour[1], texel_solid_angle(24, 48)[5, 7] * environment.texels[5, 7], rtol=1e-6)


def test_labels_of_another_shape_are_refused() -> None:
    with pytest.raises(InputError, match=r"labels \(24, 47\) do not fit the map's \(24, 48\) texels"):
        rig_from_labels(EnvironmentMap(MAPS["random"]), np.zeros((24, 47), np.int32), "by hand")


def test_rigs_that_do_not_fit_are_refused() -> None:
    label = np.zeros((3, 2), np.int32)
    up, one = np.array([[0.0, 1.0, 0.0]]), np.ones((1, 3))
    LightRig(up, one, label, "good")
    for direction, colour, labels in [
        (2 * up, one, label),
        (up, one[:, :2], label),
        (up, -one, label),
        (up, np.full((1, 3), np.nan), label),
        (up, one, label.astype(np.int64)),
        (up, one, label - 1),
        (up, one, label + 1),
        (up, one, np.arange(6, dtype=np.int32).reshape(3, 2) % 2),
        (np.repeat(up, 2, axis=0), np.repeat(one, 2, axis=0), label),
        (up[:0], one[:0], label),
    ]:
        with pytest.raises(InputError):
            LightRig(direction, colour, labels, "bad")


@methods
def test_real_map(method: str) -> None:
    environment = EnvironmentMap.load(asset("envmaps/grace_latlong.exr"))
    rig = light_rig(method, environment, 64)
    check(rig, environment, 64)
    assert len(rig) == 64
