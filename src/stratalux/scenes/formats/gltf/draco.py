"""Primitives that are compressed with Draco, decoded by DracoPy.

Source: Khronos Group, "KHR_draco_mesh_compression".
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ....errors import InputError
from ...model import Indices
from .accessors import component, normalised
from .container import Document, item


def is_compressed(document: Document, primitive: dict[str, Any]) -> bool:
    """Whether a primitive has compressed data alone, and not the plain data too."""
    plain = "bufferView" in item(document.list("accessors"), primitive["attributes"]["POSITION"])
    return "KHR_draco_mesh_compression" in primitive.get("extensions", {}) and not plain


class Decoded:
    """What a compressed primitive holds: its triangles (T, 3), and its attributes by the names they have in glTF."""

    def __init__(self, document: Document, primitive: dict[str, Any]) -> None:
        try:
            import DracoPy
        except ImportError:
            raise InputError(
                f"{document.path}: compressed with Draco, which needs another package: pip install 'stratalux[gltf]'"
            ) from None
        extension = primitive["extensions"]["KHR_draco_mesh_compression"]
        data, _ = document.view(extension["bufferView"])
        try:
            mesh = DracoPy.decode(bytes(data))
        except Exception as error:  # of a class of its own, or of C++
            raise InputError(f"{document.path}: its Draco data cannot be decoded ({error}); export it again") from None
        self.triangles: Indices = np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)
        self._document, self._primitive = document, primitive
        self._by_id = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
        self._ids: dict[str, int] = extension["attributes"]

    def attribute(self, name: str) -> npt.NDArray[Any] | None:
        """The values (V, n) of an attribute, or None if it is not among the compressed ones."""
        if name not in self._ids:
            return None
        if self._ids[name] not in self._by_id:
            raise InputError(f"{self._document.path}: its Draco data hold no {name}; export it again")
        accessor = item(self._document.list("accessors"), self._primitive["attributes"][name])
        values = np.asarray(self._by_id[self._ids[name]])
        dtype = component(accessor)
        if dtype.kind in "iu" and values.dtype.kind in "iu":
            values = values.astype(dtype)  # DracoPy widens shorter ones
        return normalised(values.reshape(len(values), -1), bool(accessor.get("normalized")))
