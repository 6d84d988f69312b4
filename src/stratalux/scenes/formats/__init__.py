"""One module for each format of mesh files; each has a function `read` from a path to a model.

They are read here and not by a library. trimesh fans concave polygons, refuses lists of different lengths and bytes
behind the end, and counts negative indices from the end of the file; of glTF it ignores what is quantised, instanced,
morphed or skinned. plyfile is under the GPL. Mitsuba's own loaders are single precision and know triangles alone. USD
alone is read by a library, its own.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ...errors import InputError
from ..model import Model
from . import gltf, obj, off, ply, stl, usd

READERS: dict[str, Callable[[Path], Model]] = {
    ".glb": gltf.read,
    ".gltf": gltf.read,
    ".obj": obj.read,
    ".off": off.read,
    ".ply": ply.read,
    ".stl": stl.read,
    ".usd": usd.read,
    ".usda": usd.read,
    ".usdc": usd.read,
    ".usdz": usd.read,
}


def read_model(path: str | Path) -> Model:
    """What a file of one of the :data:`READERS` holds, in the coordinates of the file.

    What the file says and a model cannot hold is told in a :class:`SceneWarning`. Raises :class:`InputError` for a file
    that is missing, unreadable, truncated, of another format, or without a surface.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: unknown mesh format '{path.suffix}'; use one of {' '.join(READERS)}")
    if not path.is_file():
        raise InputError(f"{path}: there is no such mesh file; check the path")
    try:
        model = reader(path)
    except InputError:
        raise
    # What a damaged file makes of a reader is anybody's guess, from IndexError to MemoryError.
    except Exception as error:
        reason = str(error) if type(error) is ValueError else f"{type(error).__name__}: {error}"
        reason = " ".join(reason.split())[:120]
        raise InputError(f"{path}: unreadable as {path.suffix} ({reason}); export it again") from error
    if not any(len(model.parts[instance.part].faces) for instance in model.instances):
        raise InputError(f"{path}: the mesh has no faces; export it as a triangle surface")
    return model
