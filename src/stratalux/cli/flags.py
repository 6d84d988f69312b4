"""From settings to flags of the command line."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from functools import wraps
from typing import Any

import click

from ..errors import InputError
from ..settings import Kind, Option, Settings, option_of, type_of


class KindType(click.ParamType):
    """A :class:`Kind` as click knows types."""

    def __init__(self, kind: Kind) -> None:
        self.kind, self.name = kind, kind.metavar

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not isinstance(value, str):
            return value
        try:
            return self.kind.parse(value)
        except InputError as error:
            self.fail(str(error), param, ctx)


class Number(click.FloatRange):
    """A finite number within bounds."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        return number


def flags(**groups: type[Settings]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Give a command a flag for each setting of ``groups``, and each group, filled, under its name."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(command)
        def call(*arguments: Any, **given: Any) -> Any:
            for name, group in groups.items():
                values = {f.name: given.pop(f.name) for f in dataclasses.fields(group) if f.name in given}
                given[name] = group(**{key: value for key, value in values.items() if value not in (None, ())})
            return command(*arguments, **given)

        wrapped: Callable[..., Any] = call
        for parameter in reversed(list(_parameters(*groups.values()))):
            wrapped = parameter(wrapped)
        return wrapped

    return decorate


def _parameters(*groups: type[Settings]) -> Iterator[Callable[[Callable[..., Any]], Callable[..., Any]]]:
    for group in groups:
        for field in dataclasses.fields(group):
            about = option_of(field)
            required = field.default is dataclasses.MISSING
            kind = _type(about, type_of(group, field.name))
            if about.argument:
                count = -1 if about.several else 1
                yield click.argument(field.name, type=kind, metavar=about.metavar, nargs=count, required=required)
            elif about.flags:
                flag = kind is click.BOOL
                shows_value = not (required or flag or field.default in (None, ()))
                text = about.help
                if about.default_text is not None:
                    text += f"  [default: {about.default_text}]"
                elif shows_value:
                    text += f"  [default: {_shown(about, field.default)}]"
                yield click.option(
                    *about.flags,
                    field.name,
                    type=None if flag else kind,
                    is_flag=flag,
                    multiple=about.several,
                    required=required,
                    default=None,
                    metavar=about.metavar,
                    help=text,
                )


def _shown(about: Option, value: Any) -> str:
    if about.several:
        return ",".join(map(str, value))
    return about.kind.show(value) if about.kind else str(value)


def _type(about: Option, types: tuple[type, ...]) -> click.ParamType:
    if about.kind is not None:
        return KindType(about.kind)
    if about.choices:
        return click.Choice(about.choices)
    if bool in types:
        return click.BOOL
    if float in types:
        return Number(about.minimum, about.maximum)
    if int in types:
        least, most = (None if bound is None else int(bound) for bound in (about.minimum, about.maximum))
        return click.IntRange(least, most)
    return click.STRING
