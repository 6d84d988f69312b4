"""The container of glTF 2.0: a JSON document, and the bytes that its buffers name.

The document is kept as `json` gives it. pygltflib would make classes of it, at a millisecond for each node and with
eight more packages to install, but it decodes no accessor, and does not notice a file that is cut short.

Source: Khronos Group, "glTF 2.0 Specification", sections 3.6 and 4.4.
"""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

from ....errors import InputError

_SHAPES = ("KHR_mesh_quantization", "EXT_mesh_gpu_instancing", "KHR_draco_mesh_compression", "KHR_node_visibility")
"""Extensions that say where the surfaces are, and are read."""

_LOOKS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "EXT_lights_", "KHR_xmp")
"""How the names of extensions begin that change no surface."""


class Document:
    """A glTF file: `json`, its document, and the bytes of its buffers. Raises InputError for what is none."""

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
        self._buffers: dict[int, bytes] = {}

    def list(self, name: str) -> list[dict[str, Any]]:
        """The objects of one kind, such as 'nodes'; empty where the document has none."""
        found: list[dict[str, Any]] = self.json.get(name, [])
        return found

    def view(self, index: int) -> tuple[bytes, int]:
        """The bytes of a buffer view, and its stride: 0 where elements follow each other closely."""
        view = item(self.list("bufferViews"), index)
        if "EXT_meshopt_compression" in view.get("extensions", {}):
            self._check_fallback(view)
        start, length = view.get("byteOffset", 0), view["byteLength"]
        buffer = self._buffer(view["buffer"])
        if start < 0 or length < 0 or start + length > len(buffer):
            raise InputError(f"{self.path}: buffer view {index} reaches beyond its buffer; copy or export it again")
        return buffer[start : start + length], view.get("byteStride", 0)

    def _check_version(self) -> None:
        version = str(self.json.get("asset", {}).get("version", "without a version"))
        if not version.startswith("2."):
            raise InputError(f"{self.path}: glTF {version!r} is not supported; export it as glTF 2.0")
        for name in self.json.get("extensionsRequired", []):
            if name in ("EXT_meshopt_compression", "KHR_meshopt_compression"):
                self._refuse(f"compressed with {name}, which is not supported")
            if name not in _SHAPES and not name.startswith(_LOOKS):
                self._refuse(f"requires the extension {name!r}, which is not supported")

    def _refuse(self, why: str) -> None:
        raise InputError(f"{self.path}: {why}; export it without")

    def _check_fallback(self, view: dict[str, Any]) -> None:
        """A file that does not require the compression holds the plain data too."""
        buffer = item(self.list("buffers"), view["buffer"])
        if buffer.get("extensions", {}).get("EXT_meshopt_compression", {}).get("fallback") and "uri" not in buffer:
            self._refuse("compressed with EXT_meshopt_compression, which is not supported")

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            buffer = item(self.list("buffers"), index)
            uri = buffer.get("uri")
            if uri is not None:
                data = self.resource(uri)
            elif self._binary is not None and index == 0:
                data = self._binary
            else:
                raise InputError(f"{self.path}: buffer {index} has no data; export it again")
            if len(data) < buffer["byteLength"]:
                raise InputError(
                    f"{self.path}: buffer {index} has {len(data)} of its {buffer['byteLength']} bytes; copy it again"
                )
            self._buffers[index] = data
        return self._buffers[index]

    def resource(self, uri: str) -> bytes:
        """The bytes that a URI names: those of a file beside the document, or those in the URI itself."""
        if uri.startswith("data:"):
            head, _, body = uri[5:].partition(",")
            return base64.b64decode(unquote(body)) if head.endswith(";base64") else unquote_to_bytes(body)
        if "://" in uri:
            raise InputError(f"{self.path}: refers to {uri[:60]!r}; download it, and refer to the file")
        for name in dict.fromkeys((unquote(uri), uri)):
            file = self.path.parent / name
            if file.is_file():
                return file.read_bytes()
        raise InputError(f"{self.path}: the file {unquote(uri)!r} that it refers to is not there; copy it too")


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
