"""Files of images: what they say is done, or refused in one line."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from stratalux import InputError
from stratalux.images.colour import PRIMARIES, REC709
from stratalux.images.reader import Reader
from stratalux.images.reading import Image, read_image
from tests.images.make import COMPRESSIONS, LOSSY, card, exr, write, write_deep, write_parts
from tests.images.make import spec as part

CARD = card()
HALVES = CARD.astype(np.float16).astype(np.float32)


@pytest.fixture(scope="module")
def reader() -> Reader:
    """One process for all."""
    with Reader() as shared:
        yield shared


def said(image: Image) -> str:
    return "; ".join(image.said)


@pytest.mark.parametrize("tile", [0, 16])
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_every_compression_of_openexr(tmp_path: Path, reader: Reader, compression: str, tile: int) -> None:
    path = write(tmp_path / "a.exr", CARD, type="half", compression=compression, tile=tile)
    image = read_image(path, reader=reader)
    np.testing.assert_allclose(image.pixels, HALVES, rtol=0.05 if compression in LOSSY else 0)
    assert image.largest == 65504 and not image.said


@pytest.mark.parametrize(
    ("at", "display", "message"),
    [
        ((0, 0), None, ""),
        ((-4, -2), (0, 0, 20, 10), "what is outside is cropped"),
        ((5, 3), (0, 0, 64, 32), "the rest is black"),
        ((-3, 4), (0, 0, 40, 16), "what is outside is cropped and the rest is black"),
        ((100, -50), (100, -50, 32, 16), ""),
        ((103, -49), (100, -50, 16, 8), "cropped and the rest is black"),
    ],
)
@pytest.mark.parametrize("tile", [0, 16])
def test_display_windows_are_what_is_read(
    tmp_path: Path,
    reader: Reader,
    at: tuple[int, int],
    display: tuple[int, int, int, int] | None,
    message: str,
    tile: int,
) -> None:
    image = read_image(write(tmp_path / "a.exr", CARD, at=at, display=display, tile=tile), reader=reader)
    x, y, width, height = display or (0, 0, 32, 16)
    expected = np.zeros((height, width, 3), dtype=np.float32)
    for row in range(height):
        for column in range(width):
            i, j = row + y - at[1], column + x - at[0]
            if 0 <= i < 16 and 0 <= j < 32:
                expected[row, column] = CARD[i, j]
    np.testing.assert_array_equal(image.pixels, expected)
    assert message in said(image) and bool(message) == bool(image.said)


def test_pixels_that_are_all_outside_are_refused(tmp_path: Path, reader: Reader) -> None:
    with pytest.raises(InputError, match="32x16 at 100,0, are all outside of the picture, 64x32 at 0,0"):
        read_image(write(tmp_path / "a.exr", CARD, at=(100, 0), display=(0, 0, 64, 32)), reader=reader)


def test_a_few_rows_of_a_large_image_are_read_where_they_are(tmp_path: Path, reader: Reader) -> None:
    """Chunks begin where the file's do, not where the picture does."""
    tall = card(300, 20)
    for tile in (0, 16):
        path = write(tmp_path / "a.exr", tall, at=(2, -7), display=(0, 5, 30, 250), tile=tile, compression="zip")
        pixels = read_image(path, reader=reader).pixels
        np.testing.assert_array_equal(pixels[:, 2:22], tall[12:262])
        assert (pixels[:, :2] == 0).all() and (pixels[:, 22:] == 0).all()


@pytest.mark.parametrize(
    ("names", "channels", "message"),
    [
        (("R", "G", "B", "A"), (0, 1, 2), ""),
        (("R", "G", "B", "Z"), (0, 1, 2), "channel left out: Z"),
        (("r", "g", "b", "a"), (0, 1, 2), ""),
        (("Image.R", "Image.G", "Image.B", "Image.A"), (0, 1, 2), "layer Image is read"),
        (("beauty.B", "beauty.G", "beauty.R", "N.X"), (2, 1, 0), "layer beauty is read; channel left out: N.X"),
        (("B", "G", "R", "diffuse.R"), (2, 1, 0), "channel left out: diffuse.R"),
    ],
)
def test_channels_are_chosen_by_name(
    tmp_path: Path, reader: Reader, names: tuple[str, ...], channels: tuple[int, ...], message: str
) -> None:
    pixels = np.concatenate([CARD, CARD[..., :1] * 8], axis=2)
    image = read_image(write(tmp_path / "a.exr", pixels, names=names), reader=reader)
    np.testing.assert_array_equal(image.pixels, pixels[..., channels])
    assert said(image) == message


