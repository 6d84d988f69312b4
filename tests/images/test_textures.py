"""Files of textures: the numbers are those that Mitsuba reads from sound files."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from stratalux import InputError
from stratalux.images.reader import Reader
from stratalux.images.textures import Texture, read_texture
from tests.images.make import card, hdr, rgbe, write

COLOURS = np.random.default_rng(7).random((5, 7, 4), dtype=np.float32)


@pytest.fixture(scope="module")
def reader() -> Reader:
    """One process for all."""
    with Reader() as shared:
        yield shared


def chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png(path: Path, bits: int, palette: bool, more: bytes = b"") -> Path:
    """8 x 4 pixels of less than a byte each, of a palette or grey."""
    rows = np.random.default_rng(bits).integers(0, 256, (4, bits), dtype=np.uint8)
    colours = np.random.default_rng(1).integers(0, 256, (1 << bits, 3), dtype=np.uint8)
    header = struct.pack(">IIBBBBB", 8, 4, bits, 3 if palette else 0, 0, 0, 0)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + more
        + (chunk(b"PLTE", colours.tobytes()) if palette else b"")
        + chunk(b"IDAT", zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows)))
        + chunk(b"IEND", b"")
    )
    return path


def check(path: Path, reader: Reader) -> Texture:
    """Raw and decoded, stored and looked up: the texture is that which Mitsuba makes of the file itself."""
    texture = read_texture(path, reader=reader)
    theirs = mi.Bitmap(str(path))
    assert np.dtype(texture.pixels.dtype) == np.array(theirs).dtype and texture.srgb == theirs.srgb_gamma()
    for raw in (False, True):
        bitmap = mi.Bitmap(texture.pixels)
        bitmap.set_srgb_gamma(texture.srgb)
        ours = mi.traverse(mi.load_dict({"type": "bitmap", "bitmap": bitmap, "raw": raw}))["data"]
        data = mi.traverse(mi.load_dict({"type": "bitmap", "filename": str(path), "raw": raw}))["data"]
        assert type(ours) is type(data)
        np.testing.assert_allclose(np.array(ours), np.array(data), rtol=1e-6, atol=1e-6)
    return texture


FORMATS = {
    (".png", "uint8"): (1, 2, 3, 4),
    (".png", "uint16"): (1, 2, 3, 4),
    (".jpg", "uint8"): (1, 3),
    (".bmp", "uint8"): (1, 3, 4),
    (".tga", "uint8"): (1, 3, 4),
    (".ppm", "uint8"): (3,),
    (".exr", "half"): (1, 2, 3, 4),
    (".exr", "float"): (1, 2, 3, 4),
    (".pfm", "float"): (1, 3),
}


@pytest.mark.parametrize(
    ("suffix", "kind", "channels"), [(*key, count) for key, counts in FORMATS.items() for count in counts]
)
def test_numbers_are_those_of_mitsuba(tmp_path: Path, reader: Reader, suffix: str, kind: str, channels: int) -> None:
    names = {1: ("Y",), 2: ("Y", "A")}.get(channels, ()) if suffix == ".exr" else ()
    path = write(tmp_path / f"a{suffix}", COLOURS[..., :channels], type=kind, names=names)
    texture = check(path, reader)
    assert texture.pixels.shape == (5, 7, 1 if channels < 3 else 3) and not texture.said


@pytest.mark.parametrize(("bits", "palette"), [(1, False), (2, False), (4, False), (8, False), (4, True), (8, True)])
def test_few_bits_and_palettes(tmp_path: Path, reader: Reader, bits: int, palette: bool) -> None:
    check(png(tmp_path / "a.png", bits, palette), reader)


def test_radiance(tmp_path: Path, reader: Reader) -> None:
    path = tmp_path / "a.hdr"
    path.write_bytes(hdr(rgbe(card())))
    check(path, reader)


def test_linear_integers_are_told(tmp_path: Path, reader: Reader) -> None:
    path = png(tmp_path / "a.png", 8, False, chunk(b"gAMA", struct.pack(">I", 100_000)))
    assert check(path, reader).said == ["says that it is linear, and is taken for sRGB unless raw"]


def test_windows_layers_and_primaries_are_followed(tmp_path: Path, reader: Reader) -> None:
    path = write(tmp_path / "window.exr", COLOURS[..., :3], at=(-2, 1), display=(0, 0, 8, 8), type="half")
    texture = read_texture(path, reader=reader)
    np.testing.assert_array_equal(texture.pixels[1:6, :5], COLOURS[:, 2:, :3].astype(np.float16))
    assert texture.pixels.shape == (8, 8, 3) and (texture.pixels[6:] == 0).all()
    assert "what is outside is cropped and the rest is black" in " ".join(texture.said)
    names = ("beauty.R", "beauty.G", "beauty.B", "depth.Z")
    texture = read_texture(write(tmp_path / "layers.exr", COLOURS, names=names), reader=reader)
    np.testing.assert_array_equal(texture.pixels, COLOURS[..., :3])
    assert texture.said == ["layer beauty is read; channel left out: depth.Z"]
    p3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
    check(write(tmp_path / "primaries.exr", COLOURS[..., :3], chromaticities=p3), reader)


def test_what_is_no_number_is_repaired_and_told(tmp_path: Path, reader: Reader) -> None:
    pixels = COLOURS[..., :3] - 0.5
    expected = pixels.astype(np.float16)
    pixels[0, 0], pixels[1, 1] = np.nan, np.inf
    expected[0, 0], expected[1, 1] = 0, 65504
    with np.errstate(over="ignore"):
        texture = read_texture(write(tmp_path / "a.exr", pixels, type="half"), reader=reader)
    np.testing.assert_array_equal(texture.pixels, expected)
    (line,) = texture.said
    assert line.startswith("1 NaN, 1 infinite texel(s) repaired")


def test_damaged_and_large_files_are_refused(tmp_path: Path, reader: Reader) -> None:
    path = write(tmp_path / "a.exr", card(64, 128))
    with pytest.raises(InputError, match="more than 5e-05 GB"):
        read_texture(path, max_memory=50_000, reader=reader)
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(InputError, match="cannot be read as an image"):
        read_texture(path, reader=reader)
    with pytest.raises(InputError, match="no such file"):
        read_texture(tmp_path / "b.exr", reader=reader)
