"""Buffer views that are compressed with meshoptimizer, decoded by the package meshopt.

Sources: Khronos Group, "EXT_meshopt_compression" and "KHR_meshopt_compression".
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from ....errors import InputError

_NAMES = ("EXT_meshopt_compression", "KHR_meshopt_compression")

_MOST_COMPRESSED = 1024
"""Bytes that one byte can stand for: two bits say that a byte of each of 256 elements, the most in a block, is zero."""


def extension(view: dict[str, Any]) -> dict[str, Any] | None:
    """What a buffer view says of its compressed data, None for a plain one."""
    extensions = view.get("extensions", {})
    found: dict[str, Any] | None = next((extensions[name] for name in _NAMES if name in extensions), None)
    return found


def is_fallback(buffer: dict[str, Any]) -> bool:
    """Whether a buffer is marked as one that only holds a place for decoded data."""
    extensions = buffer.get("extensions", {})
    return any(extensions.get(name, {}).get("fallback", False) for name in _NAMES)


def decoded(path: Path, data: memoryview, view: dict[str, Any]) -> memoryview:
    """The plain bytes of a compressed buffer view. Raises :class:`InputError` for damaged ones."""
    try:
        import meshopt
    except ImportError:
        newer = " and Python 3.11 or later" if sys.version_info < (3, 11) else ""
        raise InputError(
            f"{path}: compressed with meshoptimizer, which needs another package{newer}: pip install 'stratalux[gltf]'"
        ) from None
    count, size = int(view["count"]), int(view["byteStride"])
    if count < 1:
        return memoryview(b"")
    if count * size > _MOST_COMPRESSED * len(data):
        raise InputError(f"{path}: {len(data)} compressed bytes cannot be {count} times {size}; export it again")
    try:
        rows = meshopt.decode_gltf_buffer(bytes(data), count, size, view["mode"], view.get("filter", "NONE"))
    except Exception as error:  # of a class of its own, or of C++
        reason = " ".join(str(error).split())[:80]
        raise InputError(f"{path}: its meshopt data cannot be decoded ({reason}); export it again") from None
    return memoryview(rows.tobytes())
