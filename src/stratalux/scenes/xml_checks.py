"""What is looked at in a Mitsuba scene before Mitsuba loads it: else it would end the process, hang, or give NaN."""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path
from xml.parsers import expat

import mitsuba as mi

from ..errors import InputError
from .sources import source

_DEEPEST = 200
"""Elements within elements: Mitsuba's parser calls itself for each, until the stack is full."""
_NUMBERS = ("float", "rgb", "spectrum", "vector", "point", "translate", "rotate", "scale", "lookat", "matrix")
"""Elements whose attributes, but for names, are numbers."""
_LARGEST = 3.4e38
"""What a number of single precision can be."""
_WIDEST_FILTER = 100.0
"""Radius of a reconstruction filter in pixels; each sample is added to so many pixels in either direction."""


def check_text(path: Path, parameters: dict[str, str], within: tuple[Path, ...] = ()) -> None:
    """Raise :class:`InputError` for elements or includes that are nested without end, and for numbers that are none.

    ``parameters``: values of ``$name``; what the file sets itself is added. ``within``: files that include this one.
    """
    if path.resolve() in within:
        raise InputError(f"{path}: includes itself; take that <include> out")
    if len(within) > _DEEPEST:
        raise InputError(f"{within[0]}: includes are nested more than {_DEEPEST} deep")
    depth = 0
    included: list[str] = []
    parser = expat.ParserCreate()

    def begin(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST:
            raise InputError(f"{path}: elements are nested more than {_DEEPEST} deep; no scene needs that")
        if name == "default" and "name" in attributes:
            parameters.setdefault(attributes["name"], attributes.get("value", ""))
        elif name == "include":
            included.append(attributes.get("filename", ""))
        elif name in _NUMBERS:
            for key, value in attributes.items():
                if key not in ("name", "id", "filename"):
                    _check_numbers(f"{path}, line {parser.CurrentLineNumber}", _with(parameters, value))

    def end(name: str) -> None:
        nonlocal depth
        depth -= 1

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    try:
        with path.open("rb") as file:
            parser.ParseFile(file)
        source(path)
    except expat.ExpatError:
        pass  # Mitsuba's own parser says where and why
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    for name in included:
        other = path.parent / _with(parameters, name)
        if _is_file(other):
            check_text(other, parameters, (*within, path.resolve()))


def _with(parameters: dict[str, str], text: str) -> str:
    """``text`` with the values of the parameters that it names."""
    if "$" in text:
        for key in sorted(parameters, key=len, reverse=True):
            text = text.replace(f"${key}", parameters[key])
    return text


def _check_numbers(where: str, text: str) -> None:
    for word in re.split(r"[\s,:]+", text):
        try:
            number = float(word)
        except ValueError:
            continue  # Mitsuba says what it is
        if not abs(number) <= _LARGEST:
            raise InputError(f"{where}: {word} is no number that can be reckoned with; give a finite one")


def _is_file(path: Path) -> bool:
    """Whether there is a file; raises :class:`InputError` for what is none and would be read for ever."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return False  # Mitsuba says it
    if not stat.S_ISREG(mode):
        raise InputError(f"{path}: is no file; give one that a scene can be read from")
    return True


def check_objects(state: mi.parser.ParserState) -> None:
    """Raise :class:`InputError` for what plugins of Mitsuba take for granted. File names are relative to its resolver.

    Properties that are looked at here stay unread, as Mitsuba refuses those that no plugin reads.
    """
    for node in state.nodes:
        props, where = node.props, mi.parser.file_location(state, node)
        kind = props.plugin_name()
        if kind == "bitmap" and not any(name in props for name in ("filename", "bitmap", "data")):
            raise InputError(f"{where}: a bitmap without a file; give it a filename")
        if kind == "aov" and isinstance(asked := _peek(props, "aovs"), str):
            for item in asked.split(","):
                if not re.fullmatch(r"[^:]+:[^:]+", item.strip()):
                    raise InputError(f"{where}: '{item}' is no AOV; write name:type, for example depth:depth")
        if isinstance(name := _peek(props, "filename"), str):
            path = Path(str(mi.file_resolver().resolve(name)))
            if _is_file(path):
                source(path)


def _peek(props: mi.Properties, name: str) -> object:
    """A property, or None, without having read it."""
    if name not in props:
        return None
    known = props.was_queried(name)
    value = props[name]
    props.mark_queried(name, known)
    return value


def check_filters(path: Path, scene: mi.Scene) -> None:
    """Raise :class:`InputError` for reconstruction filters that are no size, or take for ever."""
    for sensor in scene.sensors():
        radius = sensor.film().rfilter().radius()
        if not 0 < radius <= _WIDEST_FILTER:
            raise InputError(
                f"{path}: a reconstruction filter has a radius of {radius:g} pixels; give one of at most "
                f"{_WIDEST_FILTER:g}"
            )
