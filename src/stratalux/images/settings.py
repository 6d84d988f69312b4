"""What leaves: how an image becomes a picture."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from ..errors import InputError
from ..settings import Kind, Settings, option

MOST_STOPS = 100.0
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


@dataclass(frozen=True)
class OutputSettings(Settings):
    """How an image becomes a picture of 8 bits (.png, .jpg); other formats keep it as it is."""

    exposure: float | None = option(
        None,
        "Exposure of a PNG or JPEG in stops.",
        "--exposure",
        minimum=-MOST_STOPS,
        maximum=MOST_STOPS,
        default_text="automatic",
    )


@dataclass(frozen=True)
class MemorySettings(Settings):
    """What reading a file may take."""

    max_memory: int | None = option(
        None, "Memory that the pixels of a map may take.", "--max-memory", kind=MEMORY, default_text="half of all"
    )
