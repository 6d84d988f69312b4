"""Options and option types shared by the commands."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import click

from ..scenes.materials import MATERIALS


class Size(click.ParamType):
    """WIDTHxHEIGHT in pixels."""

    name = "WxH"

    def convert(
        self, value: str | tuple[int, int], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"(\d+)[xX×](\d+)", value)
        if match is None or not all(0 < int(n) <= 65536 for n in match.groups()):
            self.fail(f"'{value}' is not a size; write WIDTHxHEIGHT in pixels, for example 600x400", param, ctx)
        return int(match[1]), int(match[2])


class Rotation(click.ParamType):
    """Degrees about y, or about x, y and z, or the word ``flip``."""

    name = "DEG|X,Y,Z|flip"

    def convert(
        self, value: str | tuple[float, float, float], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float, float]:
        if isinstance(value, tuple):
            return value
        if value == "flip":
            return 180.0, 0.0, 0.0
        try:
            angles = [float(angle) for angle in value.split(",")]
        except ValueError:
            angles = []
        if len(angles) == 1:
            return 0.0, angles[0], 0.0
        if len(angles) != 3:
            self.fail(
                f"'{value}' is not a rotation; write degrees about y (90), or X,Y,Z (180,0,0), or flip", param, ctx
            )
        return angles[0], angles[1], angles[2]


class Definition(click.ParamType):
    """name=value."""

    name = "name=value"

    def convert(
        self, value: str | tuple[str, str], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, str]:
        if isinstance(value, tuple):
            return value
        name, separator, text = value.partition("=")
        if not (name and separator):
            self.fail(f"'{value}' is not a definition; write name=value", param, ctx)
        return name, text


class Counts(click.ParamType):
    """Numbers of 1 and above, separated by commas."""

    name = "N,N,..."

    def convert(
        self, value: str | tuple[int, ...], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, ...]:
        if isinstance(value, tuple):
            return value
        parts = [part.strip() for part in value.split(",")]
        if not all(re.fullmatch(r"\d{1,9}", part) and int(part) > 0 for part in parts):
            self.fail(f"'{value}' is no list of numbers from 1 on; write for example 16,64,256", param, ctx)
        return tuple(int(part) for part in parts)


_SCENE_OPTIONS = (
    click.option(
        "--env", metavar="MAP", help="Environment map (.exr, .hdr, .pfm): needed for a mesh, else replaces the scene's."
    ),
    click.option(
        "--env-rotate", type=Rotation(), default="0", help="Turn the map: degrees about y, or X,Y,Z, or flip."
    ),
    click.option("--env-scale", type=float, default=1.0, help="Brightness of the map, a factor."),
    click.option("--size", type=Size(), help="Film in pixels.  [default: the scene's own, or 600x400]"),
    click.option(
        "--material",
        type=click.Choice(list(MATERIALS)),
        default="diffuse",
        show_default=True,
        metavar="NAME",
        help=f"Material of a mesh: {', '.join(MATERIALS)}.",
    ),
    click.option("--up", type=click.Choice(["x", "y", "z", "-x", "-y", "-z"]), help="Axis of a mesh file that is up."),
    click.option("-D", "definitions", type=Definition(), multiple=True, help="Value of $name in a Mitsuba scene."),
    click.option("-m", "--variant", help="Mitsuba variant.  [default: cuda_ad_rgb where it works, else llvm_ad_rgb]"),
)


def scene_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options that say what is rendered, and in which variant; :func:`load` reads them."""
    for option in reversed(_SCENE_OPTIONS):
        command = option(command)
    return command


def load(scene: str, options: dict[str, Any], *, verbose: bool = False) -> tuple[Any, str]:
    """The Mitsuba scene that the options of :func:`scene_options` describe, and the variant, which is active then."""
    import mitsuba as mi  # not before --help

    from ..rendering.variants import choose_variant
    from ..scenes.load import load_scene

    variant = choose_variant(options["variant"])
    mi.set_log_level(mi.LogLevel.Info if verbose else mi.LogLevel.Error)
    loaded = load_scene(
        scene,
        environment=options["env"],
        rotate=options["env_rotate"],
        scale=options["env_scale"],
        material=options["material"],
        up=options["up"],
        size=options["size"],
        parameters=dict(options["definitions"]),
    )
    return loaded, variant
