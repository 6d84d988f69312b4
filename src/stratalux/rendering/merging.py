"""One image of several, which were rendered from different seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..images.reader import Reader
from ..images.reading import check_size, default_memory, on_one_line
from .identity import differences
from .settings import METADATA, SAMPLES, PictureSettings

_ITS_OWN = ("seed", "spp", "time", "target_error")
"""Settings of sampling in which the images may differ."""


@dataclass(frozen=True)
class Merged:
    """``pixels`` (H, W, C) with the names of their ``channels``; ``picture``: what all have in common, with the first
    one's seed; ``seeds`` of all; ``spp``: their samples per pixel together."""

    pixels: NDArray[np.float32]
    channels: tuple[str, ...]
    picture: PictureSettings
    seeds: tuple[int, ...]
    spp: int

    def metadata(self) -> dict[str, bool | str | int | float]:
        """What the OpenEXR file remembers: it can be merged again."""
        samples = " ".join(map(str, (self.spp, *self.seeds)))
        return {METADATA: self.picture.to_text(), SAMPLES: samples, "spp": self.spp, "samplesPerPixel": self.spp}


@dataclass(frozen=True)
class _One:
    path: Path
    pixels: NDArray[np.float32]
    channels: tuple[str, ...]
    picture: PictureSettings
    seeds: tuple[int, ...]
    spp: int


def merge(paths: Sequence[str | Path]) -> Merged:
    """The mean of OpenEXR files of ours, by their samples per pixel.

    Raises :class:`InputError` for files that are not of the same picture, saying what differs, and for one seed twice.
    """
    if len(paths) < 2:
        raise InputError("merge: one image is no mean; give two or more")
    with Reader() as reader:
        first = _read(Path(paths[0]), reader)
        total = first.pixels.astype(np.float64) * first.spp
        seeds, spp = {seed: first.path for seed in first.seeds}, first.spp
        for path in paths[1:]:
            one = _read(Path(path), reader)
            _check(first, one)
            for seed in one.seeds:
                if seed in seeds:
                    raise InputError(
                        f"{path}: has seed {seed}, as {seeds[seed]} has: the same samples again; give it another --seed"
                    )
                seeds[seed] = one.path
            total += one.pixels.astype(np.float64) * one.spp
            spp += one.spp
    picture = replace(first.picture, sampling=replace(first.picture.sampling, spp=spp))
    return Merged((total / spp).astype(np.float32), first.channels, picture, tuple(seeds), spp)


def _read(path: Path, reader: Reader) -> _One:
    picture = PictureSettings.of_file(path)
    with on_one_line(path):
        part: dict[str, Any] = reader.parts(path)[0]
        x, y, width, height = part["data"]
        check_size(path, part, (width, height), default_memory())
        names = tuple(part["channels"])
        pixels = reader.pixels(path, part, 0, list(range(len(names))), (x, x + width), (y, y + height))
    try:
        spp, *seeds = map(int, str(part["attributes"][SAMPLES]).split())
        if spp < 1 or not seeds:
            raise ValueError
    except (KeyError, ValueError):
        raise InputError(f"{path}: does not say how many samples it has; render it again") from None
    return _One(path, pixels, names, picture, tuple(seeds), spp)


def _check(first: _One, other: _One) -> None:
    """Raise :class:`InputError` unless both are the same picture but for their samples."""
    differing = [
        f"{name} is {theirs!r} and not {ours!r}" for name, ours, theirs in differences(_content(first), _content(other))
    ]
    if differing:
        raise InputError(f"{other.path}: is another picture than {first.path}: {'; '.join(differing)}")


def _content(one: _One) -> dict[str, Any]:
    """What all images have to have in common."""
    content = one.picture.to_json()
    for name in _ITS_OWN:
        content["sampling"].pop(name)
    for name in ("output", "machine"):
        content.pop(name)
    return {**content, "image": {"shape": one.pixels.shape[:2], "channels": one.channels}}
