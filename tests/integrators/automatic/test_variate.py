"""The control variate: its polynomial, and its integral over maps, against sums over many directions."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from stratalux import EnvironmentMap
from stratalux.maps.geometry import direction
from stratalux.maps.irradiance import clamped_cosine
from tests.helpers import hall_map
from tests.variants import MONO, RGB, SPECTRAL


def test_the_polynomial_is_that_of_the_clamped_cosine() -> None:
    from stratalux.integrators.automatic.variate import MatteVariate  # of the active variant

    t = np.linspace(-1, 1, 201)
    P = MatteVariate.cosine(mi.Float(t)).numpy()
    np.testing.assert_allclose(P, np.polynomial.polynomial.polyval(t, clamped_cosine()), atol=2e-6)
    assert np.abs(P - np.maximum(t, 0)).max() < 0.1


@pytest.mark.parametrize("variant", [RGB, MONO])
def test_the_integral_is_that_of_the_map_times_the_polynomial(variant: str) -> None:
    mi.set_variant(variant)
    from stratalux.integrators.automatic.variate import MatteVariate

    texels = hall_map(25, 47)
    rows, columns = 24 * 40, 47 * 8  # midpoints, which are exact for what is linear, of cells of the lookup
    v, u = (np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns
    x, y = u * 47 - 0.5, v * 24
    j, i = np.floor(x).astype(int), np.minimum(np.floor(y).astype(int), 23)
    s, t = (x - j)[None, :, None], (y - i)[:, None, None]
    wide = np.concatenate([texels, texels[:, :1]], axis=1).astype(np.float64)
    j = j % 47
    upper, lower = ((1 - s) * wide[k][:, j] + s * wide[k][:, j + 1] for k in (i, i + 1))
    light = ((1 - t) * upper + t * lower) * (np.sin(np.pi * v) * 2 * np.pi**2 / (rows * columns))[:, None, None]
    towards = direction(*np.meshgrid(u, v))
    n = np.random.default_rng(2).normal(size=(9, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    n[:3] = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]
    P = np.polynomial.polynomial.polyval(np.einsum("hwk,nk->nhw", towards, n), clamped_cosine())
    expected = np.einsum("nhw,hwc->cn", P, light)
    variate = MatteVariate(texels)
    found = variate.integral(mi.Vector3f(n.T)).numpy()
    channels = 3 if variant.endswith("rgb") else 1
    np.testing.assert_allclose(found.reshape(channels, -1), expected[:channels], rtol=2e-3)
    assert len(variate.arrays()) == len(variate._coefficients)


@pytest.mark.parametrize("variant", [RGB, MONO, SPECTRAL])
def test_colours_have_one_and_spectra_have_none(variant: str) -> None:
    mi.set_variant(variant)
    from stratalux.integrators.automatic.sample import NestedTables

    assert (NestedTables(EnvironmentMap(hall_map())).variate is not None) == (variant != SPECTRAL)