def test_layers_are_chosen_by_name(tmp_path: Path, reader: Reader) -> None:
    two = np.concatenate([CARD, CARD * 2], axis=2)

    def names(*layers: str) -> list[str]:
        return [f"{layer}.{c}" for layer in layers for c in "RGB"]

    path = write(tmp_path / "a.exr", two, names=names("ViewLayer.Vector", "ViewLayer.Combined"))
    image = read_image(path, reader=reader)
    np.testing.assert_array_equal(image.pixels, CARD * 2)
    assert said(image) == "layer ViewLayer.Combined is read; layer left out: ViewLayer.Vector"
    image = read_image(write(tmp_path / "b.exr", two, names=[*names("beauty"), "R", "G", "B"]), reader=reader)
    np.testing.assert_array_equal(image.pixels, CARD * 2)
    with pytest.raises(InputError, match="no telling which of the layers one, two is the picture"):
        read_image(write(tmp_path / "c.exr", two, names=names("one", "two")), reader=reader)


@pytest.mark.parametrize("names", [("R",), ("Z",), ("R", "G"), ("P.X", "P.Y", "P.Z")])
def test_files_without_a_picture_are_refused_by_the_names_of_their_channels(
    tmp_path: Path, reader: Reader, names: tuple[str, ...]
) -> None:
    path = write(tmp_path / "a.exr", CARD[..., : len(names)], names=names)
    with pytest.raises(InputError, match=f"no R, G and B among the channels {', '.join(names)};"):
        read_image(path, reader=reader)


def test_luminance_alone_is_grey(tmp_path: Path, reader: Reader) -> None:
    image = read_image(write(tmp_path / "a.exr", CARD[..., :1], names=["Y"]), reader=reader)
    np.testing.assert_array_equal(image.pixels, np.repeat(CARD[..., :1], 3, axis=2))
    assert not image.said


@pytest.mark.parametrize("sampling", [1, 2])
def test_luminance_and_chroma(tmp_path: Path, reader: Reader, sampling: int) -> None:
    colour = np.full((16, 32, 3), [0.5, 2.0, 1.0])
    luminance = colour @ [0.2126, 0.7152, 0.0722]
    channels = {"Y": luminance, "RY": colour[..., 0] / luminance - 1, "BY": colour[..., 2] / luminance - 1}
    fewer = {"RY": sampling, "BY": sampling}
    halves = {name: x[:: fewer.get(name, 1), :: fewer.get(name, 1)].astype(np.float16) for name, x in channels.items()}
    (tmp_path / "a.exr").write_bytes(exr(halves, fewer))
    np.testing.assert_allclose(read_image(tmp_path / "a.exr", reader=reader).pixels, colour, rtol=5e-3)


def test_other_colours_of_fewer_pixels_are_refused(tmp_path: Path, reader: Reader) -> None:
    channels = {c: np.ones((8, 16), dtype=np.float16) for c in "RGB"}
    channels["A"] = np.ones((16, 32), dtype=np.float16)
    (tmp_path / "a.exr").write_bytes(exr(channels, dict.fromkeys("RGB", 2)))
    with pytest.raises(InputError, match="cannot be read as an image .*ampl"):
        read_image(tmp_path / "a.exr", reader=reader)


def test_integers_of_32_bits_are_numbers_and_not_shares(tmp_path: Path, reader: Reader) -> None:
    numbers = np.arange(3 * 16 * 32, dtype=np.uint32).reshape(3, 16, 32)
    (tmp_path / "a.exr").write_bytes(exr(dict(zip("RGB", numbers, strict=True))))
    image = read_image(tmp_path / "a.exr", reader=reader)
    np.testing.assert_array_equal(image.pixels, np.moveaxis(numbers, 0, 2))
    assert "32-bit integers" in said(image)


def test_the_part_with_the_picture_is_read(tmp_path: Path, reader: Reader) -> None:
    depth = part(CARD[..., :1], ["Z"], name="depth")
    path = write_parts(tmp_path / "a.exr", [depth, part(CARD, name="rgba")], [CARD[..., :1], CARD * 2])
    image = read_image(path, reader=reader)
    np.testing.assert_array_equal(image.pixels, CARD * 2)
    assert said(image) == "layer rgba is read; channel left out: Z"
    parts = [part(CARD, name=name) for name in ("direct", "indirect", "beauty")]
    path = write_parts(tmp_path / "b.exr", parts, [CARD, CARD * 2, CARD * 3])
    image = read_image(path, reader=reader)
    np.testing.assert_array_equal(image.pixels, CARD * 3)
    assert "layers left out: direct, indirect" in said(image)
    path = write_parts(tmp_path / "c.exr", parts[:2], [CARD, CARD * 2])
    np.testing.assert_array_equal(read_image(path, reader=reader).pixels, CARD)


