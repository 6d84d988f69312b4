"""Materials that differ in numbers and images alone, and so can be one BSDF, whose textures are :mod:`.varied`."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import fields, replace
from typing import Any

import mitsuba as mi
import numpy as np

from .album import Album
from .model import Material, Picture, Texture, Value
from .varied import How, Row, Tables, varied

_VARIED = ("base_colour", "metallic", "roughness", "alpha", "normal", "clearcoat")
"""What may differ, of the fields of a material."""
_ELSEWHERE = ("name", "emission")
"""What a BSDF does not know of."""
_STRAIGHT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def structure(material: Material, sets: Mapping[int, str | None], colours: bool) -> Hashable | None:
    """Equal for materials that can be one BSDF on meshes with these `sets` and `colours`; None for one of its own."""
    if material.unlit or material.bump is not None or material.specular_glossiness is not None or not mi.is_rgb:
        return None
    if any(max(value.factor) > 0 or max(value.offset) > 0 for value in (material.transmission, material.anisotropy)):
        return None
    parts: list[Hashable] = [tuple(sorted(sets.items())), colours]
    for each in fields(material):
        value = getattr(material, each.name)
        if each.name in _ELSEWHERE:
            continue
        if each.name not in _VARIED or value is None:
            parts.append(value)
        elif (texture := _texture(value)) is None:
            parts.append(_constant(each.name, value))
        elif texture.uv_set not in sets:
            return None
        else:
            parts.append((value.channels, texture.wrap, texture.nearest, sets[texture.uv_set]))
    return tuple(parts)


def pictures(materials: Iterable[Material]) -> list[Picture]:
    """The images that may differ between materials, each once."""
    found: dict[int, Picture] = {}
    for material in materials:
        for name in _VARIED:
            value = getattr(material, name)
            texture = None if value is None else _texture(value)
            if texture is not None:
                found[id(texture.picture)] = texture.picture
    return list(found.values())


def has_images(material: Material) -> bool:
    """Whether any of what may differ is an image."""
    return bool(pictures([material]))


class Members:
    """The materials that are one BSDF, on meshes with these `sets`; they have the numbers from `first` on."""

    def __init__(
        self, materials: Iterable[Material], sets: Mapping[int, str | None], album: Album, first: int = 0
    ) -> None:
        self._materials, self._sets, self._album, self._first = list(materials), sets, album, first
        self._numbers = {id(material): first + place for place, material in enumerate(self._materials)}
        self._made: list[tuple[Any, list[Row]]] = []

    def __contains__(self, material: object) -> bool:
        return id(material) in self._numbers

    def __len__(self) -> int:
        return len(self._materials)

    def number(self, material: Material) -> int:
        """That of one of the materials."""
        return self._numbers[id(material)]

    def texture(self, name: str, change: Callable[[Value], Value] = lambda value: value, clipped: bool = True) -> Any:
        """The texture of a value that differs; None where it is the same for all.

        `change`: what is made of the value first. `clipped`: to [0, 1].
        """
        values = [getattr(material, name) for material in self._materials]
        first = _texture(values[0])
        if first is None and len(set(values)) == 1:
            return None
        rows = [self._row(change(value)) for value in values]
        how = How(
            image=first is not None,
            channels="rgb" if name in ("base_colour", "normal") else values[0].channels if first else "r",
            wrap=first.wrap if first else ("repeat", "repeat"),
            nearest=first is not None and first.nearest,
            attribute=self._sets[first.uv_set] if first else None,
            moved=any(row.transform != _STRAIGHT for row in rows),
            curved=any(row.curved for row in rows),
            scaled=any(set(row.factor) != {1.0} or set(row.offset) != {0.0} for row in rows),
            clipped=clipped,
        )
        made = varied(how)
        self._made.append((made, rows))
        return made

    def fill(self, numbers: mi.UInt32, count: int, tables: Tables) -> None:
        """Give all textures their values; `numbers`: those of materials, by the identity of shapes; `count` of them.

        Whatever the number is, there is a row: who looks up a texture on the mesh of another gets some other's.
        """
        for made, rows in self._made:
            before, after = [rows[0]] * self._first, [rows[0]] * (count - self._first - len(rows))
            made.fill([*before, *rows, *after], self._album, numbers, tables)

    def _row(self, value: Value) -> Row:
        texture = _texture(value)
        if texture is None:
            return Row(None, False, _STRAIGHT, tuple(np.add(value.factor, value.offset)), (0.0,))
        place = self._album.place(texture.picture)
        curved = value.channels != "a" and (
            texture.curve == "srgb" or (texture.curve == "auto" and place is not None and place.srgb)
        )
        transform = tuple(x for row in texture.transform for x in row)
        return Row(place, curved, transform, value.factor, value.offset)


def bent(value: Value, mirrored: bool, side: int) -> Value:
    """The colours of a map of normals as :class:`.Looks` turns them, as factors and offsets of its texels."""
    x, y = (float(factor) * side for factor in np.broadcast_to(value.factor[:2], 2))
    y = -y if mirrored else y
    # 2 c' - 1 = s (2 c - 1) for c' = s c + (1 - s) / 2.
    return replace(value, factor=(x, y, 1.0), offset=((1 - x) / 2, (1 - y) / 2, 0.0))


def _texture(value: Value) -> Texture | None:
    """The texture of a value, if it makes a difference."""
    return value.texture if value.texture is not None and any(value.factor) else None


def _constant(name: str, value: Value) -> Hashable:
    """What tells apart numbers that are the same all over a surface."""
    numbers = np.clip(np.add(value.factor, value.offset), 0, 1)
    known = name == "alpha" or np.all(numbers == 0) or np.all(numbers == 1)
    return tuple(numbers.tolist()) if known else None
