"""From radiance to a picture: known bytes, and no holes."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from stratalux.images.tonemap import auto_exposure, filled, srgb, tonemap
from stratalux.images.writing import write_image

KNOWN = {
    0.0: 0,
    0.002: 7,
    0.0031308: 10,
    0.01: 25,
    0.05: 63,
    0.18: 118,
    0.2: 124,
    0.5: 188,
    0.75: 225,
    0.9: 243,
    1.0: 255,
}
"""Codes of linear values, by IEC 61966-2-1; an exponent of 1 / 2.35 in place of 1 / 2.4 has 0.5 at 186."""


@pytest.mark.parametrize(("linear", "code"), KNOWN.items())
def test_the_curve_of_srgb(linear: float, code: int) -> None:
    assert srgb(np.array([linear])) == code


def test_bytes_of_a_png(tmp_path: Path) -> None:
    """The shoulder turns L into 1.18 L (1 + L / 256) / (1 + L): a value that comes out at 0.5 has the code 188."""
    L = np.roots([1.18 / 256, 1.18 - 0.5, -0.5]).max()
    write_image(tmp_path / "a.png", mi.Bitmap(np.full((2, 3, 3), L, dtype=np.float32)), exposure=0)
    assert np.array_equal(np.array(mi.Bitmap(str(tmp_path / "a.png"))), np.full((2, 3, 3), 188))


def test_pixels_below_zero_are_filled_from_around() -> None:
    pixels = np.arange(27, dtype=np.float32).reshape(3, 3, 3) / 27
    pixels[1, 1] = [0.5, -0.1, 0.5]
    around = np.delete(pixels.reshape(9, 3), 4, axis=0)
    result = filled(pixels)
    np.testing.assert_allclose(result[1, 1], around.mean(axis=0), rtol=1e-6)
    result[1, 1] = pixels[1, 1]
    np.testing.assert_array_equal(result, pixels)


def test_a_hole_does_not_show() -> None:
    """It has the code of the grey around it, at corners and beside other holes, too."""
    grey = np.full((6, 7, 3), 0.02, dtype=np.float32)
    holes = grey.copy()
    for y, x in ((0, 0), (3, 3), (3, 4), (5, 6)):
        holes[y, x] = -0.01
    assert np.array_equal(tonemap(holes, 2.0), tonemap(grey, 2.0))


def test_nothing_but_holes_is_black() -> None:
    assert np.array_equal(filled(np.full((1, 2, 3), -1, dtype=np.float32)), np.zeros((1, 2, 3)))
    assert np.array_equal(filled(np.array([[[-1, 2, 3]]], dtype=np.float32)), [[[0, 2, 3]]])


def test_a_weight_meters_the_object_alone() -> None:
    pixels = np.full((4, 5, 3), 8, dtype=np.float32)
    pixels[:2] = 0.5
    weight = np.zeros((4, 5))
    weight[:2] = 1
    assert auto_exposure(pixels, weight) == pytest.approx(np.log2(0.18 / 0.5), abs=1e-5)
    assert auto_exposure(pixels, np.ones((4, 5))) == auto_exposure(pixels)
    assert auto_exposure(pixels) == pytest.approx(np.log2(0.18 / 2), abs=1e-5)
    weight[:2], weight[2:] = 3, 1
    assert auto_exposure(pixels, weight) == pytest.approx(np.log2(0.18 / 1), abs=1e-5)
    assert auto_exposure(pixels, np.zeros((4, 5))) == 0
