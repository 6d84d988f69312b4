"""What the URIs of a document name: files in its own folder, or bytes that stand in the URI itself."""

from __future__ import annotations

import base64
from pathlib import Path
from urllib.parse import unquote, unquote_to_bytes

from ....errors import InputError
from ...sources import source
from ..beside import is_below


def is_data(uri: str) -> bool:
    """Whether the bytes are in the URI itself."""
    return uri.startswith("data:")


def data_of(uri: str) -> bytes:
    """The bytes that are in a URI. Raises ValueError where they are damaged."""
    head, _, body = uri[5:].partition(",")
    return base64.b64decode(unquote(body)) if head.endswith(";base64") else unquote_to_bytes(body)


def file_of(document: Path, uri: str) -> Path:
    """The file that a URI names, which is in the folder of the `document`, or in one below.

    Raises :class:`InputError` for one that is not there, that is elsewhere, or that only the network has: a document
    from anywhere is not to read what it likes.
    """
    if "://" in uri:
        raise InputError(f"{document}: refers to {uri[:60]!r}; download it, and refer to the file")
    folder = document.parent
    for name in dict.fromkeys((unquote(uri), uri)):
        file = folder / name
        if not file.is_file():
            continue
        if Path(name).is_absolute() or not is_below(file, folder):
            raise InputError(f"{document}: refers to {name!r}, outside of its own folder; copy it there")
        return source(file)
    raise InputError(f"{document}: the file {unquote(uri)!r} that it refers to is not there; copy it too")
