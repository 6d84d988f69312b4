"""Radiance pictures: run lengths of both kinds, all axes, exposures, and what else headers say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import InputError
from stratalux.images.reader import Reader
from stratalux.images.reading import Image, read_image
from tests.images.make import card, hdr, of_rgbe, rgbe

STORED = rgbe(card())
STORED[3:6, 4:20] = STORED[3, 4]  # some runs
PIXELS = of_rgbe(STORED)


@pytest.fixture(scope="module")
def reader() -> Reader:
    with Reader() as shared:
        yield shared


def read(folder: Path, reader: Reader, content: bytes) -> Image:
    path = folder / "a.hdr"
    path.write_bytes(content)
    return read_image(path, reader=reader)


@pytest.mark.parametrize("runs", ["new", "old", "flat"])
def test_run_lengths(tmp_path: Path, reader: Reader, runs: str) -> None:
    image = read(tmp_path, reader, hdr(STORED, runs=runs))
    np.testing.assert_array_equal(image.pixels, PIXELS)
    assert not image.said


def test_long_runs_have_several_digits(tmp_path: Path, reader: Reader) -> None:
    stored = np.broadcast_to(STORED[:1, :1], (2, 70_000, 4)).copy()
    stored[:, -1] = STORED[5, 5]
    content = hdr(stored, runs="old")
    assert len(content) < 200
    np.testing.assert_array_equal(read(tmp_path, reader, content).pixels, of_rgbe(stored))


@pytest.mark.parametrize(
    ("axes", "seen"),
    [
        ("-Y +X", lambda a: a),
        ("-Y -X", np.fliplr),
        ("+Y +X", np.flipud),
        ("+Y -X", lambda a: np.rot90(a, 2)),
        ("+X -Y", lambda a: a.swapaxes(0, 1)),
        ("-X -Y", lambda a: np.fliplr(a.swapaxes(0, 1))),
        ("+X +Y", lambda a: np.flipud(a.swapaxes(0, 1))),
        ("-X +Y", lambda a: np.rot90(a.swapaxes(0, 1), 2)),
    ],
)
@pytest.mark.parametrize("runs", ["new", "old"])
def test_axes(tmp_path: Path, reader: Reader, axes: str, seen: object, runs: str) -> None:
    """Rows go along the first axis: up where it says +Y, and to the right where it says +X."""
    np.testing.assert_array_equal(read(tmp_path, reader, hdr(STORED, axes=axes, runs=runs)).pixels, seen(PIXELS))


@pytest.mark.parametrize(
    ("lines", "divisor", "message"),
    [
        (["EXPOSURE=4"], [4, 4, 4], "EXPOSURE and COLORCORR, 4"),
        (["EXPOSURE=  2.0", "SOFTWARE=x", "EXPOSURE= 8"], [16, 16, 16], ", 16"),
        (["COLORCORR=1 2 4", "EXPOSURE=2"], [2, 4, 8], ", 2 4 8"),
        (["EXPOSURE=1"], [1, 1, 1], ""),
        (["EXPOSURE=0"], [1, 1, 1], "EXPOSURE=0 makes no sense"),
        (["EXPOSURE=bright"], [1, 1, 1], "EXPOSURE=bright makes no sense"),
        (["EXPOSURE=nan"], [1, 1, 1], "EXPOSURE=nan makes no sense"),
        (["GAMMA=1", "PRIMARIES=0 0 0 0 0 0 0 0", "VIEW= -vtv -vp 0 0 0", "\tVIEW= -vta", "# x"], [1, 1, 1], ""),
        (["PRIMARIES=0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329"], [1, 1, 1], ""),
        (["PRIMARIES=0.64 0.33"], [1, 1, 1], "PRIMARIES make no sense"),
    ],
)
@pytest.mark.parametrize("runs", ["new", "flat"])
def test_header_lines(
    tmp_path: Path, reader: Reader, lines: list[str], divisor: list[float], message: str, runs: str
) -> None:
    image = read(tmp_path, reader, hdr(STORED, lines, runs=runs))
    np.testing.assert_allclose(image.pixels, PIXELS / np.float32(divisor), rtol=1e-6)
    assert message in "".join(image.said) and bool(message) == bool(image.said)


def test_lines_that_end_as_in_windows(tmp_path: Path, reader: Reader) -> None:
    for runs in ("new", "old"):
        image = read(tmp_path, reader, hdr(STORED, ["EXPOSURE=2"], runs=runs, end="\r\n"))
        np.testing.assert_allclose(image.pixels, PIXELS / 2)


def test_gamma(tmp_path: Path, reader: Reader) -> None:
    image = read(tmp_path, reader, hdr(STORED, ["GAMMA=2.2"]))
    np.testing.assert_allclose(image.pixels, PIXELS**2.2, rtol=1e-5)
    assert "GAMMA=2.2" in image.said[0]


def test_primaries(tmp_path: Path, reader: Reader) -> None:
    grey = np.broadcast_to(rgbe(np.full((1, 1, 3), 3.0)), (8, 16, 4))
    rec2020 = "PRIMARIES=0.708 0.292 0.170 0.797 0.131 0.046 0.3127 0.3290"
    image = read(tmp_path, reader, hdr(grey, [rec2020]))
    np.testing.assert_allclose(image.pixels, 3, rtol=1e-4)
    assert "converted" in image.said[0]
    image = read(tmp_path, reader, hdr(STORED, [rec2020]))
    # ITU-R BT.2087: 2020 to 709
    expected = PIXELS @ np.array([[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]).T
    np.testing.assert_allclose(image.pixels, expected, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("runs", ["new", "flat"])
def test_xyz_has_lumens_and_a_white_of_equal_energy(tmp_path: Path, reader: Reader, runs: str) -> None:
    grey = np.broadcast_to(rgbe(np.full((1, 1, 3), 179.0)), (8, 16, 4))
    image = read(tmp_path, reader, hdr(grey, ["FORMAT=32-bit_rle_xyze", "EXPOSURE=2"], runs=runs))
    np.testing.assert_allclose(image.pixels, 0.5, rtol=1e-4)
    assert "CIE XYZ" in "".join(image.said)
    d65 = np.broadcast_to(rgbe(179 * np.array([[[0.9505, 1.0, 1.0891]]])), (8, 16, 4))
    primaries = "PRIMARIES=0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329"
    image = read(tmp_path, reader, hdr(d65, ["FORMAT=32-bit_rle_xyze", primaries], runs=runs))
    np.testing.assert_allclose(image.pixels, 1, rtol=0.01)


def test_headers_without_a_name_or_a_format(tmp_path: Path, reader: Reader) -> None:
    content = hdr(STORED)
    for other in (
        content.replace(b"#?RADIANCE\n", b""),
        content.replace(b"#?RADIANCE", b"#?RGBE"),
        content.replace(b"FORMAT=32-bit_rle_rgbe\n", b""),
    ):
        np.testing.assert_array_equal(read(tmp_path, reader, other).pixels, PIXELS)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda content: content.replace(b"-Y 16 +X 32", b"-Y 16 +Y 32"), "no resolution"),
        (lambda content: content.replace(b"-Y 16 +X 32", b"sixteen"), "no resolution but 'sixteen'"),
        (lambda content: content.replace(b"-Y 16 +X 32", b"-Y 0 +X 32"), "without pixels"),
        (lambda content: content.replace(b"-Y 16 +X 32", b"-Y 17000 +X 32"), "too short|pixels are there"),
        (lambda content: content.replace(b"-Y 16 +X 32", b"-Y 999999999 +X 999999999"), "GB, more than"),
        (lambda content: content.replace(b"rle_rgbe", b"rle_spec"), "FORMAT=32-bit_rle_spec is not one of"),
        (lambda content: content.replace(b"\n\n", b"\n"), "header does not end|no resolution"),
        (lambda content: content[:-100], "cannot be read"),
        (lambda content: content[:60], "cannot be read"),
    ],
)
@pytest.mark.parametrize("runs", ["new", "old", "flat"])
def test_damage_is_one_line(tmp_path: Path, reader: Reader, change: object, message: str, runs: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        read(tmp_path, reader, change(hdr(STORED, runs=runs)))
    assert "\n" not in str(error.value)


def test_a_run_without_a_pixel_is_refused(tmp_path: Path, reader: Reader) -> None:
    stored: NDArray[np.uint8] = STORED.copy()
    stored[0, 0] = 1, 1, 1, 5
    with pytest.raises(InputError, match="run length without a pixel"):
        read(tmp_path, reader, hdr(stored, runs="flat"))
