"""PLY: the elements of a file, as text or in binary of either byte order.

Source: G. Turk, "The PLY Polygon File Format" (1994); the type names with numbers are those of files today.
"""

from __future__ import annotations

import re
import struct
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ....errors import InputError, SceneWarning
from ...model import Indices
from ..text import numbers, plain_text, word

# The letters of the types in `struct` and in NumPy alike.
_TYPES = {
    "char": "b", "int8": "b", "uchar": "B", "uint8": "B", "short": "h", "int16": "h", "ushort": "H", "uint16": "H",
    "int": "i", "int32": "i", "uint": "I", "uint32": "I", "long": "q", "int64": "q", "ulong": "Q", "uint64": "Q",
    "half": "e", "float16": "e", "float": "f", "float32": "f", "double": "d", "float64": "d",
}  # fmt: skip

_TEXT = "="
_ORDERS = {"ascii": _TEXT, "binary_little_endian": "<", "binary_big_endian": ">"}


class List(NamedTuple):
    """A list property of all rows of an element: the values one after the other, and how many each row has."""

    values: Any
    counts: Indices


@dataclass
class _Property:
    """A property of an element: its name, the type of its values, and for a list that of the number of its values.

    `kind` is the type by its letter, and `values` how the data have it.
    """

    name: str
    kind: str
    count: str | None = None
    values: str = ""


@dataclass
class _Element:
    """An element as the header declares it."""

    name: str
    rows: int
    properties: list[_Property] = field(default_factory=list)


class Tables(NamedTuple):
    """What a file holds: `values[element][property]`, the types of these as the header has them, and its comments."""

    values: dict[str, dict[str, Any]]
    types: dict[str, dict[str, str]]
    comments: list[str]


def read_tables(path: Path) -> Tables:
    """All elements of a file. Its lists are :class:`List`, the others arrays."""
    data = path.read_bytes()
    order, elements, comments, at = _header(path, data)
    if order == _TEXT:
        data, at = _text_body(data[at:]), 0
    tables = Tables({}, {each.name: {p.name: p.kind for p in each.properties} for each in elements}, comments)
    for element in elements:
        tables.values[element.name], at = _table(path, element, data, at)
    rest = len(data[at:].strip(b"\0 \t\r\n"))
    if rest and order != _TEXT:
        warnings.warn(f"{path}: {rest} bytes behind the last element are ignored", SceneWarning, stacklevel=3)
    return tables


def _header(path: Path, data: bytes) -> tuple[str, list[_Element], list[str], int]:
    """The byte order of the data, the elements in their order, the comments, and where the data start."""
    start = re.match(rb"(?:\xef\xbb\xbf)?ply[ \t]*(\r\n|\n|\r)", data)
    # A binary file may go on with any byte, a newline too: so all lines of the header end as the first one does.
    end = start and re.search(rb"[\r\n]end_header[ \t]*" + start[1], data)
    if not start or not end:
        raise InputError(f"{path}: it has no header of a PLY file; export it again")
    order: str | None = None
    elements: list[_Element] = []
    comments: list[str] = []
    for line in map(word, plain_text(data[: end.start()]).split(b"\n")):
        match line.split():
            case ["format", name, *_]:
                order = _ORDERS.get(name)
            case ["element", name, rows, *_]:
                elements.append(_Element(name, int(rows)))
            case ["property", "list", count, values, name, *_]:
                elements[-1].properties.append(_Property(name, _TYPES[values], _TYPES[count]))
            case ["property", values, name, *_]:
                elements[-1].properties.append(_Property(name, _TYPES[values]))
            case ["comment", *_]:
                comments.append(line.strip().removeprefix("comment").strip())
    if order is None:
        raise InputError(f"{path}: its format is none of {', '.join(_ORDERS)}; export it as one of them")
    for p in (p for element in elements for p in element.properties):
        # The numbers of a text are all read in double precision.
        p.values = order + ("d" if order == _TEXT else p.kind)
        p.count = p.count and order + ("d" if order == _TEXT else p.count)
    return order, elements, comments, end.end()


