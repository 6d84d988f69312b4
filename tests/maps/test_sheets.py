"""Files of maps in any layout: what is read as what, and what is written."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import EnvironmentMap, EnvironmentMapWarning, InputError
from stratalux.maps.layouts import LATLONG, LAYOUTS, Layout
from stratalux.maps.resampling import Sheet, resample
from stratalux.maps.sheets import packed, read_sheet, write_sheet
from tests.images.make import exr, write


def texels(layout: Layout, height: int = 4, seed: int = 0) -> NDArray[np.float32]:
    """Halves, so that OpenEXR keeps them."""
    rng = np.random.default_rng(seed)
    shape = layout.faces, height, height * layout.wide, 3
    return np.asarray(rng.uniform(0.1, 4, shape).astype(np.float16), dtype=np.float32)


def image(name: str, height: int = 4) -> NDArray[np.float32]:
    return packed(Sheet(LAYOUTS[name], texels(LAYOUTS[name], height)))[0]


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_what_is_written_is_read_back(tmp_path: Path, layout: Layout) -> None:
    """By the header of OpenEXR, whatever the name; by the setting, where there is no such header."""
    sheet = Sheet(layout, texels(layout))
    files = write_sheet(sheet, tmp_path / "a.exr")
    assert len(files) == (6 if layout.files else 1)
    found, said = read_sheet(files[-1])
    assert found.layout is layout
    np.testing.assert_array_equal(found.texels, sheet.texels)
    assert ("as its header says" in " ".join(said)) == (layout is not LATLONG)
    files = write_sheet(sheet, tmp_path / "b.pfm")
    found, said = read_sheet(files[0], layout.name)
    np.testing.assert_array_equal(found.texels, sheet.texels)
    assert found.layout is layout and not said


@pytest.mark.parametrize(("name", "number"), [("latlong", b"\0"), ("openexr-cube", b"\1")])
def test_envmap_is_that_of_openexr(tmp_path: Path, name: str, number: bytes) -> None:
    """The attribute that others read: one byte of the type ``envmap``."""
    (file,) = write_sheet(Sheet(LAYOUTS[name], texels(LAYOUTS[name])), tmp_path / "a.exr")
    assert b"envmap\0envmap\0\1\0\0\0" + number in file.read_bytes()
    channels = {c: np.ascontiguousarray(image(name)[..., k]) for k, c in enumerate("RGB")}
    (tmp_path / "b.exr").write_bytes(exr(channels, envmap=("envmap", number)))
    assert read_sheet(tmp_path / "b.exr")[0].layout is LAYOUTS[name]


def test_a_header_that_says_latitude_and_longitude_counts_before_the_name(tmp_path: Path) -> None:
    (file,) = write_sheet(Sheet(LATLONG, texels(LATLONG)), tmp_path / "a_probe.exr")
    assert read_sheet(file)[0].layout is LATLONG


@pytest.mark.parametrize(
    ("name", "is_a"),
    [
        ("uffizi_cross", "vertical-cross"),
        ("uffizi_cross", "cross"),
        ("sky-cubemap", "strip"),
        ("sky.skybox", "vertical-strip"),
        ("grace_probe", "angular"),
        ("grace_angular_2k", "angular"),
        ("garden mirror ball", "mirror-ball"),
        ("Garden_MirrorBall", "mirror-ball"),
        ("sky_octahedral_1024", "octahedral"),
        ("sky_equal-area", "equal-area"),
        ("sky-equiarea", "equal-area"),
    ],
)
def test_names_say_what_is_read(tmp_path: Path, name: str, is_a: str) -> None:
    path = write(tmp_path / f"{name}.hdr", image(is_a))
    sheet, said = read_sheet(path)
    assert sheet.layout is LAYOUTS[is_a]
    assert said == [f"taken for the layout {is_a}, as its name says; --env-layout says otherwise"]
    other = "latlong"
    assert read_sheet(path, other)[0].layout is LATLONG  # what is asked for counts


@pytest.mark.parametrize("name", ["red_cross", "probe_room", "across", "crossing", "ball"])
def test_maps_of_two_to_one_are_never_taken_for_others(tmp_path: Path, name: str) -> None:
    sheet, said = read_sheet(write(tmp_path / f"{name}.hdr", image("latlong")))
    assert sheet.layout is LATLONG and not said


@pytest.mark.parametrize(
    ("size", "hint"),
    [
        ((8, 8), "octahedral or equal-area or angular or mirror-ball"),
        ((9, 12), "cross"),
        ((12, 9), "vertical-cross"),
        ((2, 12), "strip"),
        ((12, 2), "vertical-strip or openexr-cube"),
        ((8, 24), ""),
    ],
)
def test_sizes_that_are_no_map_of_latitude_and_longitude_get_a_hint(
    tmp_path: Path, size: tuple[int, int], hint: str
) -> None:
    path = write(tmp_path / "sky.hdr", np.ones((*size, 3), np.float32))
    _, said = read_sheet(path)
    what = f"{size[1]}x{size[0]} is not 2:1; taken as a full latitude-longitude map all the same"
    assert said == [what + (f"; if it is none: --env-layout {hint}" if hint else "")]


def test_six_files_are_read_by_the_name_of_one(tmp_path: Path) -> None:
    faces = texels(LAYOUTS["faces"])
    for names in (
        ("sky_px", "sky_nx", "sky_py", "sky_ny", "sky_pz", "sky_nz"),
        ("posx", "negx", "posy", "negy", "posz", "negz"),
        ("Right", "Left", "Top", "Bottom", "Front", "Back"),
        ("a-right", "a-left", "a-up", "a-down", "a-front", "a-back"),
    ):
        for name, face in zip(names, faces, strict=True):
            write(tmp_path / f"{name}.pfm", face)
        for name in names[1:2]:
            sheet, said = read_sheet(tmp_path / f"{name}.pfm")
            np.testing.assert_array_equal(sheet.texels, faces)
            assert said == ["taken for the layout faces, as its name says; --env-layout says otherwise"]
    write(tmp_path / "sky_ny.pfm", np.ones((8, 8, 3), np.float32))
    with pytest.raises(InputError, match="sky_ny.pfm: 8x8 is not the size of sky_px.pfm"):
        read_sheet(tmp_path / "sky_px.pfm", "faces")
    (tmp_path / "sky_ny.pfm").unlink()
    with pytest.raises(InputError, match="sky_ny.pfm: no such file"):
        read_sheet(tmp_path / "sky_px.pfm", "faces")
    assert read_sheet(tmp_path / "sky_px.pfm")[0].layout is LATLONG
    with pytest.raises(InputError, match="no name of one of six faces"):
        read_sheet(write(tmp_path / "apx.pfm", faces[0]), "faces")


def test_sizes_that_a_layout_cannot_have_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.hdr", image("latlong"))
    with pytest.raises(InputError, match="8x4 cannot be the layout cross, which is 4:3; give another --env-layout"):
        read_sheet(path, "cross")
    with pytest.raises(InputError, match="'globe' is unknown; use one of auto, latlong, cross"):
        read_sheet(path, "globe")


def test_what_is_bad_in_a_map_does_not_spread(tmp_path: Path) -> None:
    """It is repaired before it is resampled."""
    pixels = image("angular", 8)
    pixels[3, 4] = [np.nan, 1, 1]
    sheet, said = read_sheet(write(tmp_path / "a.exr", pixels, type="float"), "angular")
    assert np.isfinite(sheet.texels).all() and said == ["1 NaN texel(s) repaired (NaN to 0)"]


def test_maps_of_all_layouts_are_loaded(tmp_path: Path) -> None:
    path = write(tmp_path / "sky_probe.pfm", image("angular", 8))
    with pytest.warns(EnvironmentMapWarning, match=r"sky_probe\.pfm: taken for the layout angular, as its name says"):
        environment = EnvironmentMap.load(path)
    expected = resample(Sheet(LAYOUTS["angular"], texels(LAYOUTS["angular"], 8)), LATLONG, 4)
    np.testing.assert_array_equal(environment.texels, expected.texels[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        square = EnvironmentMap.load(path, layout="latlong")
    assert square.texels.shape == (8, 8, 3)
    np.testing.assert_array_equal(square.sheet.flux, Sheet(LATLONG, square.texels[None]).flux)


def test_openexr_has_32_bits_where_it_needs_them(tmp_path: Path) -> None:
    sun = texels(LATLONG)
    sun[0, 1, 2] = 1e6
    (file,) = write_sheet(Sheet(LATLONG, sun), tmp_path / "a.exr")
    np.testing.assert_array_equal(read_sheet(file)[0].texels, sun)
    assert file.stat().st_size > write_sheet(Sheet(LATLONG, texels(LATLONG)), tmp_path / "b.exr")[0].stat().st_size
    with pytest.raises(InputError, match=r"unknown image format '.png'; use one of .exr"):
        write_sheet(Sheet(LATLONG, sun), tmp_path / "a.png")
