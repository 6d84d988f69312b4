"""Large models: nothing is done face by face in Python, and nothing that is not needed."""

from __future__ import annotations

import sys
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stratalux.errors import InputError
from stratalux.scenes.mesh import TriangleMesh
from stratalux.scenes.model import Instance, Model, Part
from stratalux.scenes.shapes import load_object, object_of
from tests.scenes.formats.gltf_files import Gltf


def grid(side: int) -> tuple[Any, Any]:
    """A hilly square of 2 (side - 1)² triangles: vertices (V, 3) and faces (F, 3)."""
    x, y = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side))
    first = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.stack([first, first + 1, first + side + 1, first, first + side + 1, first + side], axis=1)
    return np.stack([x, y, 0.1 * np.sin(9 * x * y)], axis=2).reshape(-1, 3), faces.reshape(-1, 3)


def written(folder: Path, side: int) -> Path:
    vertices, faces = grid(side)
    file = Gltf()
    up = np.tile(np.array([0, 0, 1], np.float32), (len(vertices), 1))
    uv = file.accessor(vertices[:, :2].astype(np.float32))
    attributes = {"NORMAL": file.accessor(up), "TEXCOORD_0": uv}
    surface = file.primitive(vertices.astype(np.float32), faces.ravel().astype(np.uint32), attributes=attributes)
    file.add("scenes", nodes=[file.show(surface)])
    path = folder / f"{side}.glb"
    file.write(path)
    return path


def calls(path: Path) -> int:
    """Functions, of Python or C, that are called to load a file."""
    count = 0

    def note(_frame: Any, event: str, _argument: Any) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(note)
    try:
        load_object(path)
    finally:
        sys.setprofile(None)
    return count


def test_200_000_triangles_are_as_many_calls_as_200(tmp_path: Path) -> None:
    few, many = written(tmp_path, 11), written(tmp_path, 317)
    load_object(few)  # what is imported on the way
    few_calls, many_calls = calls(few), calls(many)
    assert len(load_object(many).shapes[0].mesh.faces) == 199_712
    assert many_calls < few_calls + 1000


def test_memory_is_a_few_times_that_of_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, 317)
    load_object(path)
    tracemalloc.start()
    try:
        found = load_object(path)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(found.shapes) == 1 and most < 6 * path.stat().st_size


@pytest.mark.parametrize("side", [3, 300])
def test_what_has_no_area_and_what_has_no_face_is_dropped(side: int) -> None:
    """At the end of a mesh of more faces than are looked at together, too; the order stays."""
    vertices, faces = grid(side)
    vertices = np.concatenate([[[9.0, 9, 9]], vertices, [[np.nan] * 3]])
    flat = np.array([[1, 1, 2], [3, 4, 3]])
    uv = vertices[:, :2].copy()
    part = Part(vertices, np.concatenate([flat, faces + 1, flat]), np.ones_like(vertices), {0: uv})
    mesh = object_of(Path("a"), Model.of(part)).shapes[0].mesh
    np.testing.assert_array_equal(mesh.faces, faces)
    assert len(mesh.vertices) == side * side
    np.testing.assert_allclose(mesh.attributes["uv"], uv[1:-1])
    with pytest.raises(InputError, match="not a finite"):
        object_of(Path("a"), Model.of(Part(vertices, np.array([[1, 2, len(vertices) - 1]]))))


def test_bounds_are_those_of_the_points() -> None:
    vertices, faces = grid(5)
    moved, turned = np.eye(4), np.eye(4)
    moved[:3, 3] = [3, -2, 1]
    turned[:3, :3] = [[0, -2, 0], [2, 0, 0], [0, 0, 2]]
    for matrices in ([moved], [turned], [moved, turned, moved @ turned]):
        model = Model([Part(vertices, faces)], [Instance(0, matrix) for matrix in matrices])
        found = object_of(Path("a"), model)
        points = found.points()
        np.testing.assert_allclose(found.bounds, [points.min(axis=0), points.max(axis=0)], atol=1e-6)


def test_a_mesh_that_is_only_moved_keeps_its_normals() -> None:
    mesh = TriangleMesh(*grid(3), normals=np.tile([0.0, 0, 1], (9, 1)))
    matrix = np.eye(4)
    matrix[:3, 3] = [1, 2, 3]
    moved = mesh.transformed(matrix)
    np.testing.assert_array_equal(moved.vertices, mesh.vertices + np.float32([1, 2, 3]))
    assert moved.normals is mesh.normals
