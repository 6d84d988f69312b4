"""The report of a rig: the map with its lights, pictures under both, and the errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..images.metrics import flip_map, relative_mse, why_no_flip
from ..images.tonemap import auto_exposure, filled
from ..maps.envmap import EnvironmentMap
from ..rendering.passes import activate
from ..rendering.settings import MachineSettings
from ..report.html import write_report
from ..report.model import ImageSet, Picture, Report, Section, Table
from ..report.text import number
from ..rigs import LightRig
from ..rigs.lights import Lights
from ..rigs.picture import mark_lights
from .provenance import versions
from .rig_scenes import View, views

_MAP_HEIGHT = 512
_LISTED = 64
"""Lights that the table has."""


def write_rig_report(
    environment: EnvironmentMap,
    lights: Lights,
    path: str | Path,
    *,
    cells: LightRig | None = None,
    machine: MachineSettings | None = None,
    command: str | None = None,
) -> None:
    """Write a page about ``lights`` of a map to ``path``: where they are, what they light, and how far off that is.

    ``cells``: their strata, if the technique has these. ``machine``: the variant that renders. Raises
    :class:`InputError` for a variant that is not there.
    """
    machine = activate(machine or MachineSettings())
    write_report(rig_report(environment, lights, views(environment, lights), cells, command), path)


def rig_report(
    environment: EnvironmentMap,
    lights: Lights,
    shown: list[View],
    cells: LightRig | None = None,
    command: str | None = None,
) -> Report:
    """The report of lights whose pictures are there."""
    no_flip = why_no_flip()
    count = int(np.count_nonzero(lights.colour.any(axis=1)))
    ambient = {True: "", False: " and an ambient light"}[lights.ambient is None]
    what = f"{count} light{'s' if count != 1 else ''} by {lights.method}{ambient}"
    sets, rows = [], _errors(lights)
    for view in shown:
        block, measured = _compared(view, flip=no_flip is None)
        sets.append(block)
        rows += measured
    summary = [f"{what[0].upper()}{what[1:]} in place of {_name(lights)}."]
    if lights.quality:
        summary.append(
            f"On matte surfaces of all orientations their irradiance is {lights.quality['irradiance_error']:.2%} off, "
            f"in the shadow of a ball {lights.quality['shadow_error']:.1%}."
        )
    return Report(
        title=f"Light rig: {_name(lights)}",
        subtitle=what,
        summary=tuple(summary),
        sections=(
            Section("lights", "The map and the lights", blocks=(_map(environment, lights),)),
            Section(
                "pictures",
                "Under the map and under the lights",
                (
                    "Flip between the two. A mirror shows neither directional lights nor the map that they stand for: "
                    "a tool that has the lights alone shows it so. A light with an angle is rendered as 16 without.",
                    "It is direct light, without what is behind. Ambient light is shaded by what is in its way, as "
                    "ambient occlusion does at its best.",
                ),
                blocks=tuple(sets),
            ),
            Section("errors", "Errors", blocks=(Table("Errors", ("what", "error"), tuple(rows)),)),
            Section("list", "The lights", blocks=(_table(lights, cells),)),
        ),
        facts={
            "map": f"{_name(lights)}, {environment.width}x{environment.height}",
            "method": lights.method,
            **({} if command is None else {"command": command}),
            "versions": ", ".join(f"{name} {version}" for name, version in versions().items() if version),
        },
        notes=(no_flip,) if no_flip else (),
    )


def _name(lights: Lights) -> str:
    return "the map" if lights.map is None else Path(lights.map).name


def _errors(lights: Lights) -> list[tuple[str, str]]:
    names = {
        "irradiance_error": "irradiance, over all normals",
        "shadow_error": "irradiance on a floor under a ball",
    }
    return [(names[key], f"{100 * value:.2f} %") for key, value in lights.quality.items() if key in names]


def _compared(view: View, *, flip: bool) -> tuple[ImageSet, list[tuple[str, str]]]:
    """The pictures of a view, the map's as the reference, and the rows of the table of errors."""
    error = relative_mse(view.under_rig, view.under_map)
    differences = flip_map(view.under_rig, view.under_map) if flip else None
    facts = {"relative MSE": number(error)}
    if differences is not None:
        facts["FLIP"] = f"{float(differences.mean()):.4f}"
    exposure = auto_exposure(view.under_map)
    rig = Picture("under the lights", view.under_rig, facts, differences)
    reference = Picture("under the map", view.under_map)
    block = ImageSet(view.title, (rig,), reference, exposure)
    return block, [(f"{view.title.lower()}: {name}", value) for name, value in facts.items()]


def _map(environment: EnvironmentMap, lights: Lights) -> ImageSet:
    texels = filled(_smaller(environment.texels))
    exposure = auto_exposure(texels)
    marked = mark_lights(texels, lights, 2.0**-exposure)
    return ImageSet(
        "The map",
        (Picture("with the lights", marked), Picture("without", texels)),
        exposure=exposure,
        text="Each disc is a light, in its colour; areas are in proportion to the light, down to a smallest one.",
    )


def _smaller(texels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Means over blocks, so that the picture has not many more rows than :data:`_MAP_HEIGHT`."""
    k = max(1, texels.shape[0] // _MAP_HEIGHT)
    rows, columns = texels.shape[0] // k, max(1, texels.shape[1] // k)
    blocks = texels[: rows * k, : columns * k].reshape(rows, k, columns, -1, 3)
    return np.asarray(blocks.mean(axis=(1, 3)), dtype=np.float32)


def _table(lights: Lights, cells: LightRig | None) -> Table:
    luminance = lights.colour.sum(axis=1)
    order = np.argsort(-luminance, kind="stable")[:_LISTED]
    solid = lights.solid_angle if cells is None else cells.solid_angle
    header = (
        "light",
        "direction",
        "colour (irradiance)",
        "share",
        "angle",
        *(() if solid is None else ("steradians",)),
    )
    rows = []
    total = luminance.sum() or 1.0
    for k in order.tolist():
        cell = () if solid is None else (number(float(solid[k])),)
        rows.append(
            (
                str(k + 1),
                " ".join(f"{x + 0.0:.3f}" for x in lights.direction[k]),
                " ".join(f"{x:.4g}" for x in lights.colour[k]),
                f"{luminance[k] / total:.1%}",
                f"{np.degrees(lights.angle[k]):.2g}°" if lights.angle[k] else "–",
                *cell,
            )
        )
    short = "" if len(lights) <= _LISTED else f"The brightest {_LISTED} of {len(lights)}. "
    return Table(
        "Lights", header, tuple(rows), f"{short}Directions are towards the lights: y up, the middle of the map at +z."
    )
