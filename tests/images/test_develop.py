"""Pictures of images that are there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stratalux import InputError, develop
from stratalux.errors import ImageWarning
from stratalux.images.tonemap import auto_exposure, tonemap
from stratalux.images.writing import automatic_exposure, write_image
from tests.images.make import card, write
from tests.images.test_writing import COVERED, spec_and_pixels

CARD = card()


@pytest.fixture
def pair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    """Two images, the second four times as bright, in the folder where this runs."""
    monkeypatch.chdir(tmp_path)
    write(Path("a.exr"), CARD)
    write(Path("b.pfm"), 4 * CARD)
    return "a.exr", "b.pfm"


def test_one_picture_is_that_of_a_rendering(pair: tuple[str, str]) -> None:
    made = develop("a.exr", "a.png", view="agx")
    write_image("again.png", CARD, view="agx")
    assert Path("a.png").read_bytes() == Path("again.png").read_bytes()
    assert made.files == (Path("a.png"),) and made.exposure == pytest.approx(auto_exposure(CARD), abs=1e-9)


def test_one_exposure_for_all(pair: tuple[str, str]) -> None:
    """That of all pixels together: a stop below that of the darker one."""
    made = develop(pair, "picture-{}.png")
    assert list(map(str, made.files)) == ["picture-a.png", "picture-b.png"]
    assert made.exposure == pytest.approx(auto_exposure(CARD) - 1, abs=1e-6)
    for path, factor in zip(made.files, (1, 4), strict=True):
        assert np.array_equal(spec_and_pixels(path)[1], tonemap(factor * CARD, made.exposure))


def test_an_exposure_that_is_given(pair: tuple[str, str]) -> None:
    Path("out").mkdir()
    made = develop(list(map(Path, pair)), Path("out"), exposure=-2, view="standard", bits=16)
    assert made.exposure == -2 and list(map(str, made.files)) == ["out/a.png", "out/b.png"]
    spec, pixels = spec_and_pixels(Path("out/b.png"))
    assert str(spec.format) == "uint16" and pixels.min() == 65535  # of 1 and more


def test_alpha_comes_along(pair: tuple[str, str]) -> None:
    write_image("c.exr", COVERED)
    develop("c.exr", "c.png", exposure=0)
    write_image("d.png", COVERED.astype(np.float16), exposure=0)
    developed, expected = (spec_and_pixels(Path(name))[1].astype(int) for name in ("c.png", "d.png"))
    assert developed.shape[2] == 4 and np.abs(developed - expected).max() <= 1
    with pytest.warns(ImageWarning, match="8-bit sRGB"):
        develop("c.png", "e.png", exposure=0, view="standard")
    again = spec_and_pixels(Path("e.png"))[1].astype(int)
    assert np.abs(again - developed)[developed[..., 3] > 0].max() <= 1


def test_what_is_covered_is_metered(pair: tuple[str, str]) -> None:
    """Edges that hardly are, and half floats that make nothing of them, do not make the rest brighter."""
    alpha = np.zeros(CARD.shape[:2], dtype=np.float32)
    alpha[2:, 3:], alpha[1, 3:] = 1, 1e-9
    covered = np.dstack([CARD * alpha[..., None], alpha])
    write_image("c.exr", covered)
    write_image("d.exr", covered, float32=True)
    exposures = [develop(name, "c.png").exposure for name in ("c.exr", "d.exr")]
    assert exposures == pytest.approx([auto_exposure(CARD[2:, 3:])] * 2, abs=1e-4)
    assert automatic_exposure(covered) == pytest.approx(exposures[1], abs=1e-6)


def test_what_a_file_says_is_told(pair: tuple[str, str]) -> None:
    pixels = CARD.copy()
    pixels[0, 0, 0] = np.nan
    write(Path("c.exr"), np.dstack([pixels, CARD[..., :1]]), names=["R", "G", "B", "Z"])
    with pytest.warns(ImageWarning) as told:
        develop("c.exr", "c.png")
    assert [str(one.message) for one in told] == [
        "c.exr: channel left out: Z",
        "c.exr: 1 pixel(s) are not finite numbers",
    ]


@pytest.mark.parametrize(
    ("inputs", "output", "message"),
    [
        (["a.exr", "b.pfm"], "a.png", "a.png: is one name for 2 pictures; give a folder that is there"),
        (["a.exr", "b.pfm"], "out/", "out/: no such folder; make it first"),
        (["a.exr", "./a.exr"], "{}.png", "a.png: is to be written twice"),
        (["a.png"], "{}.png", "a.png: is read, and would be lost"),
        (["a.exr"], "b.exr", "b.exr: unknown image format '.exr'; use one of .png"),
        (["a.exr"], "no/b.png", "no/b.png: cannot be written"),
        (["a.exr", "no.exr"], "{}.png", "no.exr: no such file"),
        (["a.exr"], "", "is empty"),
        ([], "a.png", "no image is given"),
    ],
)
def test_what_cannot_be_done_is_refused(pair: tuple[str, str], inputs: list[str], output: str, message: str) -> None:
    before = sorted(Path().iterdir())
    with pytest.raises(InputError, match=message.replace("{", r"\{")):
        develop(inputs, output)
    assert sorted(Path().iterdir()) == before
