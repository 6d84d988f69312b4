"""A map for another tool: in another layout, as harmonics, or without its sun, which becomes a light."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import EnvironmentMapWarning, InputError, RigWarning
from ..images.files import check_different, check_writable, shown, write_atomically
from ..images.reading import default_memory
from ..maps.envmap import MIN_HEIGHT, EnvironmentMap
from ..maps.geometry import direction
from ..maps.layouts import LATLONG, LAYOUTS
from ..maps.layouts.guess import face_files
from ..maps.resampling import Sheet, resample
from ..maps.settings import HARMONICS, MapSettings
from ..maps.sheets import output_files, read_sheet, write_sheet
from ..settings import documented
from . import sh_files
from .formats import format_of, write_rig
from .harmonics import of_radiance
from .lights import Lights
from .quality import irradiance, sources
from .sun import Sun, split_sun

IRRADIANCE_ROWS = 32
"""Of a map of irradiance, which has no detail."""
_TEXEL_BYTES = 80
"""Of memory that each texel of the result takes, while it is made."""
_FINE = 64
"""Rows of a map whose texels can be taken for points."""


@dataclass(frozen=True)
class Converted:
    """``files`` that were written, and in how many words what: ``what``. ``sun``: the one that was left out."""

    files: tuple[Path, ...]
    what: str
    sun: Sun | None = None


@documented(MapSettings, without=("source",))
def convert_map(
    source: str | Path,
    outputs: str | Path | Sequence[str | Path],
    *,
    lights: Sequence[tuple[str | None, str | Path]] = (),
    max_memory: int | None = None,
    **settings: Any,
) -> Converted:
    """Write the map in the file ``source`` as other tools need it, to each of ``outputs``.

    Layouts are written to .exr, .hdr, .pfm or .tif, with the light of the map; harmonics to .json or .glsl. Where each
    face is a file, there are six, named after the output. ``lights``: files for the sun that is left out, each with the
    name of a format or None (see :func:`.formats.write_rig`). ``max_memory``: bytes that the pixels of a
    file, and the making of the result, may take.
    Warns of what the file says, and where the map has no sun. Raises :class:`InputError`.
    """
    asked = MapSettings(str(source), **settings)
    wanted = [Path(path) for path in ([outputs] if isinstance(outputs, (str, Path)) else outputs)]
    _check(asked, wanted, lights)
    sheet, said = read_sheet(asked.source, asked.env_layout, max_memory)
    for line in said:
        warnings.warn(f"{asked.source}: {line}", EnvironmentMapWarning, stacklevel=2)
    came = _described(sheet)
    if sheet.layout is LATLONG:
        sheet = EnvironmentMap.from_sheet(sheet).sheet  # of as many rows as a map needs
    sun = None
    if asked.remove_sun:
        environment = EnvironmentMap.from_sheet(sheet)
        sun, rest = split_sun(environment)
        if not sun.is_one:
            warnings.warn(f"{asked.source}: {sun.doubt}; that is what is left out", RigWarning, stacklevel=2)
        sheet = rest.sheet
        light = Lights(sun.direction[None], sun.colour[None], np.array([sun.angle]), "sun", map=asked.source)
        for name, path in lights:
            write_rig(light, path, name)
    if asked.to == HARMONICS:
        coefficients = of_radiance(EnvironmentMap.from_sheet(sheet).texels)
        for path in wanted:
            content = sh_files.encode(coefficients, path.suffix.lower(), asked.source).encode()
            write_atomically(path, partial(_write, content=content))
        return Converted(tuple(wanted), f"nine harmonics of {came}", sun)
    layout = LAYOUTS[asked.to]
    if asked.irradiance:
        sheet = irradiance_sheet(EnvironmentMap.from_sheet(sheet))
    least = MIN_HEIGHT if layout is LATLONG else 1
    height = asked.size or max(least, round(sheet.equivalent / layout.rows))
    need = _TEXEL_BYTES * layout.faces * layout.wide * height**2
    if need > (most := default_memory() if max_memory is None else max_memory):
        raise InputError(
            f"size: {height} rows of {layout.name} take {need / 1e9:.3g} GB, more than {most / 1e9:.3g} GB; give a "
            "smaller --size, or allow more with --max-memory"
        )
    made = resample(sheet, layout, height)
    files = [file for path in wanted for file in write_sheet(made, path)]
    return Converted(tuple(files), f"{_described(made)}, from {came}", sun)


def irradiance_sheet(environment: EnvironmentMap, height: int = IRRADIANCE_ROWS) -> Sheet:
    """E(n) / π under the map, for the normals at the texels of a latitude-longitude map of ``height`` rows.

    That is the radiance of a white matte surface. The map is taken for the points of :func:`.quality.sources`.
    """
    if environment.height < _FINE:
        environment = EnvironmentMap.from_sheet(resample(environment.sheet, LATLONG, _FINE))
    u, v = np.meshgrid((np.arange(2 * height) + 0.5) / (2 * height), np.arange(height) / (height - 1))
    E = irradiance(*sources(environment), direction(u, v).reshape(-1, 3))
    return Sheet(LATLONG, (E / np.pi).reshape(1, height, 2 * height, 3).astype(np.float32))


def _write(name: str, content: bytes) -> None:
    Path(name).write_bytes(content)


def _described(sheet: Sheet) -> str:
    size = f"{sheet.shape[1]}x{sheet.shape[0]}"
    return f"{sheet.layout.name}, " + (f"six faces of {size}" if sheet.layout.faces > 1 else size)


def _check(asked: MapSettings, outputs: Sequence[Path], lights: Sequence[tuple[str | None, str | Path]]) -> None:
    """Whether all can be written, before any work is done."""
    if not outputs:
        raise InputError("no output is given; name at least one")
    if lights and not asked.remove_sun:
        raise InputError("--light: is for the sun that --remove-sun leaves out; give both")
    if asked.to == HARMONICS:
        if asked.size is not None or asked.irradiance:
            raise InputError("--to sh: has no size, and irradiance anyway; leave --size and --irradiance out")
        for path in outputs:
            if path.suffix.lower() not in sh_files.SUFFIXES:
                raise InputError(f"{shown(path)}: harmonics are written as {' or '.join(sh_files.SUFFIXES)}")
            check_writable(path)
        files = list(outputs)
    else:
        if asked.to == LATLONG.name and asked.size is not None and asked.size < MIN_HEIGHT:
            raise InputError(f"size: {asked.size} is too small for latlong; give at least {MIN_HEIGHT}")
        files = [file for path in outputs for file in output_files(path, LAYOUTS[asked.to])]
    for name, file in lights:
        check_writable(file)
        format_of(file, name)
    inputs: list[str | Path] = [asked.source, *face_files(Path(asked.source))]
    check_different([*files, *(file for _, file in lights)], inputs)
