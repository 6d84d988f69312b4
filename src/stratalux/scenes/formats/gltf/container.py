"""The container of glTF 2.0: a JSON document, and the bytes that its buffers name.

The document is kept as `json` gives it. pygltflib would make classes of it, at a millisecond for each node and with
eight more packages to install, but it decodes no accessor, and does not notice a file that is cut short.

Source: Khronos Group, "glTF 2.0 Specification", sections 3.6 and 4.4.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

from ....errors import InputError
from . import extensions, meshopt
from .extensions import LeftOut
from .files import data_of, file_of, is_data


class Document:
    """A glTF file: `json`, its document, and the bytes of its buffers. Raises InputError for what is none.

    `left_out`: what is found in it, and not shown.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        data = path.read_bytes()
        text, self._binary = _chunks(path, data) if data.startswith(b"glTF") else (data, None)
        try:
            self.json: dict[str, Any] = json.loads(text.lstrip(b"\xef\xbb\xbf"))
        except (ValueError, RecursionError) as error:
            raise InputError(f"{path}: its JSON cannot be read ({error}); export it again") from None
        if not isinstance(self.json, dict):
            raise InputError(f"{path}: its JSON is no object; export it again")
        self._check_version()
        extensions.check_required(path, self.json.get("extensionsRequired", []))
        self.left_out = LeftOut()
        self._buffers: dict[int, memoryview] = {}
        self._unpacked: dict[int, memoryview] = {}

    def list(self, name: str) -> list[dict[str, Any]]:
        """The objects of one kind, such as 'nodes'; empty where the document has none."""
        found: list[dict[str, Any]] = self.json.get(name, [])
        return found

    def view(self, index: int) -> tuple[memoryview, int]:
        """The bytes of a buffer view, and its stride: 0 where elements follow each other closely."""
        view = item(self.list("bufferViews"), index)
        packed = meshopt.extension(view)
        if packed is None or self._is_there(view["buffer"]):
            return self._slice(view, f"buffer view {index}"), view.get("byteStride", 0)
        if index not in self._unpacked:
            data = self._slice(packed, f"compressed buffer view {index}")
            self._unpacked[index] = meshopt.decoded(self.path, data, packed)
        return self._unpacked[index], view.get("byteStride", 0)

    def _is_there(self, index: int) -> bool:
        """Whether the file has the plain data too, that of a buffer to fall back to."""
        buffer = item(self.list("buffers"), index)
        return "uri" in buffer or (index == 0 and self._binary is not None and not meshopt.is_fallback(buffer))

    def _slice(self, view: dict[str, Any], what: str) -> memoryview:
        start, length = view.get("byteOffset", 0), view["byteLength"]
        buffer = self._buffer(view["buffer"])
        if start < 0 or length < 0 or start + length > len(buffer):
            raise InputError(f"{self.path}: {what} reaches beyond its buffer; copy or export it again")
        return buffer[start : start + length]

    def _check_version(self) -> None:
        version = str(self.json.get("asset", {}).get("version", "without a version"))
        if not version.startswith("2."):
            raise InputError(f"{self.path}: glTF {version!r} is not supported; export it as glTF 2.0")

    def _buffer(self, index: int) -> memoryview:
        if index not in self._buffers:
            buffer = item(self.list("buffers"), index)
            uri = buffer.get("uri")
            if uri is not None:
                data = data_of(uri) if is_data(uri) else file_of(self.path, uri).read_bytes()
            elif self._binary is not None and index == 0:
                data = self._binary
            else:
                raise InputError(f"{self.path}: buffer {index} has no data; export it again")
            if len(data) < buffer["byteLength"]:
                raise InputError(
                    f"{self.path}: buffer {index} has {len(data)} of its {buffer['byteLength']} bytes; copy it again"
                )
            self._buffers[index] = memoryview(data)
        return self._buffers[index]


def item(objects: list[Any], index: int) -> Any:
    """One of several objects of the document. Raises IndexError for a negative index too, which counts from no end."""
    if not 0 <= index < len(objects):
        raise IndexError(f"there is no object {index} among {len(objects)}")
    return objects[index]


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and the binary chunk of a GLB file."""
    if len(data) < 20:
        raise InputError(f"{path}: cut short at {len(data)} bytes; copy it again")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise InputError(f"{path}: binary glTF of version {version} is not supported; export it as glTF 2.0")
    if len(data) < length:
        raise InputError(f"{path}: cut short at {len(data)} of its {length} bytes; copy it again")
    found: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, at)
        if at + 8 + size > len(data):
            raise InputError(f"{path}: cut short within one of its chunks; copy it again")
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if b"JSON" not in found:
        raise InputError(f"{path}: it has no JSON; export it again")
    return found[b"JSON"].rstrip(b"\0"), found.get(b"BIN\0")
