"""The layout of a map's file, as far as its header, its name and its size tell."""

from __future__ import annotations

import re
from pathlib import Path

from ...errors import InputError
from . import LAYOUTS, Layout
from .cube import CROSS, FACES, STRIP, VERTICAL_CROSS, VERTICAL_STRIP
from .latlong import LATLONG

_CUBES = (CROSS, VERTICAL_CROSS, STRIP, VERTICAL_STRIP)
_WORDS: dict[str, tuple[Layout, ...]] = {
    **dict.fromkeys(("cross", "hcross", "vcross"), (CROSS, VERTICAL_CROSS)),
    **dict.fromkeys(("strip", "hstrip", "vstrip"), (STRIP, VERTICAL_STRIP)),
    **dict.fromkeys(("cube", "cubemap", "skybox"), _CUBES),
    **dict.fromkeys(("probe", "lightprobe", "angular", "angmap"), (LAYOUTS["angular"],)),
    **dict.fromkeys(("ball", "mirrorball", "chromeball"), (LAYOUTS["mirror-ball"],)),
    **dict.fromkeys(("octahedral", "octahedron", "octmap"), (LAYOUTS["octahedral"],)),
    **dict.fromkeys(("equalarea", "equiarea"), (LAYOUTS["equal-area"],)),
}
"""What the last word of a name may say."""
_RESOLUTION = re.compile(r"\d+k?|\d+x\d+|hd|hdr|hdri")
_FACES = (
    FACES.files,
    ("posx", "negx", "posy", "negy", "posz", "negz"),
    ("right", "left", "top", "bottom", "front", "back"),
    ("right", "left", "up", "down", "front", "back"),
)


def guessed(path: Path, width: int, height: int) -> Layout | None:
    """The layout that the name says, if an image of that size can have it; None for latitude and longitude.

    The last word of the name counts, without numbers such as 2k; words end at ``_``, ``-``, ``.`` or a space. One of
    six faces is known by the other five beside it. No layout but that of latitude and longitude is 2:1.
    """
    if width == height and (files := face_files(path)) and all(file.is_file() for file in files):
        return FACES
    words = [word for word in re.split(r"[^a-z0-9]+", path.stem.lower()) if word]
    while words and _RESOLUTION.fullmatch(words[-1]):
        words.pop()
    for last in ("".join(words[-2:]), *words[-1:]):
        for layout in _WORDS.get(last, ()):
            if layout.fits(width, height):
                return layout
    return None


def about_size(width: int, height: int) -> str:
    """What there is to say of a map of latitude and longitude of that size; nothing if it is 2:1."""
    if width == 2 * height or width * height == 1:
        return ""
    able = [layout.name for layout in LAYOUTS.values() if layout is not FACES and layout.fits(width, height)]
    hint = f"; if it is none: --env-layout {' or '.join(able)}" if able else ""
    return f"{width}x{height} is not 2:1; taken as a full latitude-longitude map all the same{hint}"


def check_size(path: Path, layout: Layout, width: int, height: int) -> None:
    """Raise :class:`InputError` if an image of that size cannot have the layout."""
    if layout is not LATLONG and not layout.fits(width, height):
        across, down = layout.aspect
        what = "the size of a face" if layout is FACES else f"the layout {layout.name}"
        raise InputError(
            f"{path}: {width}x{height} cannot be {what}, which is {across}:{down}; give another --env-layout"
        )


def face_files(path: Path) -> tuple[Path, ...]:
    """The files of all six faces, +X, −X, +Y, −Y, +Z and −Z, by the name of one of them; none if it is no such name.

    Names end with px or posx, and so on, or with what is there: +X is right, +Y top or up, and +Z front.
    """
    found = []
    for names in _FACES:
        for name in names:
            before, word = path.stem[: -len(name)], path.stem[-len(name) :]
            if word.lower() == name and not before[-1:].isalnum():
                styled = str.upper if word.isupper() else str.capitalize if word[0].isupper() else str
                found.append(tuple(path.with_name(f"{before}{styled(each)}{path.suffix}") for each in names))
    return next((files for files in found if all(file.is_file() for file in files)), found[0] if found else ())
