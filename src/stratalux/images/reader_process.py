"""The process that reads image files with OpenImageIO; :mod:`.reader` starts it, and nothing imports it.

It knows nothing of this package, so that it starts in a tenth of a second. Requests are lines of JSON on its standard
input. Each answer is a message: its kind (``J``: JSON, ``P``: pixels), its length, and as many bytes. After the pixels
comes JSON again, which says whether they are all there. Where the request names a part of memory that is shared, the
pixels are there, and JSON is all that is sent.
"""

from __future__ import annotations

import json
import mmap
import os
import resource
import struct
import sys
from typing import Any

sys.path[:0] = sys.argv[1:]  # where the libraries are: this interpreter looks nowhere else

import numpy as np  # noqa: E402
import OpenImageIO as oiio  # noqa: E402

_PARTS = 64
"""Of one file that are looked at, at most."""
_CHUNK = 1 << 23
"""Bytes that are decoded before they are sent, about: few enough to stay in the cache, enough for several threads."""
_THREADS = 8
_NAMES = {"float16": "half", "float32": "float"}
"""Of types, where NumPy and OpenImageIO have different ones."""
_TEXTS = (
    "name",
    "stratalux",
    "stratalux:layout",
    "stratalux:samples",
    "oiio:ColorSpace",
    "textureformat",
    "view",
    "compression",
    "ICCProfile:profile_description",
)
_NUMBERS = ("Orientation", "oiio:Gamma", "oiio:UnassociatedAlpha", "oiio:RowsPerChunk")


def main() -> None:
    # Libraries print to the standard output what they have to say of a file.
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    oiio.attribute("threads", min(os.cpu_count() or 1, _THREADS))
    for line in sys.stdin.buffer:
        request = json.loads(line)
        try:
            _limit_memory(request["memory"])
            if request["what"] == "parts":
                answer: dict[str, Any] = {"parts": parts(request["path"])}
            elif "room" in request:
                descriptor, at, size = request["room"]
                _fill(descriptor, at, size, pixels(request))
                answer = {}
            else:
                for rows in pixels(request):
                    _send(answers, b"P", memoryview(rows).cast("B"))
                answer = {}
        except Exception as error:  # of whatever kind: there is nobody else to tell
            answer = {"error": str(error) or type(error).__name__}
        _send(answers, b"J", json.dumps(answer).encode())


def parts(path: str) -> list[dict[str, Any]]:
    """What is in the file, without its pixels: a description of each of its images."""
    source, refused = oiio.ImageInput.open(path, _hints()), ""
    # What has fewer pixels in some channels than in others, as luminance with chroma has, only the older of the two
    # readers of OpenEXR takes.
    for core in (0, 1):
        if source is None:
            refused = refused or _error(oiio.geterror)
            oiio.attribute("openexr:core", core)
            source = oiio.ImageInput.open(path, _hints()) if core == 0 and "ubsampled" in refused else None
        else:
            break
    if source is None:
        raise RuntimeError(refused)
    core = oiio.get_int_attribute("openexr:core", 1)
    found: list[dict[str, Any]] = []
    while len(found) < _PARTS and source.seek_subimage(len(found), 0):
        found.append({"core": core, "format": source.format_name(), **_description(source.spec())})
    oiio.attribute("openexr:core", 1)
    source.close()
    return found


def _description(spec: oiio.ImageSpec) -> dict[str, Any]:
    attributes: dict[str, Any] = {}
    for name in (*_TEXTS, *_NUMBERS, "chromaticities"):
        try:
            value = spec.getattribute(name)
        except UnicodeDecodeError:
            continue
        if name == "chromaticities":
            value = [float(x) for x in value] if isinstance(value, tuple) else None
        if value is not None and isinstance(value, str | int | float | list):
            attributes[name] = value
    formats = spec.channelformats or [spec.format] * spec.nchannels
    return {
        "data": (spec.x, spec.y, spec.width, spec.height),
        "display": (spec.full_x, spec.full_y, spec.full_width, spec.full_height),
        "tile": (spec.tile_width, spec.tile_height),
        "depth": spec.depth,
        "alpha": spec.alpha_channel,
        "deep": bool(spec.deep),
        "channels": list(spec.channelnames),
        "types": [str(kind) for kind in formats],
        "attributes": attributes,
    }


