"""Pixels as text, and back."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from stratalux.images.tonemap import tonemap
from stratalux.report.colours import MAGMA, SIGNED, VIRIDIS, interpolate
from stratalux.report.encode import compress, decode_pixels, decompress, encode_pixels, encode_unit


@pytest.mark.parametrize("gain", [1.0, 1e-2, 1e6])
def test_pixels_come_back_with_eleven_bits(gain: float) -> None:
    rng = np.random.default_rng(1)
    image = (gain * rng.lognormal(size=(11, 7, 3)) * rng.choice([-1, 1], size=(11, 7, 3))).astype(np.float32)
    text, scale = encode_pixels(image)
    assert scale == 1.0 or gain > 1e3
    assert_allclose(decode_pixels(text, 11, 7, scale), image, rtol=2.0**-11, atol=scale * 2.0**-25)


def test_what_is_not_finite_stays_so() -> None:
    image = np.zeros((2, 2, 3), dtype=np.float32)
    image[0, 0] = [np.inf, np.nan, -np.inf]
    text, scale = encode_pixels(image)
    assert_array_equal(decode_pixels(text, 2, 2, scale), image)


def test_a_halved_precision_cannot_be_seen() -> None:
    image = np.random.default_rng(2).lognormal(sigma=2, size=(40, 60, 3)).astype(np.float32)
    text, scale = encode_pixels(image)
    assert np.abs(tonemap(decode_pixels(text, 40, 60, scale), 0.0).astype(int) - tonemap(image, 0.0)).max() <= 1


def test_noise_takes_less_than_it_would_as_it_is() -> None:
    """Half floats take six bytes; grey noise in a coloured image is stored once."""
    rng = np.random.default_rng(3)
    image = (rng.gamma(20, 0.05, (100, 100, 1)) * [0.9, 0.6, 0.3]).astype(np.float32)
    assert len(text := encode_pixels(image)[0]) * 3 / 4 < 3.6 * image.shape[0] * image.shape[1]
    assert text == encode_pixels(image)[0]


def test_units_in_steps_of_a_byte() -> None:
    values = np.array([[0, 0.2, 1], [2, -1, np.nan]], dtype=np.float32)
    assert decompress(encode_unit(values)).tolist() == [0, 51, 255, 255, 0, 0]
    assert decompress(compress(np.arange(4, dtype=np.uint8))).tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize(("name", "anchors"), [("magma", MAGMA), ("viridis", VIRIDIS)])
def test_colour_maps_are_those_of_matplotlib(name: str, anchors: str) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    t = np.linspace(0, 1, 256)
    assert np.abs(matplotlib.colormaps[name](t)[:, :3] * 255 - interpolate(anchors, t)).max() < 6


def test_no_error_is_no_colour() -> None:
    assert np.ptp(interpolate(SIGNED, np.array(0.5)).astype(int)) < 8
