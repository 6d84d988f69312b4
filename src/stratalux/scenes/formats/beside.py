"""Files that a file names: they are read below its own folder alone."""

from __future__ import annotations

import os
import re
from pathlib import Path

from ..sources import source


def file_beside(folder: Path, name: str, base: Path | None = None) -> Path | None:
    """The file of that name below a folder, or None if there is none.

    Names are relative to `base`, which is in the folder, and to the folder itself. Of a path that leads out of it, such
    as an absolute one of somebody else's machine, the last part counts; a link that leads out of it is no file.
    Backslashes separate folders too, quotes around the name are dropped, and letters may differ in case, where nothing
    else fits.
    """
    name = re.sub(r"^[\"'](.*)[\"']$", r"\1", name.strip()).replace("\\", "/")
    last = name.rsplit("/", 1)[-1]
    if last in ("", ".", ".."):
        return None
    bases = list(dict.fromkeys([base or folder, folder]))
    places = [each / part for part in (name, last) for each in bases if is_below(each / part, folder)]
    for place in places:
        if os.path.isfile(place):
            return source(place)
    for place in places:
        if os.path.isdir(place.parent):
            found = sorted(each for each in os.listdir(place.parent) if each.lower() == place.name.lower())
            if found and os.path.isfile(place.parent / found[0]) and is_below(place.parent / found[0], folder):
                return source(place.parent / found[0])
    return None


def is_below(file: str | Path, folder: Path) -> bool:
    """Whether a path leads to the folder or to what is in it, by way of links, too."""
    try:
        top = os.path.realpath(folder)
        return os.path.commonpath([top, os.path.realpath(file)]) == top
    except ValueError:  # no name of a file
        return False
