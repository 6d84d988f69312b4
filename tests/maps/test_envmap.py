"""The environment map: what it accepts, repairs and refuses."""

from __future__ import annotations

import warnings
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from stratalux import EnvironmentMap, EnvironmentMapWarning, InputError
from stratalux.maps.envmap import cell_energy
from stratalux.maps.geometry import row_weights
from tests.helpers import hall_map
from tests.images.make import write


@pytest.mark.parametrize("shape", [(4, 8), (4, 8, 1), (4, 8, 3), (4, 8, 4)])
def test_accepts_images(shape: tuple[int, ...]) -> None:
    assert EnvironmentMap.from_array(np.ones(shape)).texels.shape == (4, 8, 3)


@pytest.mark.parametrize("array", [np.ones(8), np.ones((4, 8, 2)), np.ones((0, 8, 3)), np.full((4, 8, 3), "x")])
def test_refuses_what_is_no_image(array: np.ndarray) -> None:
    with pytest.raises(InputError, match="map.exr"):
        EnvironmentMap.from_array(array, "map.exr")


def test_repairs_and_counts_bad_texels() -> None:
    texels = np.ones((4, 8, 3), dtype=np.float32)
    texels[0, 0] = np.nan
    texels[1, 1, 2] = np.inf
    texels[2, 2:5] = -3
    texels[3, 3] = 7
    with pytest.warns(EnvironmentMapWarning, match=r"m: 1 NaN, 1 infinite, 3 negative texel"):
        repaired = EnvironmentMap.from_array(texels, "m").texels
    assert repaired[0, 0].tolist() == [0, 0, 0]
    assert repaired[1, 1].tolist() == [1, 1, 70]
    assert (repaired[2, 2:5] == 0).all()


def test_sound_maps_are_left_alone() -> None:
    texels = np.random.default_rng(0).random((4, 8, 3)).astype(np.float32)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.array_equal(EnvironmentMap.from_array(texels).texels, texels)


def test_other_proportions_are_taken_with_a_warning() -> None:
    with pytest.warns(EnvironmentMapWarning, match="7x5 is not 2:1"):
        EnvironmentMap.from_array(np.ones((5, 7, 3)), "m")


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (2, 4), (3, 1)])
def test_small_maps_are_padded_as_mitsuba_does(shape: tuple[int, int]) -> None:
    texels = np.random.default_rng(0).random((*shape, 3)).astype(np.float32)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ours = EnvironmentMap.from_array(texels).texels
    emitter = mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(texels)})
    np.testing.assert_array_equal(ours, mi.traverse(emitter)["data"].numpy()[:, 1:-1])


def test_cell_energy_integrates_the_bilinear_radiance() -> None:
    environment = EnvironmentMap.from_array(hall_map())
    height, width = environment.height, environment.width
    i, j, fine = 7, 31, 400
    s, t = np.meshgrid(*2 * [(np.arange(fine) + 0.5) / fine])
    y = environment.luminance
    bilinear = (1 - t) * ((1 - s) * y[i, j] + s * y[i, j + 1]) + t * ((1 - s) * y[i + 1, j] + s * y[i + 1, j + 1])
    area = 2 * np.pi / width * np.pi / (height - 1)
    numeric = (bilinear * np.sin(np.pi * (i + t) / (height - 1))).mean() * area
    assert environment.cell_energy[i, j] == pytest.approx(numeric, rel=1e-5)


@pytest.mark.parametrize("height", [3, 16, 17, 18, 40])
def test_every_cell_has_its_energy(height: int) -> None:
    """Of maps whose rows of cells fill blocks of 16 exactly, and of those that leave one over."""
    luminance = np.random.default_rng(height).random((height, 5)).astype(np.float32)
    upper, lower = row_weights(height)
    pairs = (luminance.astype(np.float64) + np.roll(luminance, -1, axis=1)) / 2
    expected = 2 * np.pi / 5 * (upper[:, None] * pairs[:-1] + lower[:, None] * pairs[1:])
    np.testing.assert_allclose(cell_energy(luminance), expected, rtol=1e-12)


@pytest.mark.parametrize("suffix", [".exr", ".hdr", ".pfm"])
def test_reads_files(tmp_path: Path, suffix: str) -> None:
    texels = np.full((4, 8, 3), 0.5, dtype=np.float32)
    path = tmp_path / f"map{suffix}"
    mi.Bitmap(texels).write(str(path))
    np.testing.assert_allclose(EnvironmentMap.load(path).texels, texels, rtol=1e-2)


@pytest.mark.parametrize("suffix", [".exr", ".hdr", ".pfm"])
def test_truncated_files_are_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"map{suffix}"
    mi.Bitmap(np.random.default_rng(0).random((64, 128, 3)).astype(np.float32)).write(str(path))
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(InputError, match="cannot be read as an image") as error:
        EnvironmentMap.load(path)
    assert "\n" not in str(error.value)


def test_what_a_file_says_is_told(tmp_path: Path) -> None:
    texels = np.ones((8, 16, 3), dtype=np.float32)
    texels[2, 3] = np.inf
    path = write(tmp_path / "a.exr", texels, type="half", at=(-2, -1), display=(0, 0, 12, 6))
    with pytest.warns(EnvironmentMapWarning) as told:
        environment = EnvironmentMap.load(path)
    assert environment.texels.shape == (6, 12, 3) and environment.texels[1, 1].tolist() == [65504] * 3
    cropped, repaired = (str(warning.message) for warning in told)
    assert cropped == f"{path}: pixels, 16x8 at -2,-1, in a display window, 12x6 at 0,0: what is outside is cropped"
    assert repaired.startswith(f"{path}: 1 infinite texel")
    assert all(warning.filename == __file__ for warning in told)


def test_maps_larger_than_the_memory_allowed_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.exr", np.ones((8, 16, 3), dtype=np.float32))
    assert EnvironmentMap.load(path, max_memory=12 * 8 * 16).width == 16
    with pytest.raises(InputError, match="16x8 pixels take .*more than"):
        EnvironmentMap.load(path, max_memory=1000)


def test_missing_and_foreign_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        EnvironmentMap.load(tmp_path / "none.exr")
    (tmp_path / "text.exr").write_text("not an image")
    with pytest.raises(InputError, match="cannot be read as an image"):
        EnvironmentMap.load(tmp_path / "text.exr")
