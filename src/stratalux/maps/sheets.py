"""Maps in any layout, as images and as files: :mod:`.layouts` has the layouts, :mod:`.resampling` converts."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..images.repair import repair
from .layouts import LATLONG, LAYOUTS, Layout
from .layouts.cube import FACES
from .layouts.guess import about_size, check_size, face_files, guessed
from .resampling import Sheet

if TYPE_CHECKING:
    from ..images.reading import Allocate, Image

AUTO = "auto"
LINEAR_SUFFIXES = (".exr", ".hdr", ".pfm", ".tif", ".tiff")
_LARGEST_HALF = 65504.0


def read_sheet(
    path: str | Path, layout: str = AUTO, max_memory: int | None = None, allocate: Allocate | None = None
) -> tuple[Sheet, list[str]]:
    """The map in a file, as it lies there, and what there is to say of it, a line each.

    ``layout``: a name of :data:`.LAYOUTS`; ``auto``: that of the header, else of the name (see :func:`.guessed`), else
    latitude and longitude. Six files are read by the name of one of them. ``allocate``: see
    :func:`..images.reading.read_image`; half floats stay in maps of latitude and longitude. Raises :class:`InputError`
    as that does, for a size that the layout cannot have, and for faces that are missing.
    """
    from ..images.reader import Reader  # not before a file is read
    from ..images.reading import read_image

    path = Path(path)
    if layout not in (AUTO, *LAYOUTS):
        raise InputError(f"env_layout: '{layout}' is unknown; use one of {', '.join((AUTO, *LAYOUTS))}")
    with Reader() as reader:
        return _read(path, layout, partial(read_image, max_memory=max_memory, reader=reader, allocate=allocate))


def _read(path: Path, layout: str, read: Callable[[Path], Image]) -> tuple[Sheet, list[str]]:
    image = read(path)
    height, width = image.pixels.shape[:2]
    chosen, said = LATLONG, list(image.said)
    if layout != AUTO:
        chosen = LAYOUTS[layout]
    elif image.layout in LAYOUTS:
        chosen = LAYOUTS[image.layout]
        if chosen is not LATLONG:
            said.append(f"taken for the layout {chosen.name}, as its header says")
    elif found := guessed(path, width, height):
        chosen = found
        said.append(f"taken for the layout {chosen.name}, as its name says; --env-layout says otherwise")
    elif about := about_size(width, height):
        said.append(about)
    check_size(path, chosen, width, height)
    if chosen is FACES:
        return _six(path, image, said, read)
    pixels, repaired = repair(image.pixels, image.largest)
    return unpacked(pixels, chosen), [*said, *([repaired] if repaired else [])]


def _six(path: Path, image: Image, said: list[str], read: Callable[[Path], Image]) -> tuple[Sheet, list[str]]:
    """The six faces that the file at ``path``, whose ``image`` is read already, is one of."""
    files = face_files(path)
    if not files:
        raise InputError(f"{path}: is no name of one of six faces; let it end with _px, _posx or _right, for example")
    faces = []
    for file in files:
        found = image if file == path else read(file)
        said += [] if file == path else [f"{file.name}: {line}" for line in found.said]
        pixels, repaired = repair(found.pixels, found.largest)
        said += [f"{file.name}: {repaired}"] if repaired else []
        if pixels.shape != image.pixels.shape:
            size = f"{pixels.shape[1]}x{pixels.shape[0]}"
            raise InputError(f"{file}: {size} is not the size of {path.name}; export it again")
        faces.append(pixels)
    return Sheet(FACES, np.stack(faces).astype(np.float32, copy=False)), said


def unpacked(image: NDArray[np.float32], layout: Layout) -> Sheet:
    """The faces of an ``image`` (H, W, 3) that has the ``layout``; of latitude and longitude, it is one itself."""
    if layout is LATLONG:
        return Sheet(layout, image[None])
    rows, columns = layout.grid
    height, width = image.shape[0] // rows, image.shape[1] // columns
    texels = np.empty((layout.faces, height, width, 3), dtype=np.float32)
    for face, (row, column, turned) in zip(texels, layout.places, strict=True):
        part = image[row * height : (row + 1) * height, column * width : (column + 1) * width]
        face[:] = part[::-1, ::-1] if turned else part
    return Sheet(layout, texels)


def packed(sheet: Sheet) -> list[NDArray[np.float32]]:
    """The images (H, W, 3) of a sheet: one, or six where each face is a file."""
    if sheet.layout.files:
        return list(sheet.texels)
    rows, columns = sheet.layout.grid
    height, width = sheet.shape
    image = np.zeros((rows * height, columns * width, 3), dtype=np.float32)
    for face, (row, column, turned) in zip(sheet.texels, sheet.layout.places, strict=True):
        part = image[row * height : (row + 1) * height, column * width : (column + 1) * width]
        part[:] = face[::-1, ::-1] if turned else face
    return [image]


def output_files(path: str | Path, layout: Layout) -> list[Path]:
    """The files that a map of the ``layout`` is written to: one, or six named after ``path``. Checks that they can be.

    Raises :class:`InputError`.
    """
    from ..images.files import check_output

    path = Path(path)
    files = [path]
    if layout.files:
        files = list(face_files(path)) or [path.with_name(f"{path.stem}_{name}{path.suffix}") for name in layout.files]
    return [check_output(file, LINEAR_SUFFIXES) for file in files]


def write_sheet(sheet: Sheet, path: str | Path) -> list[Path]:
    """Write a map as linear numbers, by the suffix of ``path``; the files.

    OpenEXR has half floats, or 32 bits where these cannot hold the brightest texel. Its header says what the layout is.
    Raises :class:`InputError` for a place or a format that cannot be written.
    """
    from ..images.writing import write_image

    files = output_files(path, sheet.layout)
    bright = float(sheet.texels.max(initial=0)) > _LARGEST_HALF
    header: dict[str, str | int] = {"stratalux:layout": sheet.layout.name}
    if sheet.layout.name in _HEADERS:
        # Without a level mode, what has a format of textures would be a pyramid of tiles.
        header |= {"textureformat": _HEADERS[sheet.layout.name], "openexr:levelmode": 0}
    for file, image in zip(files, packed(sheet), strict=True):
        float32 = file.suffix.lower().startswith(".tif") or (bright and file.suffix.lower() == ".exr")
        write_image(file, image, header, float32=float32)
    return files


_HEADERS = {"latlong": "LatLong Environment", "openexr-cube": "CubeFace Environment"}
"""What OpenImageIO makes the ``envmap`` of OpenEXR of."""