def _text_body(text: bytes) -> bytes:
    """The numbers of a text as a binary file would have them, up to the first line with something else."""
    text = plain_text(text)
    foreign = re.search(rb"[^0-9+\-.eEnNaAiIfF\s]", text)
    return bytes(numbers(text if foreign is None else text[: text.rfind(b"\n", 0, foreign.start()) + 1]).tobytes())


def _table(path: Path, element: _Element, data: bytes, at: int) -> tuple[dict[str, Any], int]:
    """The properties of an element whose first row starts at byte `at`, and where the next element starts."""
    properties = element.properties
    if not element.rows or not properties:
        return {}, at
    # Most files have as long lists in every row as in the first.
    lengths = _lengths(properties, data, at)
    fields: list[tuple[Any, ...]] = []
    for column, (p, length) in enumerate(zip(properties, lengths, strict=True)):
        fields += [(f"count {column}", p.count)] * bool(p.count)
        fields += [(f"{column}", p.values, (length,) if p.count else ())]
    row = np.dtype(fields)
    whole = (len(data) - at) // row.itemsize
    lists = [column for column, p in enumerate(properties) if p.count]
    if whole < element.rows and not lists:
        _cut_short(path, element, whole)
    if whole >= element.rows:
        rows = np.frombuffer(data, row, element.rows, at)
        if all(np.all(rows[f"count {column}"] == lengths[column]) for column in lists):
            table: dict[str, Any] = {p.name: rows[f"{column}"] for column, p in enumerate(properties)}
            for column in lists:
                counts = np.full(element.rows, lengths[column])
                table[properties[column].name] = List(rows[f"{column}"].reshape(-1), counts)
            return table, at + element.rows * row.itemsize
    return _ragged(path, element, data, at)


def _lengths(properties: list[_Property], data: bytes, at: int) -> list[int]:
    """How many values each property of the row at `at` has; 0 for lists that begin behind the end of the data."""
    lengths = []
    for p in properties:
        length = 1
        if p.count:
            length = int(struct.unpack_from(p.count, data, at)[0]) if at + struct.calcsize(p.count) <= len(data) else 0
            at += struct.calcsize(p.count)
        if length < 0:
            raise ValueError(f"a list of {length} values")
        lengths.append(length)
        at += length * struct.calcsize(p.values)
    return lengths


def _ragged(path: Path, element: _Element, data: bytes, at: int) -> tuple[dict[str, Any], int]:
    """What `_table` gives, for lists of different lengths: the places of all values are found row by row."""
    columns = [
        (struct.Struct(p.count) if p.count else None, struct.calcsize(p.values), [], []) for p in element.properties
    ]  # type: list[tuple[struct.Struct | None, int, list[int], list[int]]]
    end = len(data)
    for row in range(element.rows):
        for count, size, places, lengths in columns:
            length = 1
            if count:
                if at + count.size > end:
                    _cut_short(path, element, row)
                length = int(count.unpack_from(data, at)[0])
                at += count.size
            places.append(at)
            lengths.append(length)
            at += length * size
            if length < 0:
                raise ValueError(f"a list of {length} values")
        if at > end:
            _cut_short(path, element, row)
    ragged: dict[str, Any] = {}
    raw = np.frombuffer(data, np.uint8)
    for p, (_, size, places, lengths) in zip(element.properties, columns, strict=True):
        counts = np.array(lengths, dtype=np.int64)
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        first = np.repeat(np.array(places, dtype=np.int64), counts) + within * size
        values = raw[first[:, None] + np.arange(size)].reshape(-1).view(p.values)
        ragged[p.name] = List(values, counts) if p.count else values
    return ragged, at


def _cut_short(path: Path, element: _Element, rows: int) -> None:
    what = {"face": "faces", "vertex": "vertices"}.get(element.name, f"rows of '{element.name}'")
    raise InputError(f"{path}: cut short at {rows} of the {element.rows} {what} it declares; copy it again")
