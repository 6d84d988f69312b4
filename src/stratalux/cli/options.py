"""Option types shared by the commands."""

from __future__ import annotations

import re

import click


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
