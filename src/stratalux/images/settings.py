"""What leaves: how an image becomes a picture, and a file; and what reading one may take."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

from ..errors import InputError
from ..settings import Kind, Settings, option

MOST_STOPS = 100.0
PICTURE_BITS = (8, 16)
VIEW_NAMES = ("reinhard", "standard", "filmic", "aces", "agx", "neutral")
"""Those of :data:`.views.VIEWS`, which this need not import."""
_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}


def _bytes(value: Any) -> int:
    try:
        number: int = value.__index__()
    except AttributeError:
        raise InputError(f"max_memory: {value!r} is no number of bytes") from None
    if isinstance(value, bool) or not 0 < number < 1 << 60:
        raise InputError(f"max_memory: {value!r} is no number of bytes from 1 on")
    return number


def _parse_bytes(text: str) -> int:
    match = re.fullmatch(r"(\d{1,15}(?:\.\d{1,9})?)\s*([KMGT]?)(?:i?B)?", text, re.IGNORECASE)
    if match is None or not float(match[1]):
        raise InputError(f"'{text}' is no size of memory; write for example 500M or 4G")
    return _bytes(round(float(match[1]) * _UNITS[match[2].upper()]))


MEMORY = Kind("SIZE", _parse_bytes, _bytes)
"""Bytes, written with K, M, G or T for powers of 1024."""


def _stops(value: Any) -> float:
    try:
        if isinstance(value, (bool, str)):
            raise TypeError
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"exposure: {value!r} is no number of stops") from None
    if not math.isfinite(number):
        raise InputError(f"exposure: {value} is not a finite number")
    if abs(number) > MOST_STOPS:
        size = "large; give at most " if number > 0 else "small; give at least -"
        raise InputError(f"exposure: {value} is too {size}{MOST_STOPS:g}")
    return number


def _parse_stops(text: str) -> float | None:
    if text.strip().lower() == "auto":
        return None
    try:
        number = float(text)
    except ValueError:
        raise InputError(f"'{text}' is no exposure; write a number of stops, or auto") from None
    return _stops(number)


STOPS = Kind("auto|STOPS", _parse_stops, _stops)
"""Factors of two, as a number."""


def _bits(value: Any) -> int:
    if isinstance(value, bool) or value not in PICTURE_BITS:
        raise InputError(f"bits: {value!r} is none of {', '.join(map(str, PICTURE_BITS))}")
    return int(value)


def _parse_bits(text: str) -> int:
    return _bits(int(text) if text.isdecimal() else text)


BITS = Kind("|".join(map(str, PICTURE_BITS)), _parse_bits, _bits)
"""How many bits a channel has."""


@dataclass(frozen=True)
class ViewSettings(Settings):
    """How linear light becomes a picture that is looked at."""

    view: str = option(
        "reinhard",
        "How light becomes a picture: what is brighter than white is cut off by standard, and bent by the others.",
        "--view",
        choices=VIEW_NAMES,
    )
    exposure: float | None = option(
        None, "Exposure of a picture in stops.", "--exposure", kind=STOPS, default_text="auto, one for all outputs"
    )


@dataclass(frozen=True)
class PictureFileSettings(ViewSettings):
    """How a picture is stored."""

    bits: int = option(8, "Bits of a .png or .tif.", "--bits", kind=BITS)


@dataclass(frozen=True)
class OutputSettings(PictureFileSettings):
    """How an image is stored, as a picture (.png, .jpg, .webp, .tif) or as linear numbers (.exr, .hdr, .pfm)."""

    float32: bool = option(False, "Linear numbers of 32 bits in .exr, where 16 are usual, and .tif.", "--float32")


@dataclass(frozen=True)
class MemorySettings(Settings):
    """What reading a file may take."""

    max_memory: int | None = option(
        None, "Memory that the pixels of a map may take.", "--max-memory", kind=MEMORY, default_text="half of all"
    )