def pixels(request: dict[str, Any]) -> Any:
    """Rows of the ``channels`` asked for (rows, columns, channels), in the rectangle asked for, of the ``type`` asked
    for: float (which 32-bit integers become, too), float32, float16, uint8 or uint16. A channel of None is as large as
    can be, of whole numbers.

    ``columns`` and ``rows``: first and last, less one, in the coordinates of the file.
    """
    oiio.attribute("openexr:core", request["core"])
    source = oiio.ImageInput.open(request["path"], _hints())
    oiio.attribute("openexr:core", 1)
    if source is None or not source.seek_subimage(request["part"], 0):
        raise RuntimeError(_error(oiio.geterror))
    spec, channels, kind = source.spec(), request["channels"], request["type"]
    kind = _NAMES.get(kind, kind)
    there = [c for c in channels if c is not None]
    first, last = min(there), max(there) + 1
    together = kind != "uint" and (None in channels or last - first <= 2 * len(channels))
    ranges = [(first, last)] if together else [(c, c + 1) for c in channels]
    picked = [None if c is None else c - first for c in channels]
    x0, x1 = request["columns"]
    y0, y1 = request["rows"]
    step = spec.tile_height or max(1, spec.get_int_attribute("oiio:RowsPerChunk", 1))
    row_bytes = 4 * spec.width * sum(b - a for a, b in ranges)
    step *= max(1, min(_CHUNK // row_bytes, y1 - y0) // step)
    for y in range(spec.y + (y0 - spec.y) // step * step, y1, step):
        end = min(y + step, spec.y + spec.height)
        blocks = [_block(source, spec, y, end, *range_, kind) for range_ in ranges]
        block = _chosen(blocks[0], picked) if together else np.concatenate(blocks, axis=2)
        block = block[max(y0 - y, 0) : y1 - y, x0 - spec.x : x1 - spec.x]
        yield np.ascontiguousarray(block, dtype=np.float32 if kind == "uint" else block.dtype)
    source.close()


def _chosen(block: np.ndarray, channels: list[int | None]) -> np.ndarray:
    """Those ``channels`` of a block; None for one that is as large as can be."""
    if channels == list(range(block.shape[2])):
        return block
    chosen = np.empty((*block.shape[:2], len(channels)), block.dtype)
    for place, channel in enumerate(channels):
        chosen[..., place] = np.iinfo(block.dtype).max if channel is None else block[..., channel]
    return chosen


def _block(
    source: oiio.ImageInput, spec: oiio.ImageSpec, y: int, end: int, first: int, last: int, kind: str
) -> np.ndarray:
    """Rows ``y`` to ``end`` of channels ``first`` to ``last`` (rows, columns, channels)."""
    if spec.tile_width:
        read = source.read_tiles(spec.x, spec.x + spec.width, y, end, spec.z, spec.z + 1, first, last, kind)
    else:
        read = source.read_scanlines(y, end, spec.z, first, last, kind)
    if read is None:
        raise RuntimeError(_error(source.geterror))
    return np.asarray(read).reshape(end - y, spec.width, last - first)


def _hints() -> oiio.ImageSpec:
    hints = oiio.ImageSpec()
    hints.attribute("oiio:UnassociatedAlpha", 1)  # colours as the file has them
    return hints


def _error(of: Any) -> str:
    try:
        return str(of())
    except UnicodeDecodeError:
        return "what its header says is no text"


def _limit_memory(size: int) -> None:
    """Let this process have ``size`` bytes more than it has now, where the system can count."""
    try:
        with open("/proc/self/statm") as file:
            used = int(file.read().split()[0]) * resource.getpagesize()
        _, most = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (used + size, most))
    except (OSError, ValueError):
        pass  # macOS


def _fill(descriptor: int, at: int, size: int, blocks: Any) -> None:
    """Write blocks of pixels one after the other into shared memory, from a byte on, so many bytes in all."""
    begin = at // mmap.ALLOCATIONGRANULARITY * mmap.ALLOCATIONGRANULARITY
    with mmap.mmap(descriptor, at + size - begin, offset=begin) as room:
        here, end = at - begin, at - begin + size
        for block in blocks:
            content = memoryview(block).cast("B")
            if here + len(content) > end:
                raise RuntimeError("there are more pixels than expected")
            room[here : here + len(content)] = content
            here += len(content)
    if here < end:
        raise RuntimeError(f"{end - here} of {size} bytes are missing")


def _send(to: Any, kind: bytes, content: bytes | memoryview) -> None:
    to.write(struct.pack("<cQ", kind, len(content)))
    at = memoryview(content)
    while len(at):
        at = at[to.write(at) :]


if __name__ == "__main__":
    main()
