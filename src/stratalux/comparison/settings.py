"""What is compared, and how thoroughly."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from ..errors import InputError
from ..settings import Kind, Settings, option

MOST_RAYS = 1 << 20


def _counts(value: Any) -> tuple[int, ...]:
    try:
        numbers = sorted({number.__index__() for number in value})
    except (TypeError, AttributeError):
        raise InputError(f"rays: {value!r} is no list of numbers; give for example (16, 64, 256)") from None
    if not numbers:
        raise InputError("rays: no number given; give for example 16,64,256")
    if numbers[0] < 1:
        raise InputError(f"rays: {numbers[0]} is too small; give at least 1")
    if numbers[-1] > MOST_RAYS:
        raise InputError(f"rays: {numbers[-1]} is too large; give at most {MOST_RAYS}")
    return tuple(numbers)


def _parse_counts(text: str) -> tuple[int, ...]:
    parts = [part.strip() for part in text.split(",")]
    if not all(re.fullmatch(r"\d{1,9}", part) and int(part) > 0 for part in parts):
        raise InputError(f"'{text}' is no list of numbers from 1 on; write for example 16,64,256")
    return _counts([int(part) for part in parts])


COUNTS = Kind("N,N,...", _parse_counts, _counts, lambda numbers: ",".join(map(str, numbers)), list)


@dataclass(frozen=True)
class ComparisonSettings(Settings):
    """What is compared, and how thoroughly."""

    techniques: tuple[str, ...] = option(
        ...,
        "What to compare; repeat for several.",
        "-t",
        "--technique",
        metavar="NAME[:key=value,...]",
        several=True,
    )
    rays: tuple[int, ...] = option(
        (16, 32, 64, 128, 256), "Rays per shading point, which the techniques get in turn.", "--rays", kind=COUNTS
    )
    spp: int = option(
        4,
        "Samples per pixel; a technique whose rays are fixed gets more instead.",
        "-s",
        "--spp",
        minimum=1,
        maximum=1 << 20,
    )
    repeats: int = option(3, "Renderings with different seeds.", "--repeats", minimum=1, maximum=100)
    reference_spp: int = option(
        4096, "Samples per pixel of the reference.", "--reference-spp", minimum=1, maximum=1 << 30
    )
    seed: int = option(0, "Seed of the random numbers.", "--seed", minimum=0, maximum=(1 << 16) - 1)
