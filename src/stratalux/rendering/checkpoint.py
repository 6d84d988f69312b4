"""A picture in the making, kept in a file, to go on with when its process has ended."""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..assets import sha256_of
from ..errors import InputError
from ..images.files import write_atomically
from ..integrators.sums import Memory
from .identity import add_parameters, add_structure, differences
from .settings import PictureSettings

_ABOUT = "about"
_FREE = {"sampling": ("time", "target_error"), "output": None, "machine": ("max_memory", "cluster")}
"""Settings that may be others when a picture goes on."""


@dataclass(frozen=True)
class Checkpoint:
    """``identity``: of the picture, see :func:`identity_of`. ``seconds``: that it has taken so far. ``name``: of the
    file that it comes from."""

    identity: Mapping[str, Any]
    memory: Memory
    seconds: float
    name: str = "checkpoint"

    def save(self, path: str | Path) -> None:
        """Write the file, complete or not at all. Raises :class:`OSError`."""
        about = json.dumps({"format": "stratalux checkpoint", "identity": self.identity, "seconds": self.seconds})
        arrays = {name: np.asarray(value) for name, value in _flat(self.memory)}
        arrays[_ABOUT] = np.frombuffer(about.encode(), dtype=np.uint8)

        def write(name: str) -> None:
            with open(name, "wb") as file:
                np.savez(file, **arrays)  # type: ignore[arg-type]
                file.flush()
                os.fsync(file.fileno())

        write_atomically(Path(path), write)

    @classmethod
    def load(cls, path: str | Path) -> Checkpoint:
        """Read the file; raises :class:`InputError` if it is none, or damaged."""
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            about = json.loads(bytes(arrays.pop(_ABOUT)))
            return cls(about["identity"], _deep(arrays), float(about["seconds"]), str(path))
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
        except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, MemoryError) as error:
            raise InputError(f"{path}: is no checkpoint, or a damaged one ({error}); start without --resume") from None

    def check(self, identity: Mapping[str, Any]) -> None:
        """Raise :class:`InputError` that says what differs if the picture is another one."""
        now = json.loads(json.dumps(identity))  # with lists for tuples, as the file has them
        differing = [_said(*one) for one in differences(json.loads(json.dumps(self.identity)), now)]
        if differing:
            raise InputError(f"{self.name}: belongs to another picture: {'; '.join(differing)}")


def identity_of(scene: mi.Scene, picture: PictureSettings) -> dict[str, Any]:
    """All that a picture depends on: its settings, what its files held, and what computes it."""
    environment = scene.environment()
    of_map = " " if environment is None else f"{environment.id()}."  # No parameter begins with a space
    whole, light = hashlib.sha256(), hashlib.sha256()
    add_structure(whole, scene)
    add_parameters(whole, scene, lambda name: not name.startswith(of_map))
    add_parameters(light, scene, lambda name: name.startswith(of_map))
    content = picture.to_json()
    for group, names in _FREE.items():
        for name in list(content[group]) if names is None else names:
            content[group].pop(name, None)
    return {
        "settings": content,
        "map": light.hexdigest(),
        "scene": whole.hexdigest(),
        "file": _file(picture),
        "versions": {
            "stratalux": version("stratalux"),
            "mitsuba": mi.__version__,
            "drjit": dr.__version__,
        },
    }


def _file(picture: PictureSettings) -> str:
    """A hash of the scene's file: not all that a model has are parameters of Mitsuba's objects."""
    source = None if picture.scene is None else Path(picture.scene.source)
    return "" if source is None or not source.is_file() else sha256_of(source)


def _said(name: str, before: Any, now: Any) -> str:
    if name in ("map", "scene", "file"):
        return f"the {name} is another one"
    return f"{name} was {json.dumps(before)} and is {json.dumps(now)}"


def _flat(memory: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in memory.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}/")
        else:
            yield prefix + name, value


def _deep(arrays: Mapping[str, Any]) -> Memory:
    memory: Memory = {}
    for name, value in arrays.items():
        *parents, last = name.split("/")
        where = memory
        for parent in parents:
            where = where.setdefault(parent, {})
        where[last] = value
    return memory
