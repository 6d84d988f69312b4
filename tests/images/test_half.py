"""Half floats are converted exactly."""

from __future__ import annotations

import numpy as np

from stratalux.images.half import single


def test_every_finite_half_float_that_is_not_negative() -> None:
    halves = np.arange(0x7C00, dtype=np.uint16).view(np.float16).reshape(2, -1)
    np.testing.assert_array_equal(single(halves), halves.astype(np.float32))
    np.testing.assert_array_equal(single(halves[:, ::3]), halves[:, ::3].astype(np.float32))
    np.testing.assert_array_equal(single(np.array([-0.0], dtype=np.float16)), [0])


def test_what_is_single_is_not_copied() -> None:
    texels = np.ones((2, 3, 3), dtype=np.float32)
    assert single(texels) is texels
