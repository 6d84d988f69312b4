"""Files that are written: what is in them is what was to be in them, and what is lost is told."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import mitsuba as mi
import numpy as np
import OpenImageIO as oiio
import pytest
from numpy.typing import NDArray

from stratalux import InputError
from stratalux.errors import ImageWarning
from stratalux.images import encoding
from stratalux.images.files import FORMATS, PICTURE_SUFFIXES
from stratalux.images.reading import read_image
from stratalux.images.tonemap import srgb, tonemap
from stratalux.images.writing import automatic_exposure, jpeg, write_image, write_picture

Y, X = np.mgrid[:16, :24].astype(np.float32)
PIXELS = np.dstack([0.1 + X / 24, 1.3 - Y / 16, 0.6 + Y / 32 - X / 48])
"""No two alike, and smooth: JPEG and WebP have half as many colours as pixels."""
ALPHA = np.linspace(0, 1, X.size, dtype=np.float32).reshape(X.shape)
COVERED = np.dstack([PIXELS * ALPHA[..., None], ALPHA])


def spec_and_pixels(path: Path, kind: str = "") -> tuple[oiio.ImageSpec, NDArray]:
    """As they are in the file, without that alpha is multiplied into the colours."""
    hints = oiio.ImageSpec()
    hints.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(str(path), hints)
    assert source is not None, oiio.geterror()
    found = source.spec(), np.asarray(source.read_image(kind or str(source.spec().format)))
    source.close()
    return found


@pytest.mark.parametrize("suffix", FORMATS)
def test_writes_every_format_it_promises(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix.upper()}"
    write_image(path, mi.Bitmap(PIXELS), {"spp": 4}, exposure=0.0)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert path.stat().st_mode & 0o777 == 0o666 & ~_umask()
    read = read_image(path).pixels
    if suffix in PICTURE_SUFFIXES:
        known = tonemap(PIXELS, 0.0).astype(int)
        assert np.abs(srgb(read).astype(int) - known).mean() < (3 if suffix in (".jpg", ".jpeg", ".webp") else 0.01)
    else:
        tolerance = {".exr": 1e-3, ".hdr": 2.0, ".pfm": 0}[suffix]
        np.testing.assert_allclose(read, PIXELS, rtol=tolerance if suffix != ".hdr" else 0, atol=2 / 256)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


@pytest.mark.parametrize("suffix", [".png", ".tif", ".tiff"])
@pytest.mark.parametrize("bits", [8, 16])
def test_pictures_have_known_numbers(tmp_path: Path, suffix: str, bits: int) -> None:
    """0.5 of linear light is 0.735357 in sRGB."""
    pixels = np.zeros((2, 3, 3), dtype=np.float32)
    pixels[0, 0], pixels[1, 2] = [0.5, 1, 0], [9, 0.0031308, 0.5]
    write_image(tmp_path / f"a{suffix}", pixels, exposure=0, view="standard", bits=bits)
    spec, written = spec_and_pixels(tmp_path / f"a{suffix}")
    most = 2**bits - 1
    half, dark = round(0.735357 * most), round(0.0404499 * most)
    expected = np.zeros((2, 3, 3), dtype=int)
    expected[0, 0], expected[1, 2] = [half, most, 0], [most, dark, half]
    assert str(spec.format) == f"uint{bits}" and np.abs(written.astype(int) - expected).max() == 0


def test_what_tells_that_it_is_srgb(tmp_path: Path) -> None:
    for suffix in (".png", ".jpg", ".webp", ".tif"):
        write_image(tmp_path / f"a{suffix}", PIXELS)
        assert spec_and_pixels(tmp_path / f"a{suffix}")[0].getattribute("oiio:ColorSpace") == "srgb_rec709_scene"
    assert b"sRGB" in (tmp_path / "a.png").read_bytes()[:64]
    write_image(tmp_path / "a.exr", PIXELS)
    assert spec_and_pixels(tmp_path / "a.exr")[0].getattribute("colorInteropID") == "lin_rec709_scene"


@pytest.mark.parametrize("suffix", [".png", ".tif", ".webp"])
def test_colours_are_not_multiplied_by_alpha_in_pictures(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    write_image(path, mi.Bitmap(COVERED), exposure=0)
    _, written = spec_and_pixels(path)
    assert written.shape == (16, 24, 4)
    assert np.array_equal(written[..., 3], np.round(ALPHA * 255))
    difference = np.abs(written[..., :3].astype(int) - tonemap(PIXELS, 0.0))[ALPHA > 0.1]
    assert difference.mean() < 3 if suffix == ".webp" else difference.max() <= 1


def test_alpha_comes_back(tmp_path: Path) -> None:
    """From files that have colours multiplied by it and from those that have not."""
    write_image(tmp_path / "a.exr", COVERED, float32=True)
    write_image(tmp_path / "a.tif", COVERED, float32=True)
    write_image(tmp_path / "a.png", COVERED / 2, exposure=0, view="standard", bits=16)
    for name in ("a.exr", "a.tif"):
        image = read_image(tmp_path / name, alpha=True)
        np.testing.assert_allclose(image.alpha, ALPHA, rtol=1e-6)
        np.testing.assert_allclose(image.pixels, COVERED[..., :3], rtol=1e-6)
    image = read_image(tmp_path / "a.png", alpha=True)
    np.testing.assert_allclose(image.alpha, ALPHA / 2, atol=1e-4)
    np.testing.assert_allclose(image.pixels, np.minimum(PIXELS, 1) * ALPHA[..., None] / 2, atol=1e-4)
    assert read_image(tmp_path / "a.exr").alpha is None


def test_alpha_that_is_1_everywhere_is_not_written(tmp_path: Path) -> None:
    opaque = np.dstack([PIXELS, np.full((16, 24), 1 - 1e-6, dtype=np.float32)])
    for suffix in FORMATS:
        write_image(tmp_path / f"a{suffix}", opaque)
    assert spec_and_pixels(tmp_path / "a.png")[1].shape == (16, 24, 3)
    assert spec_and_pixels(tmp_path / "a.exr")[1].shape == (16, 24, 4)


@pytest.mark.parametrize("suffix", [".jpg", ".hdr", ".pfm"])
def test_alpha_that_has_no_place_is_told(tmp_path: Path, suffix: str) -> None:
    with pytest.warns(ImageWarning, match=r"alpha is left out, which is not 1 everywhere; .exr and .png hold it"):
        write_image(tmp_path / f"a{suffix}", COVERED)
    assert read_image(tmp_path / f"a{suffix}").pixels.shape == (16, 24, 3)


def test_light_without_alpha_is_told(tmp_path: Path) -> None:
    glow = COVERED.copy()
    glow[0, 0] = [1, 1, 1, 0]
    with pytest.warns(ImageWarning, match=r"light of 1 pixel\(s\) without alpha is left out"):
        write_image(tmp_path / "a.png", glow)
    assert spec_and_pixels(tmp_path / "a.png")[1][0, 0].tolist() == [0, 0, 0, 0]


@pytest.mark.parametrize("suffix", [".hdr", ".pfm", ".png"])
@pytest.mark.parametrize("channels", [1, 2, 4])
def test_formats_of_colours_take_any_film(tmp_path: Path, suffix: str, channels: int) -> None:
    """Luminance is grey."""
    pixels = np.full((4, 5, channels), 0.25, dtype=np.float32)
    if channels in (2, 4):
        pixels[..., -1] = 1
    kinds = {1: mi.Bitmap.PixelFormat.Y, 2: mi.Bitmap.PixelFormat.YA, 4: mi.Bitmap.PixelFormat.RGBA}
    write_image(tmp_path / f"a{suffix}", mi.Bitmap(pixels, kinds[channels]), exposure=0)
    written = np.array(mi.Bitmap(str(tmp_path / f"a{suffix}")))
    assert written.shape == (4, 5, 3)
    if suffix != ".png":
        np.testing.assert_allclose(written, 0.25)


def test_grey_with_alpha_and_a_distance(tmp_path: Path) -> None:
    pixels = np.dstack([0.25 * ALPHA, ALPHA, 100 * ALPHA])
    write_image(tmp_path / "a.png", mi.Bitmap(pixels, mi.Bitmap.PixelFormat.MultiChannel, ["Y", "A", "T"]), exposure=0)
    _, written = spec_and_pixels(tmp_path / "a.png")
    expected = tonemap(np.full((1, 1, 3), 0.25, dtype=np.float32), 0.0)[0, 0]
    assert np.abs(written[ALPHA > 0][:, :3].astype(int) - expected).max() <= 1
    assert np.array_equal(written[..., 3], np.round(ALPHA * 255))


def test_openexr_has_the_names_of_the_film(tmp_path: Path) -> None:
    for kind, names in (("Y", "Y"), ("YA", "YA"), ("RGB", "RGB"), ("RGBA", "RGBA"), ("XYZ", "XYZ")):
        bitmap = mi.Bitmap(COVERED[..., : len(names)].copy(), getattr(mi.Bitmap.PixelFormat, kind))
        write_image(tmp_path / "a.exr", bitmap)
        spec, written = spec_and_pixels(tmp_path / "a.exr", "float")
        assert spec.channelnames == tuple(names) and str(spec.format) == "half"
        np.testing.assert_allclose(written, COVERED[..., : len(names)], rtol=1e-3, atol=1e-6)
    assert spec.getattribute("chromaticities")[:4] == (1, 0, 0, 1)
    grey = mi.Bitmap(np.full((4, 4, 3), 0.5, dtype=np.float32) * [0.9505, 1, 1.089], mi.Bitmap.PixelFormat.XYZ)
    write_image(tmp_path / "a.pfm", grey)
    np.testing.assert_allclose(read_image(tmp_path / "a.pfm").pixels, 0.5, atol=1e-3)


def test_channels_that_are_no_colours_have_32_bits(tmp_path: Path) -> None:
    """A distance or the number of a thing is no use in half."""
    pixels = np.dstack([COVERED, np.full((16, 24, 2), 123456.789, dtype=np.float32)])
    bitmap = mi.Bitmap(pixels, mi.Bitmap.PixelFormat.MultiChannel, ["R", "G", "B", "A", "depth.T", "thing.I"])
    write_image(tmp_path / "a.exr", bitmap)
    spec, written = spec_and_pixels(tmp_path / "a.exr", "float")
    assert spec.channelnames == ("R", "G", "B", "A", "depth.T", "thing.I")
    assert list(map(str, spec.channelformats)) == ["half"] * 4 + ["float"] * 2
    np.testing.assert_array_equal(written[..., 4:], pixels[..., 4:])
    with pytest.raises(InputError, match=r"the film has 6 channels, which only .exr can hold"):
        write_image(tmp_path / "a.png", bitmap)


def test_openexr_remembers_what_it_is_told(tmp_path: Path) -> None:
    about = {"spp": 4, "seed": 4294967295, "seconds": 1.25, "flag": True, "version": "1, 2", "stratalux": '{"é": "☼"}'}
    write_image(tmp_path / "a.exr", PIXELS, about)
    found = mi.Bitmap(str(tmp_path / "a.exr")).metadata()
    assert [found[name] for name in about] == [4, "4294967295", 1.25, 1, "1, 2", '{"é": "☼"}']
    assert found["pixelAspectRatio"] == 1 and found["screenWindowWidth"] == 1
    spec, _ = spec_and_pixels(tmp_path / "a.exr")
    assert spec.getattribute("compression") == "zip"


def test_32_bits_when_asked_for(tmp_path: Path) -> None:
    for name in ("a.exr", "a.tif"):
        write_image(tmp_path / name, PIXELS, float32=True)
        spec, written = spec_and_pixels(tmp_path / name)
        assert str(spec.format) == "float"
        np.testing.assert_array_equal(written, PIXELS)


def test_what_is_beyond_half_is_told_and_not_infinite(tmp_path: Path) -> None:
    pixels = PIXELS.copy()
    pixels[0, 0, 0], pixels[1, 1, 1], pixels[2, 2, 2] = 65504, 65505, -1e6
    with pytest.warns(ImageWarning, match=r"2 pixel\(s\) above 65504 are written as that; --float32 keeps them"):
        write_image(tmp_path / "a.exr", pixels)
    written = spec_and_pixels(tmp_path / "a.exr", "float")[1]
    assert [written[k, k, k] for k in range(3)] == [65504, 65504, -65504]
    assert pixels[1, 1, 1] == 65505  # the caller's are left alone
    write_image(tmp_path / "a.exr", pixels, float32=True)
    np.testing.assert_array_equal(spec_and_pixels(tmp_path / "a.exr", "float")[1], pixels)
    pixels[1, 1, 1], pixels[2, 2, 2] = np.inf, np.nan
    write_image(tmp_path / "a.exr", pixels)  # what is infinite stays so
    written = spec_and_pixels(tmp_path / "a.exr", "float")[1]
    assert written[1, 1, 1] == np.inf and np.isnan(written[2, 2, 2])


def test_radiance_has_no_place_for_what_is_negative(tmp_path: Path) -> None:
    """Red of -1 would be read as the largest of the other two."""
    pixels = PIXELS.copy()
    pixels[0, 0], pixels[1, 1] = [-1, 2, 3], [np.nan, 1, np.inf]
    with pytest.warns(ImageWarning, match=r"2 pixel\(s\) below 0 or not finite are written as 0"):
        write_image(tmp_path / "a.hdr", pixels)
    read = read_image(tmp_path / "a.hdr").pixels
    assert read[0, 0].tolist() == [0, 2, 3] and read[1, 1].tolist() == [0, 1, 0]


def test_what_a_format_cannot_have_is_refused(tmp_path: Path) -> None:
    for name, settings, message in (
        ("a.jpg", {"bits": 16}, "a.jpg: has no 16 bits; write one of .png, .tif, .tiff, or leave --bits out"),
        ("a.webp", {"bits": 16}, "a.webp: has no 16 bits"),
        ("a.gif", {}, "unknown image format '.gif'"),
    ):
        with pytest.raises(InputError, match=message):
            write_image(tmp_path / name, PIXELS, **settings)
    write_image(tmp_path / "a.tif", PIXELS, bits=8, float32=True)
    with pytest.raises(InputError, match="at most 16383 pixels along a side, not 16384x1; write a .png"):
        write_image(tmp_path / "a.webp", np.zeros((1, 16384, 3), dtype=np.float32))


def test_pictures_and_pages(tmp_path: Path) -> None:
    pixels = tonemap(np.repeat(np.repeat(PIXELS, 8, axis=0), 8, axis=1), 0.0)
    write_picture(tmp_path / "a.png", pixels)
    assert np.array_equal(spec_and_pixels(tmp_path / "a.png")[1], pixels)
    (tmp_path / "a.jpg").write_bytes(jpeg(pixels))
    assert np.abs(spec_and_pixels(tmp_path / "a.jpg")[1].astype(int) - pixels).mean() < 3
    assert len(jpeg(pixels, 30)) < len(jpeg(pixels))


def test_where_there_are_no_files_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same bytes, but for the time in them."""
    for suffix in (".png", ".pfm", ".jpg", ".hdr", ".webp"):
        write_image(tmp_path / f"a{suffix}", PIXELS)
        with monkeypatch.context() as patch:
            patch.setattr(encoding, "_MEMORY", False)
            write_image(tmp_path / f"b{suffix}", PIXELS)
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_disk_that_is_full_is_told_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    def full(path: Path, content: bytes) -> int:
        with path.open("wb") as file:
            file.write(content[: len(content) // 2])
        raise OSError(28, "No space left on device", str(path))

    (tmp_path / f"a{suffix}").write_bytes(b"before")
    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space left"):
        write_image(tmp_path / f"a{suffix}", PIXELS)
    assert [p.name for p in tmp_path.iterdir()] == [f"a{suffix}"]
    assert (tmp_path / f"a{suffix}").read_bytes() == b"before"


def test_nothing_is_said_where_nothing_is_lost(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for suffix in FORMATS:
            write_image(tmp_path / f"a{suffix}", PIXELS)
        write_image(tmp_path / "b.exr", COVERED)


def test_what_is_around_an_object_has_a_say_in_its_exposure() -> None:
    pixels = np.full((4, 4, 3), 0.18, dtype=np.float32)
    mask = np.zeros((4, 4), dtype=bool)
    mask[1, 1] = True
    for value, expected in ((0.18, 0), (0.36, -1), (1e-4, 2), (1e4, -2)):
        pixels[1, 1] = value
        whole = automatic_exposure(mi.Bitmap(pixels))
        stops = automatic_exposure(mi.Bitmap(pixels), mask)
        assert stops == pytest.approx(expected if abs(expected) < 2 else whole + expected, abs=1e-3)
    assert automatic_exposure(mi.Bitmap(pixels), ~mask) == pytest.approx(0, abs=1e-3)


def test_what_is_black_stays_dark_where_the_light_is_known() -> None:
    """At most one stop above what makes white of a white thing; grey, and what is bright, is as without."""
    for value, light, expected in (
        (0.18, 1, 0),
        (0.09, 1, 1),
        (0.01, 1, 1),
        (1e-4, 0.25, 3),
        (4, 0.1, -4.47),
        (0, 2, 0),
    ):
        card = mi.Bitmap(np.full((4, 4, 3), value, dtype=np.float32))
        everywhere = np.ones((4, 4), dtype=bool)
        assert automatic_exposure(card, everywhere, light) == pytest.approx(expected, abs=0.01)
        assert automatic_exposure(card, None, light) == pytest.approx(expected, abs=0.01)
    assert automatic_exposure(mi.Bitmap(np.full((4, 4, 3), 1e-4, dtype=np.float32)), everywhere, 0) > 10
