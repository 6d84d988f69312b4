"""What a scene is, as a hash, and where two settings differ."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

_PROVISIONAL = re.compile(r"\bsampler = \w+\[[^\]]*\],?|\b(?:filename|name|id) = \"[^\"]*\",?|0x[0-9a-fA-F]+")
"""Parts of a scene's description that do not change what it looks like: samplers, names, addresses."""

_ADDRESS = re.compile(r"\bobject_\d+")
"""What Mitsuba calls an object that has no name."""


class Digest(Protocol):
    """A hash that is fed, as :mod:`hashlib` has them."""

    def update(self, data: bytes | memoryview, /) -> None: ...


def add_parameters(digest: Digest, scene: mi.Scene, wanted: Callable[[str], bool] = lambda name: True) -> None:
    """Feed ``digest`` with the parameters of a loaded scene whose names, as Mitsuba has them, are ``wanted``: meshes,
    textures, the map, the camera, the film's size."""
    parameters = mi.traverse(scene)
    names = _lasting(parameters.keys())
    for name in sorted(name for name, here in names.items() if wanted(here)):
        head, content = _bytes(parameters[names[name]])
        digest.update(f"\n{name} {len(head) + len(content)} ".encode() + head)
        digest.update(content)


def add_structure(digest: Digest, scene: mi.Scene) -> None:
    """Feed ``digest`` with what is no parameter: kinds of shapes and lights, choices of materials, films, filters."""
    for thing in (*scene.shapes(), *scene.emitters(), *scene.sensors()):
        digest.update(f"\n{thing.class_name()}".encode())
    materials = (shape.bsdf() for shape in scene.shapes())
    films = (sensor.film() for sensor in scene.sensors())
    digest.update(structure(*filter(None, materials), *films).encode())


def structure(*things: mi.Object) -> str:
    """Of things in a scene, as Mitsuba prints it, without names of files and samplers."""
    return _PROVISIONAL.sub("", "".join(map(str, things)))


def _lasting(names: Iterable[str]) -> dict[str, str]:
    """The ``names`` of parameters, in their order, by what they are in every process: Mitsuba calls an object that has
    no name of its own by its address."""
    numbers: dict[str, int] = {}

    def number(found: re.Match[str]) -> str:
        return f"object_{numbers.setdefault(found[0], len(numbers))}"

    return {_ADDRESS.sub(number, name): name for name in names}


def _bytes(value: Any) -> tuple[bytes, bytes | memoryview]:
    """What a parameter of any type is, Dr.Jit's arrays, transforms, and plain numbers, and its content: not a copy."""
    if hasattr(type(value), "matrix"):  # of the value itself, it would be a swizzle of a vector's components
        value = value.matrix
    if not hasattr(value, "numpy"):
        return b"", repr(value).encode()
    array = np.ascontiguousarray(dr.detach(value).numpy())
    return f"{array.dtype}{array.shape}".encode(), array.reshape(-1).view(np.uint8).data


def differences(one: Any, other: Any, name: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Where two contents of JSON differ: the name, and both values."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for key in sorted({*one, *other}):
            yield from differences(one.get(key), other.get(key), key)
    elif one != other:
        yield name, one, other
