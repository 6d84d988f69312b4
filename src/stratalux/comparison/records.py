"""What a comparison records: entries, errors, and one technique at one number of rays."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..integrators.techniques import Technique, Value, parse_technique


@dataclass(frozen=True)
class Entry:
    """One line of a comparison: a technique with what was ``given`` for it. ``stem`` is how its files begin."""

    name: str
    technique: Technique
    given: dict[str, Value]
    stem: str


@dataclass(frozen=True)
class Spread:
    """The values of the repeats, in order."""

    values: tuple[float, ...]

    @property
    def median(self) -> float:
        return float(np.median(self.values))

    @property
    def minimum(self) -> float:
        return float(np.min(self.values))

    @property
    def maximum(self) -> float:
        return float(np.max(self.values))


@dataclass(frozen=True)
class Errors:
    """Errors over one region of the image.

    ``rmse`` and ``relative_mse`` of each repeat; ``flip``, mean HDR-FLIP of the first repeat (NaN where FLIP is not
    defined, None where it is not installed). ``efficiency``: 1 / (seconds · relative MSE), of the medians.
    ``reference_limited``: the error is not well above that of the reference itself.
    """

    rmse: Spread
    relative_mse: Spread
    flip: float | None
    efficiency: float
    reference_limited: bool


@dataclass(frozen=True)
class Record:
    """One technique at one number of rays.

    ``rays``: what was asked for per shading point and base sample. ``integrator``: dictionary that Mitsuba loads.
    ``spp``: samples per pixel; each sends up to ``rays_per_sample`` rays from its shading point. ``seconds`` of the
    repeats without compilation and preparation, which the first, uncounted rendering reports as
    ``preparation_seconds`` and ``compile_seconds`` (Dr.Jit's cache on disk counts: a kernel of an earlier run is not
    compiled again). ``budget_seconds``: time allowed, at equal time. ``errors``: by region, ``surface`` and ``image``.
    ``image``: of the first repeat, (H, W, C), and ``stem`` the name of its files.
    """

    entry: Entry
    rays: int
    integrator: dict[str, Value]
    spp: int
    rays_per_sample: int
    pixels: int
    seconds: Spread
    preparation_seconds: float
    compile_seconds: float
    budget_seconds: float | None
    errors: dict[str, Errors]
    image: NDArray[np.float32]
    stem: str

    @property
    def rays_per_pixel(self) -> int:
        """Shadow rays in a pixel, at most."""
        return self.spp * self.rays_per_sample

    @property
    def camera_rays(self) -> int:
        return self.pixels * self.spp

    @property
    def shadow_rays(self) -> int:
        """In the whole image, at most: none is traced where nothing is hit."""
        return self.pixels * self.rays_per_pixel


def parse_entries(texts: Sequence[str]) -> tuple[Entry, ...]:
    """Read the techniques of a comparison; raises :class:`InputError` for none, an unknown one, or one named twice."""
    entries: list[Entry] = []
    for text in texts:
        technique, given = parse_technique(text)
        stem = re.sub(r"[^A-Za-z0-9._-]+", "-", text).strip("-.")
        if any(entry.technique.name == technique.name and entry.given == given for entry in entries):
            raise InputError(f"technique '{text}' is given twice; leave one out")
        while any(entry.stem == stem for entry in entries):
            stem += "_"
        entries.append(Entry(text, technique, given, stem))
    if not entries:
        raise InputError("no technique to compare; name at least one")
    return tuple(entries)
