"""Statements of an MTL file that name an image: their options, and where the file is."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ...model import Picture, Texture
from ..beside import file_beside

_NUMBERS = {"-o": 3, "-s": 3, "-t": 3, "-mm": 2}
"""Options with numbers, of which the later ones may be left out."""
_WORDS = ("-blendu", "-blendv", "-bm", "-boost", "-cc", "-clamp", "-imfchan", "-texres", "-type")
"""Options with one word."""
_HIGH_RANGE = (".exr", ".hdr", ".pfm")
_CHANNELS: dict[str, Literal["r", "g", "b", "a"]] = {"r": "r", "g": "g", "b": "b", "m": "a"}


@dataclass(frozen=True)
class Map:
    """An image with what the statement says of its values: `gain` * texel + `base`, and the multiplier `bump`."""

    texture: Texture
    channel: Literal["r", "g", "b", "a"] | None
    gain: float = 1.0
    base: float = 0.0
    bump: float = 1.0


def parsed(said: str) -> tuple[dict[str, list[str]], str]:
    """The options of a statement with their arguments, and the name of the file, which may have blanks."""
    options: dict[str, list[str]] = {}
    rest = said.strip()
    while match := re.match(r"(-[a-zA-Z]+)\s+", rest):
        option = match[1].lower()
        if option not in _NUMBERS and option not in _WORDS:
            break
        rest, found = rest[match.end() :], []
        for _ in range(_NUMBERS.get(option, 1)):
            argument = re.match(r"(\S+)\s+(?=\S)", rest)
            # The last word is the name, even if it is a number.
            if not argument or (option in _NUMBERS and not _is_number(argument[1])):
                break
            found.append(argument[1])
            rest = rest[argument.end() :]
        options[option] = found
    return options, rest


def texture_map(said: str, base: Path, folder: Path, colour: bool, pictures: dict[Path, Picture]) -> Map | str:
    """What a statement says, with the file that it names, or the name of a file that is not there.

    `base`: where the MTL file is; `folder`: that of the OBJ file, below which images are looked for; `pictures`: those
    that are known, so that each is read once.
    """
    options, name = parsed(said)
    path = file_beside(folder, name, base)
    if path is None:
        return name
    # v goes up in OBJ, and s and o are applied there.
    (su, sv), (ou, ov) = _pair(options.get("-s", []), 1.0), _pair(options.get("-o", []), 0.0)
    wrap: Literal["clamp", "repeat"] = "clamp" if options.get("-clamp") == ["on"] else "repeat"
    texture = Texture(
        pictures.setdefault(path, Picture(path.name, path)),
        "srgb" if colour and path.suffix.lower() not in _HIGH_RANGE else "linear",
        (wrap, wrap),
        transform=((su, 0.0, ou), (0.0, sv, 1 - sv - ov)),
    )
    range_ = [float(number) for number in options.get("-mm", [])]
    bump = next((float(number) for number in options.get("-bm", []) if _is_number(number)), 1.0)
    channel = next((_CHANNELS.get(each.lower()) for each in options.get("-imfchan", [])), None)
    base_value, gain = range_ if len(range_) == 2 else (0.0, 1.0)
    return Map(texture, channel, gain, base_value, bump)


def _pair(numbers: list[str], default: float) -> tuple[float, float]:
    u, v = [*map(float, numbers[:2]), default, default][:2]
    return u, v


def _is_number(word: str) -> bool:
    return bool(re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", word))
