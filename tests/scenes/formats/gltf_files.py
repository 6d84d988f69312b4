"""glTF files made by hand, one object at a time."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import ArrayLike

TYPES = {(): "SCALAR", (2,): "VEC2", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}
COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}


class Gltf:
    """A document that grows: every method that adds an object returns its index."""

    def __init__(self, **more: Any) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, **more}
        self.binary = b""

    def add(self, kind: str, **properties: Any) -> int:
        self.json.setdefault(kind, []).append(properties)
        return len(self.json[kind]) - 1

    def require(self, *names: str) -> None:
        self.json["extensionsUsed"] = self.json["extensionsRequired"] = list(names)

    def view(self, data: bytes, **more: Any) -> int:
        self.binary += b"\0" * (-len(self.binary) % 4)
        start = len(self.binary)
        self.binary += data
        return self.add("bufferViews", buffer=0, byteOffset=start, byteLength=len(data), **more)

    def accessor(self, values: ArrayLike, dtype: str = "f4", **more: Any) -> int:
        """An accessor with a view of its own, in which elements start at multiples of four bytes."""
        array = np.asarray(values, dtype="<" + dtype)
        size = int(np.prod(array.shape[1:])) * array.itemsize
        stride = size + -size % 4
        rows = np.zeros((len(array), stride), np.uint8)
        rows[:, :size] = np.ascontiguousarray(array).view(np.uint8).reshape(len(array), -1)
        apart = {"byteStride": stride} if array.ndim > 1 and stride != size else {}
        if array.ndim == 1:
            rows = np.ascontiguousarray(array).view(np.uint8)
        return self.add(
            "accessors",
            bufferView=self.view(rows.tobytes(), **apart),
            componentType=COMPONENTS[dtype],
            type=TYPES[array.shape[1:]],
            count=len(array),
            **more,
        )

    def primitive(self, positions: ArrayLike, indices: ArrayLike | None = None, **more: Any) -> dict[str, Any]:
        attributes = {"POSITION": self.accessor(positions)} | more.pop("attributes", {})
        found = {"attributes": attributes, **more}
        return found if indices is None else found | {"indices": self.accessor(indices, "u4")}

    def show(self, *primitives: dict[str, Any], mesh: dict[str, Any] | None = None, **node: Any) -> int:
        """A node with a mesh of these primitives."""
        return self.add("nodes", mesh=self.add("meshes", primitives=list(primitives), **(mesh or {})), **node)

    def texture(self, data: bytes = b"an image", sampler: dict[str, Any] | None = None, **more: Any) -> int:
        """A texture whose image is in a view; `more` of the texture itself."""
        if "source" not in more and "extensions" not in more:
            more["source"] = self.image(data)
        if sampler is not None:
            more["sampler"] = self.add("samplers", **sampler)
        return self.add("textures", **more)

    def image(self, data: bytes, **more: Any) -> int:
        return self.add("images", bufferView=self.view(data), mimeType="image/png", **more)

    def show_material(self, **properties: Any) -> int:
        """A triangle of a material."""
        material = self.add("materials", **properties)
        return self.show(self.primitive([[0, 0, 0], [1, 0, 0], [0, 1, 0]], material=material))

    def write(self, path: Path, **how: str) -> Path:
        """As .glb or .gltf by the suffix; `how="name.bin"` or `how="data"` tell where a .gltf has its buffer."""
        document = dict(self.json)
        if self.binary and "buffers" not in document:
            document["buffers"] = [{"byteLength": len(self.binary)}]
        if path.suffix == ".gltf":
            place = how.get("how", "data")
            if place == "data":
                uri = "data:application/octet-stream;base64," + base64.b64encode(self.binary).decode()
            elif place == "percent":
                uri = "data:," + quote(self.binary)
            else:
                uri = quote(place)
                (path.parent / place).write_bytes(self.binary)
            document["buffers"][0]["uri"] = uri
            path.write_text(json.dumps(document), encoding=how.get("encoding", "utf-8"))
            return path
        text = json.dumps(document).encode()
        text += how.get("padding", " ").encode() * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
        return path


def ktx2(texels: ArrayLike) -> bytes:
    """A KTX 2 file of blocks of 4x4 texels (rows, columns, 4), each of one colour, in UASTC.

    Sources: Khronos Group, "KTX File Format Specification", version 2, and "Data Format Specification", section 25:
    mode 8 of a block is 0x17 in five bits, and then eight bits for each of red, green, blue and alpha.
    """
    blocks = np.asarray(texels)
    rows, columns, _ = blocks.shape
    words = [0x17 | r << 5 | g << 13 | b << 21 | a << 29 for r, g, b, a in blocks.reshape(-1, 4).tolist()]
    body = b"".join(word.to_bytes(16, "little") for word in words)
    description = struct.pack("<IHH4B4B8B", 0, 2, 40, 166, 1, 2, 0, 3, 3, 0, 0, 16, *[0] * 7)
    description += struct.pack("<HBB4BII", 0, 127, 3, 0, 0, 0, 0, 0, 0xFFFFFFFF)
    description = struct.pack("<I", 4 + len(description)) + description
    at = 80 + 24
    start = at + len(description) + -(at + len(description)) % 16
    head = b"\xabKTX 20\xbb\r\n\x1a\n" + struct.pack("<9I", 0, 1, 4 * columns, 4 * rows, 0, 0, 1, 1, 0)
    head += struct.pack("<4I2Q", at, len(description), 0, 0, 0, 0) + struct.pack("<3Q", start, len(body), len(body))
    return (head + description).ljust(start, b"\0") + body
