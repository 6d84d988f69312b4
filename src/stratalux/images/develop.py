"""Pictures of images that are there: files of linear numbers, developed with one exposure for all."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ImageWarning, InputError
from ..settings import documented
from .files import PICTURE_SUFFIXES, check_bits, check_different, check_name, check_output
from .reader import Reader
from .reading import Image, read_image
from .settings import PictureFileSettings
from .tonemap import Meter
from .writing import add_to, write_developed

_PLACE = "{}"
_SUFFIX = ".png"
"""Of pictures in a folder."""


@dataclass(frozen=True)
class Developed:
    """``files`` that were written, with the same ``exposure`` in stops."""

    files: tuple[Path, ...]
    exposure: float


@documented(PictureFileSettings)
def develop(
    inputs: str | Path | Sequence[str | Path], output: str | Path, *, max_memory: int | None = None, **settings: Any
) -> Developed:
    """Make a picture of each image file of ``inputs``: whatever :func:`.reading.read_image` reads.

    ``output``: the name of the picture; where there are several, a folder, which gets a .png of each, or a name with
    ``{}`` in it, which stands for the name of the input without suffix. The automatic exposure is one for all: that of
    the mean over all of their pixels, as far as alpha covers them. Alpha is kept where the format has it.
    ``max_memory``: bytes that the pixels of one may take. Raises :class:`InputError`.
    """
    wanted = PictureFileSettings(**settings)
    given = [Path(path) for path in ([inputs] if isinstance(inputs, (str, Path)) else inputs)]
    outputs = _outputs(given, os.fspath(output))
    for path in outputs:
        check_bits(path, wanted)
    check_different(outputs, given)

    meter, exposure = Meter(), wanted.exposure
    with Reader() as reader:
        image: Image | None = None
        if exposure is None:
            for path in given:
                image = _read(path, max_memory, reader)
                add_to(meter, image.pixels, image.alpha)
            exposure = meter.stops
            wanted = replace(wanted, exposure=exposure)
        for path, written in zip(given, outputs, strict=True):
            # What has been metered is read again, unless it is one: several may not fit into memory together.
            if image is None or len(given) > 1:
                image = _read(path, max_memory, reader)
            _tell(path, image)
            write_developed(written, image.pixels, image.alpha, wanted)
    return Developed(tuple(outputs), exposure)


def _read(path: Path, max_memory: int | None, reader: Reader) -> Image:
    return read_image(path, max_memory, reader, alpha=True)


def _tell(path: Path, image: Image) -> None:
    if lost := np.count_nonzero(~np.isfinite(image.pixels).all(axis=2)):
        image.said.append(f"{lost} pixel(s) are not finite numbers")
    for said in image.said:
        warnings.warn(f"{path}: {said}", ImageWarning, stacklevel=3)


def _outputs(inputs: Sequence[Path], output: str) -> list[Path]:
    """The names of the pictures."""
    if not inputs:
        raise InputError("no image is given; name at least one")
    check_name(output)
    if _PLACE in Path(output).name:
        folder, name = os.path.split(output)
        names = [os.path.join(folder, name.replace(_PLACE, path.stem)) for path in inputs]
    elif output.endswith(os.sep) or Path(output).is_dir():
        if not Path(output).is_dir():
            raise InputError(f"{output}: no such folder; make it first")
        names = [os.path.join(output, path.stem + _SUFFIX) for path in inputs]
    elif len(inputs) > 1:
        raise InputError(f"{output}: is one name for {len(inputs)} pictures; give a folder that is there, or {{}}.png")
    else:
        names = [output]
    return [check_output(name, PICTURE_SUFFIXES) for name in names]
