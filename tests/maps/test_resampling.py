"""Maps from one layout to another."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from stratalux.maps import resampling
from stratalux.maps.geometry import direction, texel_solid_angle
from stratalux.maps.layouts import LATLONG, LAYOUTS, Layout
from stratalux.maps.layouts.layout import solid_angles
from stratalux.maps.resampling import Sheet, in_latlong, resample
from tests.helpers import sun_map

LAYOUTS_ONCE = [layout for name, layout in LAYOUTS.items() if name not in ("vertical-cross", "vertical-strip", "faces")]
IDS = [layout.name for layout in LAYOUTS_ONCE]


def of_direction(d: NDArray[np.float64]) -> NDArray[np.float64]:
    """A smooth radiance that tells all axes apart."""
    x, y, z = np.moveaxis(d / np.linalg.norm(d, axis=-1, keepdims=True), -1, 0)
    return np.stack([3 + 2 * x + y * z, 3 + 2 * y - x * z, 3 + 2 * z + x * y * 2], axis=-1)


def smooth(layout: Layout, height: int) -> Sheet:
    """It, at the centres of texels."""
    shape = height, height * layout.wide
    x, y = np.meshgrid(np.arange(shape[1], dtype=float), np.arange(shape[0], dtype=float))
    faces = [of_direction(layout.direction(f, *layout.of_texels(x, y, shape))) for f in range(layout.faces)]
    return Sheet(layout, np.stack(faces).astype(np.float32))


def random_directions(count: int) -> NDArray[np.float64]:
    d = np.random.default_rng(0).normal(size=(count, 3))
    return np.asarray(d / np.linalg.norm(d, axis=1, keepdims=True))


@pytest.mark.parametrize("layout", LAYOUTS_ONCE, ids=IDS)
def test_lookups_are_bilinear(layout: Layout) -> None:
    """At and beyond the edges of faces as elsewhere."""
    d = random_directions(4000)
    apart = np.abs(smooth(layout, 96).radiance(d) - of_direction(d)).max(axis=1)
    # Near the rim of a disc there are few texels along its radius.
    assert np.quantile(apart, 0.98 if layout.disc else 1) < 0.06


@pytest.mark.parametrize("layout", LAYOUTS_ONCE, ids=IDS)
def test_one_radiance_stays_one(layout: Layout) -> None:
    even = Sheet(LATLONG, np.full((1, 20, 40, 3), 0.7, dtype=np.float32))
    for height in (5, 17):
        made = resample(even, layout, height)
        there = made.texels[made.texels > 0]
        np.testing.assert_allclose(there, 0.7, rtol=1e-4)
        assert layout.disc or there.size == made.texels.size
        np.testing.assert_allclose(resample(made, LATLONG, 12).texels, 0.7, rtol=1e-3)


@settings(max_examples=20, deadline=None)
@given(
    st.sampled_from(LAYOUTS_ONCE),
    st.sampled_from(LAYOUTS_ONCE),
    st.integers(4, 14),
    st.integers(4, 14),
    st.integers(0, 99),
)
def test_the_light_stays(one: Layout, other: Layout, height: int, wanted: int, seed: int) -> None:
    """Of any map, from any layout to any, coarser or finer."""
    rng = np.random.default_rng(seed)
    texels = rng.lognormal(0, 2, (one.faces, height, height * one.wide, 3)).astype(np.float32)
    sheet = Sheet(one, texels)
    made = resample(sheet, other, wanted)
    assert made.texels.shape == (other.faces, wanted, wanted * other.wide, 3) and made.texels.dtype == np.float32
    np.testing.assert_allclose(made.flux, sheet.flux, rtol=1e-5)
    assert made.texels.min() >= 0


def test_flux_is_that_of_the_map() -> None:
    texels = sun_map()
    flux = (texels.astype(np.float64) * texel_solid_angle(24, 48)[..., None]).sum(axis=(0, 1))
    np.testing.assert_allclose(Sheet(LATLONG, texels[None]).flux, flux, rtol=1e-6)


@pytest.mark.parametrize("layout", LAYOUTS_ONCE[1:], ids=IDS[1:])
@pytest.mark.parametrize("scale", [0.4, 1.0, 2.5])
def test_a_sun_of_one_texel_keeps_its_light(layout: Layout, scale: float) -> None:
    """And its place: the first moment of its light. The sky has its own, which the common factor does not touch."""
    height = 40
    sky = np.ones((1, height, 2 * height, 3), dtype=np.float32)
    sky[0, 13, 27] = 3000
    sheet = Sheet(LATLONG, sky)
    made = resample(sheet, layout, round(scale * height / layout.rows))
    weight = solid_angles(layout, made.shape)[..., None]
    found = (made.texels[..., 0:1] - 1) * weight * (made.texels[..., 0:1] > 1.05)
    wanted = 2999 * texel_solid_angle(height, 2 * height)[13, 27]
    assert found.sum() == pytest.approx(wanted, rel=0.01)
    x, y = np.meshgrid(np.arange(made.shape[1], dtype=float), np.arange(made.shape[0], dtype=float))
    at = np.stack([layout.direction(f, *layout.of_texels(x, y, made.shape)) for f in range(layout.faces)])
    moment = (found * at).sum(axis=(0, 1, 2))
    towards = direction(np.array(27.5 / (2 * height)), np.array(13 / (height - 1)))
    assert np.degrees(np.arccos(moment @ towards / np.linalg.norm(moment))) < 0.25 * 180 / height / min(scale, 1)


@pytest.mark.parametrize("layout", LAYOUTS_ONCE[1:], ids=IDS[1:])
def test_there_and_back(layout: Layout) -> None:
    """A smooth map comes back as it was; a little less so ahead and behind, where the rims of discs are coarse."""
    sheet = smooth(LATLONG, 64)
    again = resample(resample(sheet, layout, round(64 / layout.rows)), LATLONG, 64)
    apart = np.abs(again.texels - sheet.texels)
    assert np.quantile(apart, 0.95) < 0.025 and apart.max() < (0.5 if layout.disc else 0.09)


def test_detail_that_has_no_place_becomes_its_mean() -> None:
    """Stripes of one texel, eight times as fine as the result: no moiré."""
    stripes = np.zeros((1, 128, 256, 3), dtype=np.float32)
    stripes[0, :, ::2] = 2
    made = resample(Sheet(LATLONG, stripes), LAYOUTS["equal-area"], 16)
    np.testing.assert_allclose(made.texels, 1, atol=0.02)


@pytest.mark.parametrize("layout", [LATLONG, LAYOUTS["cross"], LAYOUTS["angular"]], ids=["latlong", "cross", "angular"])
def test_maps_that_are_much_finer_are_reduced_before(layout: Layout) -> None:
    """With the same result, nearly: a sun and a smooth map, to a tenth of their rows."""
    sheet = smooth(LATLONG, 128)
    sheet.texels[0, 50, 77] += 2000
    height = round(12 / layout.rows)
    made = resample(sheet, layout, height)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(resampling, "_reduced", lambda sheet, rows: sheet)
        whole = resample(sheet, layout, height)
    np.testing.assert_allclose(made.flux, sheet.flux, rtol=1e-5)
    assert resampling._reduced(sheet, 12).shape == (32, 64)
    assert np.abs(made.texels - whole.texels).max() < 0.2 * whole.texels.max()
    apart = np.abs(made.texels - whole.texels)[whole.texels < 7]
    assert np.quantile(apart, 0.9) < 0.05


def test_nothing_is_done_where_nothing_is_to_do() -> None:
    sheet = smooth(LATLONG, 8)
    assert resample(sheet, LATLONG, 8) is sheet and in_latlong(sheet) is sheet
    black = resample(Sheet(LATLONG, np.zeros((1, 8, 16, 3), np.float32)), LAYOUTS["cross"], 4)
    assert black.texels.max() == 0


def test_a_cube_of_one_texel_a_face() -> None:
    assert np.isfinite(in_latlong(Sheet(LAYOUTS["openexr-cube"], np.ones((6, 1, 1, 3), np.float32))).texels).all()
