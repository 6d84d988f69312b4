"""How many samples may be under way at the same time, by the memory that there is."""

from __future__ import annotations

import resource
import sys
from contextlib import suppress
from pathlib import Path

from ..errors import InputError
from ..images.reading import default_memory

_GIGA = 1 << 30


class NoRoom(InputError):
    """A film has none. ``room``: bytes that are left for it; ``most``: for a moment; ``each``: what a pixel takes."""

    def __init__(self, message: str, room: int = 0, most: int = 0, each: float = 1.0) -> None:
        super().__init__(message)
        self.room, self.most, self.each = room, most, each


def resident() -> int:
    """Bytes that this process has in memory now; where only the most that it had is known, that."""
    with suppress(OSError, ValueError, IndexError):
        return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else most << 10


def samples_at_once(max_memory: int | None, size: tuple[int, int], per_pixel: int, per_sample: int, least: int) -> int:
    """How many have room beside what the process has already: a power of two, ``least`` or more.

    ``max_memory``: bytes that the process may take in all; unless given, half of what the machine has, but a film that
    leaves no room in that may take nearly all of it. ``per_pixel`` of a film of that ``size``, and ``per_sample``:
    bytes. Raises :class:`NoRoom` if there is none for ``least``.
    """
    width, height = size
    others, pixels = resident(), width * height
    before = others + per_pixel * pixels
    least = 1 << (least - 1).bit_length()
    limit = default_memory() if max_memory is None else max_memory
    room = limit - before
    if room < per_sample * least:
        most = limit if max_memory is not None else int(1.8 * limit)
        need = before + per_sample * least
        if need > most:
            what = "max_memory" if max_memory is not None else "memory"
            message = (
                f"{what}: a film of {width}x{height} pixels needs {_said(need)} with its scene and map, and there are "
                f"{_said(most)}; {'give more, or ' if max_memory is not None else ''}make the film smaller (--size)"
            )
            raise NoRoom(message, limit - others, most - others, per_pixel + per_sample * least / pixels)
        return least
    return 1 << ((room // per_sample).bit_length() - 1)


def _said(size: int) -> str:
    return f"{size / _GIGA:.1f}G" if size >= 10 * (_GIGA >> 3) else f"{-(-size >> 20)}M"
