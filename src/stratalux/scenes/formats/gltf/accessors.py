"""The arrays of glTF: typed, strided, normalised or sparse views of its buffers.

Source: Khronos Group, "glTF 2.0 Specification", sections 3.6.2 and 3.11.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .container import Document, item

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}

_MOST_ZEROS = 1 << 24
"""Elements of an accessor without data: it takes no bytes in the file, and a damaged one could ask for any memory."""


def array(document: Document, index: int, *sizes: int) -> npt.NDArray[Any]:
    """Accessor `index` with one of the `sizes` of numbers in each element, (N, size), as the numbers that it means.

    Integers that are marked as normalised are float64 in [-1, 1]; others keep their type. Sparse ones are filled in.
    """
    accessor = item(document.list("accessors"), index)
    dtype = component(accessor)
    count = int(accessor["count"])
    size = _SIZES[accessor["type"]]
    if size not in sizes:
        raise ValueError(f"accessor {index} is {accessor['type']}, not {' or '.join(map(str, sizes))} numbers")
    if "bufferView" in accessor:
        values = _view(document, accessor["bufferView"], accessor.get("byteOffset", 0), dtype, count, size)
    else:
        if not 0 <= count <= _MOST_ZEROS:
            raise ValueError(f"accessor {index} has {count} elements, and no data")
        values = np.zeros((count, size), dtype)
    if "sparse" in accessor:
        values = _filled_in(document, accessor["sparse"], values, dtype)
    return normalised(values, bool(accessor.get("normalized")))


def component(accessor: dict[str, Any]) -> np.dtype[Any]:
    """The type of the numbers of an accessor."""
    return np.dtype(_COMPONENTS[accessor["componentType"]])


def normalised(values: npt.NDArray[Any], wanted: bool) -> npt.NDArray[Any]:
    """Integers as the fractions of their largest value that they stand for, if `wanted`."""
    if not wanted or values.dtype.kind not in "iu":
        return values
    fractions: npt.NDArray[Any] = np.maximum(values / np.iinfo(values.dtype).max, -1.0)
    return fractions


def whole(values: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Indices, which have to be whole numbers."""
    if values.dtype.kind not in "iu":
        raise ValueError("indices are no whole numbers")
    return values.astype(np.int64)


def _view(document: Document, view: int, offset: int, dtype: np.dtype[Any], count: int, size: int) -> npt.NDArray[Any]:
    data, stride = document.view(view)
    stride = stride or size * dtype.itemsize
    if count < 1:
        return np.empty((0, size), dtype)
    if offset < 0 or stride < 0 or offset + (count - 1) * stride + size * dtype.itemsize > len(data):
        raise ValueError(f"{count} elements reach beyond buffer view {view}")
    return np.ndarray((count, size), dtype, data, offset, (stride, dtype.itemsize))


def _filled_in(
    document: Document, sparse: dict[str, Any], values: npt.NDArray[Any], dtype: np.dtype[Any]
) -> npt.NDArray[Any]:
    """A copy of the values with those of the sparse elements put in their places."""
    count, at, new = int(sparse["count"]), sparse["indices"], sparse["values"]
    places = _view(
        document, at["bufferView"], at.get("byteOffset", 0), np.dtype(_COMPONENTS[at["componentType"]]), count, 1
    )
    filled = np.array(values)
    filled[places[:, 0]] = _view(document, new["bufferView"], new.get("byteOffset", 0), dtype, count, values.shape[1])
    return filled
