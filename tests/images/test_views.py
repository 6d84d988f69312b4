"""View transforms: values that are known, and what all of them have in common."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux.images.settings import VIEW_NAMES
from stratalux.images.tonemap import tonemap, view_codes, whole
from stratalux.images.views import VIEWS, encode


def shown(view: str, *colours: tuple[float, float, float]) -> NDArray[np.floating]:
    return VIEWS[view](np.array([colours], dtype=np.float32))[0]


def linear(codes: NDArray[np.floating]) -> NDArray[np.floating]:
    """What codes of sRGB stand for."""
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def test_the_settings_name_them_all() -> None:
    assert tuple(VIEWS) == VIEW_NAMES


@pytest.mark.parametrize("view", VIEWS)
def test_black_stays_black_and_grey_rises(view: str) -> None:
    ramp = np.concatenate([[0], np.geomspace(1e-6, 1e30, 2000)]).astype(np.float32)
    codes = tonemap(ramp[None, :, None].repeat(3, axis=2), 0.0, view)[0].astype(int)
    assert codes[0].tolist() == [0, 0, 0] and codes[-1].min() >= 250
    assert (np.diff(codes, axis=0) >= 0).all()
    assert (np.ptp(codes, axis=1) <= 1).all()  # grey stays grey


@pytest.mark.parametrize("view", VIEWS)
def test_nothing_comes_out_that_is_no_colour(view: str) -> None:
    wild = [np.nan, np.inf, -np.inf, -1, 0, 1e-30, 1, 65504, 3e38]
    pixels = np.array([[(a, b, c) for a in wild for b in wild] for c in wild], dtype=np.float32)
    for exposure in (-100.0, 0.0, 100.0):
        with np.errstate(over="ignore"):  # sums of neighbours
            codes = view_codes(pixels, exposure, view)
        assert codes.shape == pixels.shape and np.isfinite(codes).all()


@pytest.mark.parametrize("view", VIEWS)
def test_an_exposure_is_a_factor(view: str) -> None:
    pixels = np.random.default_rng(3).uniform(0, 2, (5, 6, 3)).astype(np.float32)
    np.testing.assert_allclose(view_codes(pixels, 1.5, view), view_codes(pixels * 2**1.5, 0.0, view), atol=1e-5)


def test_standard_is_srgb_and_nothing_else() -> None:
    np.testing.assert_allclose(
        linear(shown("standard", (0.18, 0.5, 1), (2, 0.001, 0))), [[0.18, 0.5, 1], [1, 0.001, 0]]
    )


def test_hable_by_hand() -> None:
    """0.18 is 0.36 after its stop, 5.6 is white, and the constants make fractions."""

    def curve(x: float) -> float:
        return (x * (0.15 * x + 0.05) + 0.004) / (x * (0.15 * x + 0.5) + 0.06) - 1 / 15

    expected = [curve(0.36) / curve(11.2), curve(2) / curve(11.2), 1]
    np.testing.assert_allclose(linear(shown("filmic", (0.18, 1, 5.6)))[0], expected, rtol=1e-5)
    assert expected[0] == pytest.approx(0.128338, rel=1e-5)


def test_aces_gives_the_numbers_of_opencolorio() -> None:
    """Those of OpenColorIO 2.6 itself, for the same display and view of its built-in configuration."""
    codes = shown("aces", (0.18, 0.18, 0.18), (1, 1, 1), (1, 0, 0), (100, 10, 1))
    expected = [
        [0.35595229, 0.35595256, 0.35595250],
        [0.81197482, 0.81197500, 0.81197494],
        [0.80375695, -0.09785330, 0.02450269],
        [1.02690300, 0.99925524, 0.96212953],
    ]
    np.testing.assert_allclose(codes, expected, atol=2e-3)


def test_agx_of_greys() -> None:
    """The polynomial at (log₂ 0.18 + 12.47393) / 16.499999, at its ends, and beyond; both matrices keep grey."""
    x = (np.log2(0.18) + 12.47393) / 16.499999
    middle = np.polyval([15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232], x)
    codes = shown("agx", (0.18, 0.18, 0.18), (16.3, 16.3, 16.3), (1e6, 1e6, 1e6), (0, 0, 0))
    np.testing.assert_allclose(codes, np.array([[middle], [0.99858], [0.99858], [-0.00232]]) + np.zeros(3), atol=2e-4)
    # Red that is far too bright goes to white.
    red, bright = shown("agx", (0.5, 0.01, 0.01), (500, 10, 10))
    assert np.ptp(red) > 0.5 and red.argmax() == 0 and np.ptp(bright) < 0.01


def test_neutral_as_its_specification_says() -> None:
    """Up to 0.8, colours keep what they are but for 0.04; white light becomes 1 - 0.24² / (0.96 + 0.24 - 0.76)."""
    codes = linear(shown("neutral", (0.5, 0.3, 0.2), (0.79, 0.79, 0.79), (1, 1, 1), (0.04, 0.3, 0.3)))
    offset = 0.04 - 6.25 * 0.04**2
    expected = [[0.46, 0.26, 0.16], [0.75] * 3, [1 - 0.0576 / 0.44] * 3, [0.04 - offset, 0.3 - offset, 0.3 - offset]]
    np.testing.assert_allclose(codes, expected, rtol=1e-4)
    # Red of 4: its peak is compressed, and some white is added.
    peak, compressed = 4.0, 1 - 0.0576 / (4 + 0.24 - 0.76)
    white = 1 - 1 / (0.15 * (peak - compressed) + 1)
    red = linear(shown("neutral", (4, 0, 0)))[0]
    np.testing.assert_allclose(red, [compressed, compressed * white, compressed * white], rtol=1e-4)


def test_reinhard_is_the_shoulder_of_before() -> None:
    """White 16 times above middle white; 1.18 gives back what 0.18 loses."""
    L = 0.18
    expected = encode(np.full((1, 3), 1.18 * L * (1 + L / 256) / (1 + L)))
    np.testing.assert_allclose(shown("reinhard", (L, L, L)), expected, rtol=1e-5)


@pytest.mark.parametrize("bits", [8, 16])
def test_whole_numbers(bits: int) -> None:
    most = 2**bits - 1
    codes = np.array([-1, 0, 0.49 / most, 0.51 / most, 0.5, 1, 2])
    assert whole(codes, bits).tolist() == [0, 0, 0, 1, (most + 1) // 2, most, most]
    assert whole(codes, bits).dtype.itemsize == bits // 8
