"""Polygons with values at their corners: vertices are split where these differ, and shared where they do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stratalux.errors import SceneWarning
from stratalux.scenes.formats import surface
from stratalux.scenes.formats.surface import Table, merged, of_faces, parts_of_polygons
from stratalux.scenes.model import NONE, Material

PATH = Path("mesh")


@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_every_corner_keeps_its_values_and_every_face_its_material(data: st.DataObject) -> None:
    count = data.draw(st.integers(1, 12))
    rng = np.random.default_rng(data.draw(st.integers(0, 1 << 30)))
    vertices, normals, uvs = rng.random((6, 3)), rng.random((4, 3)), rng.random((5, 2))
    corners = np.stack([rng.permutation(6)[:3] for _ in range(count)]).reshape(-1)
    numbers, places = rng.integers(-1, 5, 3 * count), rng.integers(-1, 6, 3 * count)
    chosen = rng.integers(0, 3, count)
    colours = rng.random((count, 4))
    materials = [Material(str(n)) for n in range(3)]
    found = parts_of_polygons(
        PATH,
        vertices,
        corners,
        np.full(count, 3),
        normals=Table(normals, numbers),
        uvs={1: Table(uvs, places)},
        colours=of_faces(colours, np.full(count, 3)),
        materials=materials,
        chosen=chosen,
    )
    assert [part.name for part in found] == [str(n) for n in sorted(set(chosen.tolist()))]
    for part in found:
        mine = np.repeat(chosen == int(part.name), 3)
        expected = {
            "vertices": vertices[corners],
            "colours": np.repeat(colours, 3, axis=0),
            "uvs": np.concatenate([uvs, np.zeros((1, 2))])[np.where(places < 5, places, -1)],
        }
        at = part.faces.reshape(-1)
        np.testing.assert_array_equal(part.vertices[at], expected["vertices"][mine])
        assert part.colours is not None
        np.testing.assert_array_equal(part.colours[at], expected["colours"][mine])
        if 1 in part.uvs:
            np.testing.assert_array_equal(part.uvs[1][at], expected["uvs"][mine])
        else:
            assert not np.any((places >= 0) & (places < 5))
        with_nan = np.concatenate([normals, np.full((1, 3), np.nan)])
        if part.normals is not None:
            np.testing.assert_array_equal(part.normals[at], with_nan[np.where(numbers < 4, numbers, -1)][mine])
        assert sorted(set(at.tolist())) == list(range(len(part.vertices)))


def test_vertices_are_shared_where_corners_agree() -> None:
    corners = np.array([0, 1, 2, 0, 2, 3])
    (part,) = parts_of_polygons(PATH, np.eye(4, 3), corners, np.array([3, 3]), uvs={0: Table(np.eye(4, 2), corners)})
    assert len(part.vertices) == 4 and part.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    smooth = Table(np.eye(9, 3), np.array([5, 5, 6, 5, 6, 7]))
    (part,) = parts_of_polygons(PATH, np.eye(4, 3), corners, np.array([3, 3]), normals=smooth)
    assert len(part.vertices) == 4
    flat = of_faces(np.eye(2, 4), np.array([3, 3]))
    (part,) = parts_of_polygons(PATH, np.eye(4, 3), corners, np.array([3, 3]), colours=flat)
    assert len(part.vertices) == 6


def test_more_combinations_than_64_bits_hold() -> None:
    many = 1 << 22
    corners = np.array([0, 1, many - 1])
    table = Table(np.broadcast_to(np.ones(2), (many, 2)), np.array([many - 1, 3, 2]))
    (part,) = parts_of_polygons(
        PATH,
        np.broadcast_to(np.arange(3.0), (many, 3)),
        corners,
        np.array([3]),
        uvs={n: table for n in range(5)},
    )
    assert part.faces.tolist() == [[0, 1, 2]] and len(part.uvs) == 5
    assert part.uvs[4].tolist() == [[1, 1]] * 3


@pytest.mark.parametrize(
    ("alphas", "mode"), [([1, 1, 1], "opaque"), ([1, 0.5, 1], "blend"), ([0, 0, 0], "opaque"), ([0, 0, 0.5], "blend")]
)
def test_what_has_colours_alone_is_matte(alphas: list[float], mode: str) -> None:
    corners, sizes = np.arange(3), np.array([3])
    colours = np.concatenate([np.ones((3, 3)), np.array(alphas, dtype=float)[:, None]], axis=1)
    (part,) = parts_of_polygons(PATH, np.eye(3), corners, sizes, colours=Table(colours))
    assert part.material and part.material.alpha_mode == mode and part.material.vertex_colours
    assert part.material.metallic == part.material.specular == NONE and part.name == ""
    given = Material("paint")
    (part,) = parts_of_polygons(PATH, np.eye(3), corners, sizes, colours=Table(colours), materials=[given])
    assert part.material is given
    (part,) = parts_of_polygons(PATH, np.eye(3), corners, sizes)
    assert part.material is None


@given(st.lists(st.sampled_from([0.0, -0.0, 1.0, 0.1, 1e300]), min_size=2, max_size=60))
@settings(max_examples=60, deadline=None)
def test_equal_values_are_merged(numbers: list[float]) -> None:
    values = np.array(numbers[: len(numbers) // 2 * 2]).reshape(-1, 2)
    found = merged(values)
    assert found.corners is not None
    np.testing.assert_array_equal(found.values[found.corners], values)
    assert len(found.values) == len(set(values.tobytes()[at : at + 16] for at in range(0, values.nbytes, 16)))


def test_values_that_only_look_equal_stay_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(surface, "_MIXER", np.uint64(0))  # all keys are the same
    values = np.arange(6.0).reshape(3, 2)
    found = merged(values)
    np.testing.assert_array_equal(found.values[found.corners], values)


def test_values_that_are_not_finite_are_replaced() -> None:
    corners, sizes = np.arange(3), np.array([3])
    colours = np.array([[0, np.nan, 0, 1], [0, 0, 0, 1], [0, 0, np.inf, 1]])
    with pytest.warns(SceneWarning, match="mesh: colours that are not finite are replaced"):
        (part,) = parts_of_polygons(PATH, np.eye(3), corners, sizes, colours=Table(colours))
    assert part.colours is not None and part.colours.tolist() == [[0, 1, 0, 1], [0, 0, 0, 1], [0, 0, 1, 1]]
    uvs = {1: Table(np.array([[np.nan, 1], [2, 3], [4, 5]]))}
    with pytest.warns(SceneWarning, match="mesh: coordinates of textures that are not finite are replaced"):
        (part,) = parts_of_polygons(PATH, np.eye(3), corners, sizes, uvs=uvs)
    assert part.uvs[1].tolist() == [[0, 1], [2, 3], [4, 5]]
