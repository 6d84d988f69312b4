"""One image of several seeds."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import stratalux
from stratalux import InputError
from stratalux.images.writing import write_image
from stratalux.rendering.merging import Merged, merge

SMALL = {"size": (16, 12), "direct": True, "float32": True}


def made(folder: Path, seed: int, spp: int, **settings: object) -> Path:
    path = folder / f"{seed}-{spp}.exr"
    stratalux.render("demo", seed=seed, spp=spp, **{**SMALL, **settings}).write(path)
    return path


def pixels(path: Path) -> np.ndarray:
    return np.array(mi.Bitmap(str(path)))


def written(merged: Merged, path: Path) -> Path:
    write_image(path, merged.pixels, merged.metadata(), float32=True, channels=merged.channels)
    return path


def test_the_mean_by_samples_and_of_that_again(tmp_path: Path) -> None:
    paths = [made(tmp_path, seed, spp) for seed, spp in ((1, 4), (2, 8), (3, 4))]
    spp = [int(mi.Bitmap(str(path)).metadata()["spp"]) for path in paths]
    expected = sum(n * pixels(path).astype(np.float64) for n, path in zip(spp, paths, strict=True)) / sum(spp)
    at_once = merge(paths)
    assert (at_once.seeds, at_once.spp) == ((1, 2, 3), sum(spp)) and at_once.channels == ("R", "G", "B")
    np.testing.assert_allclose(at_once.pixels, expected, rtol=1e-5)
    two = written(merge(paths[:2]), tmp_path / "two.exr")
    again = merge([paths[2], two])
    assert sorted(again.seeds) == [1, 2, 3] and again.spp == sum(spp)
    np.testing.assert_allclose(again.pixels, expected, rtol=1e-5)
    with pytest.raises(InputError, match="has seed 2, as .*two.exr has: the same samples again"):
        merge([two, paths[1]])


def test_another_picture_is_refused_by_what_differs(tmp_path: Path) -> None:
    one = made(tmp_path, 1, 4)
    with pytest.raises(InputError, match=r"another picture than .*1-4.exr: size is \[16, 10\] and not \[16, 12\]"):
        merge([one, made(tmp_path, 2, 4, size=(16, 10))])
    with pytest.raises(InputError, match="env_rotate|rotate"):
        merge([one, made(tmp_path, 3, 4, rotate=(0, 90, 0))])


def test_what_cannot_be_merged(tmp_path: Path) -> None:
    one = made(tmp_path, 1, 4)
    with pytest.raises(InputError, match="one image is no mean"):
        merge([one])
    other = tmp_path / "other.exr"
    mi.Bitmap(np.ones((2, 2, 3), dtype=np.float32)).write(str(other))
    with pytest.raises(InputError, match="other.exr: says nothing of settings"):
        merge([one, other])
    with pytest.raises(InputError, match="missing.exr: no such file"):
        merge([one, tmp_path / "missing.exr"])