def test_deep_images_are_refused_by_name(tmp_path: Path, reader: Reader) -> None:
    with pytest.raises(InputError, match="deep pixels"):
        read_image(write_deep(tmp_path / "a.exr"), reader=reader)


@pytest.mark.parametrize("suffix", [".exr", ".tx"])
def test_of_several_levels_the_finest_is_read(tmp_path: Path, reader: Reader, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    made = oiio.ImageBufAlgo.make_texture(oiio.MakeTxTexture, oiio.ImageBuf(CARD), str(path), oiio.ImageSpec())
    assert made, oiio.geterror()
    np.testing.assert_array_equal(read_image(path, reader=reader).pixels, CARD)


def test_primaries_and_white_become_those_of_rec_709(tmp_path: Path, reader: Reader) -> None:
    white = np.ones((4, 8, 3), dtype=np.float32)
    path = write(tmp_path / "a.exr", white, chromaticities=PRIMARIES["ap0"])
    image = read_image(path, reader=reader)
    np.testing.assert_allclose(image.pixels, 1, atol=1e-5)  # as adapted, white stays white
    assert "converted to those of Rec. 709" in said(image)
    for attribute in ({"chromaticities": PRIMARIES["ap1"]}, {"oiio__ColorSpace": "lin_ap1_scene"}):
        path = write(tmp_path / "b.exr", white * [0, 1, 0], **attribute)
        green = read_image(path, reader=reader).pixels[0, 0]
        # ACES TB-2014-004 and its reference implementation: AP1 to Rec. 709 with Bradford's adaptation.
        np.testing.assert_allclose(green, [-0.62179, 1.14080, -0.12897], atol=2e-4)
    image = read_image(write(tmp_path / "c.exr", CARD, chromaticities=REC709), reader=reader)
    np.testing.assert_array_equal(image.pixels, CARD)
    assert not image.said


def test_what_are_no_primaries_is_said(tmp_path: Path, reader: Reader) -> None:
    image = read_image(write(tmp_path / "a.exr", CARD, chromaticities=(0.0,) * 8), reader=reader)
    np.testing.assert_array_equal(image.pixels, CARD)
    assert "chromaticities make no sense" in said(image)


def test_infinite_pixels_do_not_spread_to_other_channels(tmp_path: Path, reader: Reader) -> None:
    sun = np.ones((4, 8, 3), dtype=np.float32)
    sun[2, 3, 0] = np.inf
    image = read_image(write(tmp_path / "a.exr", sun, type="half", chromaticities=PRIMARIES["rec2020"]), reader=reader)
    assert np.isfinite(image.pixels).all() and image.pixels[2, 3, 0] > 65504
    assert "1 infinite" in said(image)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tga", ".bmp", ".tif", ".webp"])
def test_eight_bits_are_srgb_and_said_to_be_clipped(tmp_path: Path, reader: Reader, suffix: str) -> None:
    path = write(tmp_path / f"a{suffix}", np.full((16, 32, 3), 0.5, dtype=np.float32), type="uint8")
    image = read_image(path, reader=reader)
    np.testing.assert_allclose(image.pixels, ((128 / 255 + 0.055) / 1.055) ** 2.4, rtol=0.02)
    assert "8-bit sRGB: what is brighter than white was clipped" in said(image)


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_sixteen_bits(tmp_path: Path, reader: Reader, suffix: str) -> None:
    ramp = np.linspace(0, 1, 512, dtype=np.float32).reshape(16, 32, 1).repeat(3, axis=2)
    image = read_image(write(tmp_path / f"a{suffix}", ramp, type="uint16"), reader=reader)
    expected = np.where(ramp <= 0.04045, ramp / 12.92, ((ramp + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(image.pixels, expected, atol=2e-5)
    assert "16-bit sRGB" in said(image)


def test_linear_integers_are_left_linear(tmp_path: Path, reader: Reader) -> None:
    pixels = np.full((4, 8, 3), 0.5, dtype=np.float32)
    path = write(tmp_path / "a.png", pixels, type="uint16", oiio__ColorSpace="lin_rec709_scene")
    np.testing.assert_allclose(read_image(path, reader=reader).pixels, 0.5, atol=1e-4)


@pytest.mark.parametrize("suffix", [".tif", ".tx", ".pfm", ".exr"])
def test_floats_are_left_alone(tmp_path: Path, reader: Reader, suffix: str) -> None:
    image = read_image(write(tmp_path / f"a{suffix}", CARD), reader=reader)
    np.testing.assert_array_equal(image.pixels, CARD)
    assert image.largest is None and not image.said


@pytest.mark.parametrize(("kind", "count"), [("PF", 3), ("Pf", 1)])
@pytest.mark.parametrize("order", "<>")
def test_pfm_of_either_order_of_bytes(tmp_path: Path, reader: Reader, kind: str, count: int, order: str) -> None:
    path = tmp_path / "a.pfm"
    scale = b"-1.0" if order == "<" else b"1.0"
    pixels = CARD[::-1, :, :count].astype(f"{order}f4").tobytes()  # from the bottom up
    path.write_bytes(kind.encode() + b"\n32 16\n" + scale + b"\n" + pixels)
    expected = np.broadcast_to(CARD[..., :count], CARD.shape)
    np.testing.assert_array_equal(read_image(path, reader=reader).pixels, expected)


@pytest.mark.parametrize(
    ("orientation", "seen"),
    [
        (1, lambda a: a),
        (2, np.fliplr),
        (3, lambda a: np.rot90(a, 2)),
        (4, np.flipud),
        (5, lambda a: a.swapaxes(0, 1)),
        (6, lambda a: np.rot90(a, -1)),
        (7, lambda a: np.rot90(a, 2).swapaxes(0, 1)),
        (8, np.rot90),
    ],
)
def test_orientations(tmp_path: Path, reader: Reader, orientation: int, seen: object) -> None:
    path = write(tmp_path / "a.tif", CARD, Orientation=orientation)
    np.testing.assert_array_equal(read_image(path, reader=reader).pixels, seen(CARD))


def test_a_cube_is_told(tmp_path: Path, reader: Reader) -> None:
    channels = {c: np.ones((24, 4), dtype=np.float32) for c in "RGB"}
    (tmp_path / "a.exr").write_bytes(exr(channels, envmap=("envmap", b"\1")))
    assert read_image(tmp_path / "a.exr", reader=reader).layout == "openexr-cube"
    (tmp_path / "b.exr").write_bytes(exr(channels, envmap=("envmap", b"\0")))
    assert read_image(tmp_path / "b.exr", reader=reader).layout == "latlong"


def test_content_counts_and_not_the_suffix(tmp_path: Path, reader: Reader) -> None:
    path = write(tmp_path / "a.exr", CARD).rename(tmp_path / "a.hdr")
    np.testing.assert_array_equal(read_image(path, reader=reader).pixels, CARD)


@pytest.mark.parametrize("suffix", [".exr", ".hdr", ".pfm", ".tif", ".png", ".jpg", ".bmp", ".webp"])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.7])
def test_files_that_are_cut_off_are_refused_in_one_line(
    tmp_path: Path, reader: Reader, suffix: str, share: float
) -> None:
    path = tmp_path / f"a{suffix}"
    noise = np.random.default_rng(0).random((64, 128, 3)).astype(np.float32)
    write(path, noise, type="float" if suffix in (".exr", ".hdr", ".pfm") else "uint8")
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=f"a{suffix}: cannot be read as an image") as error:
        read_image(path, reader=reader)
    assert "\n" not in str(error.value) and str(error.value).count(str(path)) == 1


def test_more_memory_than_allowed_is_refused_before_it_is_taken(tmp_path: Path, reader: Reader) -> None:
    path = write(tmp_path / "a.exr", CARD)
    assert read_image(path, 12 * 16 * 32, reader).pixels.shape == (16, 32, 3)
    with pytest.raises(InputError, match=r"32x16 pixels take .* GB, more than .* GB"):
        read_image(path, 12 * 16 * 32 - 1, reader)
    path = write(tmp_path / "b.exr", CARD, display=(0, 0, 200_000, 100_000))
    with pytest.raises(InputError, match="200000x100000 pixels take 240 GB"):
        read_image(path, 10**9, reader)


@pytest.mark.parametrize(
    ("attribute", "at", "value"),
    [(b"dataWindow\0box2i\0", 12, 60_000), (b"dataWindow\0box2i\0", 8, 60_000), (b"tiles\0tiledesc\0", 4, 1 << 24)],
)
def test_sizes_that_cannot_be_true_are_refused(
    tmp_path: Path, reader: Reader, attribute: bytes, at: int, value: int
) -> None:
    path = write(tmp_path / "a.exr", CARD, tile=16)
    content = bytearray(path.read_bytes())
    place = content.find(attribute) + len(attribute) + 4 + at
    content[place : place + 4] = struct.pack("<i", value)
    path.write_bytes(content)
    with pytest.raises(InputError, match="a.exr: cannot be read as an image|are all outside"):
        read_image(path, reader=reader)


def test_missing_files_and_folders(tmp_path: Path) -> None:
    for path in (tmp_path / "none.exr", tmp_path):
        with pytest.raises(InputError, match="no such file"):
            read_image(path)


def test_alpha_is_read_where_it_is_asked_for(tmp_path: Path, reader: Reader) -> None:
    """That of the layer which is the picture, and in the same window; outside, there is none."""
    alpha = CARD[..., :1] / 8
    names = ["Image.A", "Image.B", "Image.G", "Image.R", "other.A"]
    channels = np.dstack([alpha, CARD[..., ::-1], np.ones_like(alpha)])
    path = write(tmp_path / "a.exr", channels, names=names, at=(2, 1), display=(0, 0, 40, 20))
    image = read_image(path, reader=reader, alpha=True)
    assert image.alpha is not None and image.alpha.shape == (20, 40)
    np.testing.assert_array_equal(image.alpha[1:17, 2:34], alpha[..., 0])
    np.testing.assert_array_equal(image.pixels[1:17, 2:34], CARD)
    assert image.alpha.sum() == pytest.approx(alpha.sum()) and image.pixels.flags.c_contiguous
    assert read_image(path, reader=reader).alpha is None
    assert read_image(write(tmp_path / "b.exr", CARD), reader=reader, alpha=True).alpha is None


@pytest.mark.parametrize("straight", [0, 1])
def test_alpha_of_integers(tmp_path: Path, reader: Reader, straight: int) -> None:
    """Colours come multiplied by it, and linear before that, whichever way the file has them; and turned alike."""
    codes = np.full((4, 8, 4), 0.735357, dtype=np.float32)  # 0.5 of linear light
    codes[..., 3] = np.linspace(0.25, 1, 32).reshape(4, 8)
    stored = codes.copy()
    if not straight:
        stored[..., :3] *= codes[..., 3:]
    more = {"oiio__UnassociatedAlpha": 1} if straight else {}
    path = write(tmp_path / "a.tif", stored, type="uint16", names=["R", "G", "B", "A"], Orientation=6, **more)
    image = read_image(path, reader=reader, alpha=True)
    assert image.alpha is not None
    np.testing.assert_allclose(image.alpha, np.rot90(codes[..., 3], -1), atol=1e-4)
    np.testing.assert_allclose(image.pixels, np.repeat(0.5 * image.alpha[..., None], 3, axis=2), atol=1e-4)
    assert "alpha" not in said(image)
    assert ("alpha is left out" in said(read_image(path, reader=reader))) == bool(straight)


def test_pixels_go_where_they_are_wanted(tmp_path: Path, reader: Reader) -> None:
    """Half floats as such, unless colours have to be converted; others as float32."""
    made: list[np.ndarray] = []

    def allocate(shape: tuple[int, int, int], kind: type) -> np.ndarray:
        made.append(np.empty(shape, kind))
        return made[-1]

    half = write(tmp_path / "a.exr", CARD, type="half")
    for path, kind in (
        (half, np.float16),
        (write(tmp_path / "b.exr", CARD), np.float32),
        (write(tmp_path / "c.hdr", CARD), np.float32),
    ):
        image = read_image(path, reader=reader, allocate=allocate)
        assert np.shares_memory(image.pixels, made[-1]) and image.pixels.dtype == kind
        np.testing.assert_array_equal(image.pixels, read_image(path, reader=reader).pixels)
    converted = write(tmp_path / "d.exr", CARD, type="half", chromaticities=PRIMARIES["rec2020"])
    image = read_image(converted, reader=reader, allocate=allocate)
    assert made[-1].dtype == np.float16 and image.pixels.dtype == np.float32
    np.testing.assert_array_equal(image.pixels, read_image(converted, reader=reader).pixels)
