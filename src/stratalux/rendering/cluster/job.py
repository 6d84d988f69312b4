"""What a worker has to know to make launches of a picture: its settings, and the files of its scene by content."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from ...assets import sha256_of
from ...caches import cache_folder
from ...errors import InputError
from ...images.files import write_atomically
from ..settings import PictureSettings


class Missing(Exception):
    """A worker lacks files; ``hashes`` are those of their contents."""

    def __init__(self, hashes: list[str]) -> None:
        super().__init__(hashes)
        self.hashes = hashes

    def __str__(self) -> str:
        return f"{len(self.hashes)} files are to be sent"


@dataclass(frozen=True)
class File:
    """One of a scene: its absolute path where the picture was asked for, and what it holds."""

    path: str
    sha256: str
    size: int


@dataclass(frozen=True)
class Job:
    """``picture``: JSON of its settings. ``identity``: of the loaded scene, see :func:`~..checkpoint.identity_of`."""

    picture: str
    files: tuple[File, ...]
    identity: str

    @classmethod
    def of(cls, picture: PictureSettings, files: Iterable[Path], identity: Mapping[str, Any]) -> Job:
        """The job of a picture whose scene was read from ``files``.

        Raises :class:`InputError` for what only this process has: a scene or a map that is no file.
        """
        if picture.scene is None:
            raise InputError("cluster: the scene was loaded by a program; give its file instead")
        if not isinstance(picture.scene.environment, (str, type(None))):
            raise InputError("cluster: the map was made by a program; give its file instead")
        hashed = tuple(File(str(path), sha256_of(path), path.stat().st_size) for path in sorted(set(files)))
        wanted = {name: identity[name] for name in ("map", "scene", "versions")}
        return cls(picture.to_text(), hashed, json.dumps(wanted))

    @cached_property
    def key(self) -> str:
        """A name that no other job has."""
        return hashlib.sha256(repr((self.picture, self.files, self.identity)).encode()).hexdigest()[:24]

    def settings(self, paths: Mapping[str, str]) -> PictureSettings:
        """Those of the picture, with files as they are called here."""
        return settings_of(self.picture, lambda name: paths.get(os.path.abspath(name), name))


def settings_of(picture: str, called: Callable[[str], str]) -> PictureSettings:
    """Those of a ``picture`` in JSON, with what its scene is made of as that is ``called`` here."""
    content = json.loads(picture)
    for name in ("source", "environment", "background"):
        said = content["scene"].get(name)
        if said is not None:
            content["scene"][name] = called(said)
    return PictureSettings.from_json(content)


def found(job: Job, contents: Mapping[str, bytes]) -> dict[str, str]:
    """The job's files on this machine, by their names where it was asked for.

    They are used where they are if this machine has the very same; else they are put into the cache once, as
    ``contents`` has them by their hashes. Raises :class:`Missing` for those that are nowhere.
    """
    if all(_is_here(file) for file in job.files):
        return {file.path: file.path for file in job.files}
    folder = cache_folder() / "cluster"
    missing = []
    for file in job.files:
        kept = folder / "files" / file.sha256
        if kept.is_file() and kept.stat().st_size == file.size:
            continue
        if file.sha256 not in contents:
            missing.append(file.sha256)
            continue
        kept.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(kept, partial(_write, contents[file.sha256]))
    if missing:
        raise Missing(missing)
    # Files name each other by where they are: the same folders again, below one of the job's own.
    paths = {}
    for file in job.files:
        place = folder / "scenes" / job.key / Path(file.path).relative_to(Path(file.path).anchor)
        place.parent.mkdir(parents=True, exist_ok=True)
        if not place.exists():
            _link(folder / "files" / file.sha256, place)
        paths[file.path] = str(place)
    return paths


def _link(kept: Path, place: Path) -> None:
    try:
        os.link(kept, place)
    except FileExistsError:
        pass  # another worker of this machine was faster
    except OSError:  # a file system without links
        write_atomically(place, partial(_write, kept.read_bytes()))


def _write(data: bytes, name: str) -> None:
    Path(name).write_bytes(data)


def _is_here(file: File) -> bool:
    try:
        return os.stat(file.path).st_size == file.size and sha256_of(Path(file.path)) == file.sha256
    except (OSError, InputError):
        return False
