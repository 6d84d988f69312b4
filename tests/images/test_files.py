"""Names of files, and tone mapping."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stratalux import EnvironmentMap, InputError, median_cut
from stratalux.images.files import check_output, write_atomically
from stratalux.images.tonemap import auto_exposure, tonemap
from stratalux.rigs.picture import draw_regions
from tests.helpers import hall_map


def test_tonemap_keeps_order_grey_and_black() -> None:
    ramp = np.repeat(np.linspace(0, 50, 500, dtype=np.float32)[None, :, None], 3, axis=2)
    grey = tonemap(ramp, 0)[0]
    assert grey[0].tolist() == [0, 0, 0]
    assert (np.diff(grey[:, 0].astype(int)) >= 0).all() and grey[-1, 0] >= 250
    assert (grey == grey[:, :1]).all()
    middle = tonemap(np.full((1, 1, 3), 0.18, dtype=np.float32), 0)[0, 0, 0]
    assert middle == pytest.approx(118, abs=2)  # sRGB of 18 % grey


def test_automatic_exposure_is_free_of_scale() -> None:
    pixels = hall_map()
    assert auto_exposure(pixels * 8) == pytest.approx(auto_exposure(pixels) - 3, abs=1e-4)
    np.testing.assert_allclose(tonemap(pixels * 8), tonemap(pixels), atol=1)
    assert auto_exposure(np.zeros((2, 2, 3), dtype=np.float32)) == 0


def test_tonemap_survives_bad_pixels() -> None:
    pixels = np.array([[[np.nan, 1, 1], [np.inf, 0, 0], [-1, -1, -1]]], dtype=np.float32)
    assert tonemap(pixels, 0).shape == (1, 3, 3)


def test_unwritable_places_are_refused(tmp_path: Path) -> None:
    for path, message in (
        (tmp_path / "no" / "a.exr", "cannot be written"),
        (tmp_path / "a.gif", "unknown image format"),
        (tmp_path, "unknown image format"),
        (Path("/proc/a.exr"), "cannot be written"),
    ):
        with pytest.raises(InputError, match=message):
            check_output(path)
    folder = tmp_path / "folder.exr"
    folder.mkdir()
    with pytest.raises(InputError, match="is a folder"):
        check_output(folder)


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fail(name: str) -> None:
        Path(name).write_text("half")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_atomically(path, fail)
    assert path.read_text() == "old" and len(list(tmp_path.iterdir())) == 1


def test_region_borders_are_drawn_on_the_map() -> None:
    environment = EnvironmentMap(hall_map())
    picture = draw_regions(environment, median_cut(environment, 16))
    assert picture.dtype == np.uint8 and picture.shape[1] >= 1024
    plain = draw_regions(environment, median_cut(environment, 1))
    assert (picture != plain).any(axis=2).sum() > 1000
