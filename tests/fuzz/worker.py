"""Reads damaged maps one after the other, and prints a line for each: its number, and what has gone wrong, if anything.

python -m tests.fuzz.worker FOLDER FIRST LAST: those with the numbers from FIRST to LAST, less one.
"""

from __future__ import annotations

import resource
import sys
import warnings
from pathlib import Path

import numpy as np

from stratalux import EnvironmentMap, InputError
from stratalux.images.reader import Reader
from stratalux.images.reading import read_image
from tests.fuzz.damage import damaged, sound_files

MEMORY = 64 << 20
"""That pixels may take."""
MOST = 1 << 31
"""Bytes that either process may take in all."""


def main(folder: Path, first: int, last: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (2 * MOST, 2 * MOST))
    warnings.simplefilter("ignore")
    files = sound_files(folder / "sound")
    names = sorted(files)
    print("begun", flush=True)
    with Reader() as reader:
        for number in range(first, last):
            name = names[number % len(names)]
            path = folder / name
            path.write_bytes(damaged(files[name], number))
            print(number, wrong(path, reader), flush=True)
    for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN):
        used = resource.getrusage(who).ru_maxrss * 1024
        print("memory", f"{used} bytes" if used > MOST else "", flush=True)


def wrong(path: Path, reader: Reader) -> str:
    """What has gone wrong; nothing if the map is read, or refused in one line."""
    try:
        pixels = read_image(path, MEMORY, reader).pixels
        if pixels.nbytes < 1 << 20:
            texels = EnvironmentMap.from_array(pixels, str(path)).texels
            if not (np.isfinite(texels).all() and (texels >= 0).all()):
                return "texels that are no radiance"
    except InputError as error:
        if "\n" in str(error) or str(path) not in str(error):
            return f"said in more than a line, or of what: {error!r}"
        if "ended the reader" in str(error) or "given up" in str(error):
            return f"{path.name}: {error}" if "given up" in str(error) else ""
    except Exception as error:  # the process must go on
        return f"{path.name}: {error!r}"
    return ""


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
