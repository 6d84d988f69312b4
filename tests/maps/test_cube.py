"""Cube-face maps to latitude-longitude."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import EnvironmentMap, EnvironmentMapWarning, InputError
from stratalux.maps.cube import from_cube, look_up
from stratalux.maps.geometry import direction, texel_solid_angle
from tests.images.make import exr

SIDE = 24


def of_direction(d: NDArray[np.float64]) -> NDArray[np.float64]:
    """A smooth radiance that tells all axes apart."""
    x, y, z = np.moveaxis(d / np.linalg.norm(d, axis=-1, keepdims=True), -1, 0)
    return np.stack([3 + 2 * x + y * z, 3 + 2 * y - x * z, 3 + 2 * z + x * y * 2], axis=-1)


def cube(side: int) -> NDArray[np.float32]:
    """Faces as OpenEXR's ImfEnvmap.cpp has them: where each pixel of each face points to."""
    rows, columns = np.mgrid[:side, :side]
    right, down = 2 * columns / (side - 1) - 1, 2 * rows / (side - 1) - 1
    one = np.ones_like(right)
    faces = [
        (one, -down, right),
        (-one, -down, -right),
        (right, one, -down),
        (right, -one, down),
        (-right, -down, one),
        (right, -down, -one),
    ]
    return np.concatenate([of_direction(np.stack(face, axis=-1)) for face in faces]).astype(np.float32)


def test_directions_are_those_of_openexr() -> None:
    d = np.random.default_rng(0).normal(size=(5000, 3))
    np.testing.assert_allclose(look_up(cube(96), d), of_direction(d), atol=2e-3)
    texels = from_cube(cube(SIDE))
    assert texels.shape == (2 * SIDE, 4 * SIDE, 3)
    u, v = (np.arange(4 * SIDE) + 0.5) / (4 * SIDE), np.arange(2 * SIDE) / (2 * SIDE - 1)
    np.testing.assert_allclose(texels, of_direction(direction(*np.broadcast_arrays(u, v[:, None]))), atol=0.02)


def test_a_sun_of_one_pixel_keeps_its_energy() -> None:
    """Against its solid angle: that of the hat function around the pixel."""
    fine = 200
    for face, row, column in ((0, 12, 12), (2, 3, 20), (5, 1, 1), (3, 12, 22)):
        faces = np.zeros((6 * SIDE, SIDE, 3), dtype=np.float32)
        faces[face * SIDE + row, column] = 1000
        texels = from_cube(faces)
        flux = (texels * texel_solid_angle(*texels.shape[:2])[..., None]).sum(axis=(0, 1))
        t = 2 * (np.arange(fine) + 0.5) / fine - 1
        hat = (1 - abs(t)) * (1 - abs(t[:, None]))
        x, y = (2 * (at + t) / (SIDE - 1) - 1 for at in (column, row))
        solid_angle = (hat / (1 + x**2 + y[:, None] ** 2) ** 1.5).sum() * (2 / fine * 2 / (SIDE - 1)) ** 2
        np.testing.assert_allclose(flux, 1000 * solid_angle, rtol=0.04)


@pytest.mark.parametrize("side", [2, 3, SIDE])
def test_corners_and_edges_are_those_of_the_outer_pixels(side: int) -> None:
    ends = np.array([-1.0, 0, 1])
    d = np.stack(np.meshgrid(ends, ends, ends), axis=-1).reshape(-1, 3)
    outer = d[np.abs(d).sum(axis=1) >= (3 if side % 2 == 0 else 1)]  # of an even number, no pixel is in the middle
    np.testing.assert_allclose(look_up(cube(side), outer), of_direction(outer), rtol=1e-5)


def test_it_makes_no_difference_how_many_rows_are_made_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    at_once = from_cube(cube(6))
    monkeypatch.setattr("stratalux.maps.cube._LOOKUPS", 5 * 24 * 9)
    np.testing.assert_array_equal(from_cube(cube(6)), at_once)


def test_faces_of_one_pixel() -> None:
    texels = from_cube(np.ones((6, 1, 3), dtype=np.float32))
    assert texels.shape == (4, 4, 3) and (texels == 1).all()


def test_files_with_the_attribute_are_converted_or_refused(tmp_path: Path) -> None:
    channels = dict(zip("RGB", np.moveaxis(cube(SIDE), 2, 0), strict=True))
    path = tmp_path / "a.exr"
    path.write_bytes(exr(channels, envmap=("envmap", b"\1")))
    with pytest.warns(EnvironmentMapWarning, match="six faces of a cube are converted to 96x48"):
        np.testing.assert_array_equal(EnvironmentMap.load(path).texels, from_cube(cube(SIDE)))
    path.write_bytes(exr({name: x[:-1] for name, x in channels.items()}, envmap=("envmap", b"\1")))
    with pytest.raises(InputError, match="24x143 are not the six faces of a cube"):
        EnvironmentMap.load(path)
