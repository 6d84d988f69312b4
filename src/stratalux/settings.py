"""Settings: frozen dataclasses whose fields say, once, what they mean, what they may be, and how they are typed.

A field is made by :func:`option`. From it the command line makes a flag, Python a keyword with its documentation
(:func:`documented`), and JSON an entry (:meth:`Settings.to_json`). Each layer has its own groups in its folder.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import shlex
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from types import UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from .errors import InputError

T = TypeVar("T", bound="Settings")
Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True)
class Kind:
    """Values that are more than a number or a word.

    ``metavar``: what help shows. ``parse``: text to value, and ``check``: whatever a caller gives to value, both raise
    :class:`InputError`. ``show``: value to the text that ``parse`` reads. ``to_json``: value to what JSON has.
    """

    metavar: str
    parse: Callable[[str], Any]
    check: Callable[[Any], Any]
    show: Callable[[Any], str] = str
    to_json: Callable[[Any], Any] = lambda value: value


@dataclass(frozen=True)
class Option:
    """What is known of a field besides its type and its default.

    ``help``: one sentence. ``flags``: of the command line, none for what only programs set; ``argument``: it stands
    without a flag. ``minimum`` and ``maximum`` bound numbers, ``choices`` lists the words there are. ``kind``: of
    values that are no number or word. ``default_text``: what help says of a default that is no value. ``several``:
    may be given more than once; the value is a tuple.
    """

    help: str
    flags: tuple[str, ...] = ()
    argument: bool = False
    metavar: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    kind: Kind | None = None
    default_text: str | None = None
    several: bool = False


def option(default: Any, help: str, *flags: str, **more: Any) -> Any:
    """A field of :class:`Settings`; ``more`` as in :class:`Option`. ``...`` for a field that must be given."""
    metadata = {"option": Option(help, flags, **more)}
    if default is ...:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


@dataclass(frozen=True)
class Settings:
    """A group of settings, checked when it is made; raises :class:`InputError` that names a bad one."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if "option" in field.metadata and not _is_default(field, value):
                checked = _checked(option_of(field), type_of(type(self), field.name), value, field.name)
                object.__setattr__(self, field.name, checked)

    def to_json(self) -> dict[str, Any]:
        """All settings as JSON has them, groups in groups."""
        return {field.name: _to_json(field, getattr(self, field.name)) for field in dataclasses.fields(self)}

    @classmethod
    def from_json(cls: type[T], content: Mapping[str, Any]) -> T:
        """What :meth:`to_json` gave; raises :class:`InputError` for names or values that do not belong there."""
        if not isinstance(content, Mapping):
            raise InputError(f"settings: {content!r} are none; give an object of names and values")
        names = {field.name for field in dataclasses.fields(cls)}
        for name in content:
            if name not in names:
                raise InputError(f"settings: '{name}' is unknown; this version has {', '.join(sorted(names))}")
        given = {}
        for name, value in content.items():
            group = group_of(cls, name)
            given[name] = group.from_json(value) if group and value is not None else value
        try:
            return cls(**given)
        except TypeError as error:
            raise InputError(f"settings: {error}") from None

    def changed(self) -> dict[str, Any]:
        """The settings that are not at their defaults."""
        values = ((field, getattr(self, field.name)) for field in dataclasses.fields(self))
        return {field.name: value for field, value in values if not _is_default(field, value)}

    def words(self) -> Iterator[str]:
        """The words of a command line that sets what is not at its default."""
        for field in dataclasses.fields(self):
            value, about = getattr(self, field.name), option_of(field)
            if _is_default(field, value) or not (about.flags or about.argument):
                continue
            for one in value if about.several else (value,):
                shown = about.kind.show(one) if about.kind else str(one)
                # A value that begins with a dash would be taken for a flag.
                joined = f"{about.flags[-1]}={shown}" if about.flags and shown.startswith("-") else None
                if about.argument:
                    yield shown
                elif value is True:
                    yield about.flags[-1]
                elif joined and about.flags[-1].startswith("--"):
                    yield joined
                else:
                    yield from (about.flags[-1], shown)


def option_of(field: dataclasses.Field[Any]) -> Option:
    """What is known of a field."""
    about: Option = field.metadata["option"]
    return about


def command_line(*words: str | Settings) -> str:
    """A command as it is typed in a shell."""
    texts = [text for word in words for text in (word.words() if isinstance(word, Settings) else (word,))]
    return shlex.join(texts)


def documented(*groups: type[Settings], without: tuple[str, ...] = ()) -> Callable[[Function], Function]:
    """Show the fields of ``groups`` in the signature and the docstring of a function that takes them as keywords."""

    def decorate(function: Function) -> Function:
        fields = [field for group in groups for field in dataclasses.fields(group) if field.name not in without]
        own = inspect.signature(function)
        shown = [p for p in own.parameters.values() if p.kind is not inspect.Parameter.VAR_KEYWORD]
        for field in fields:
            default = inspect.Parameter.empty if _required(field) else field.default
            shown.append(
                inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=field.type)
            )
        function.__signature__ = own.replace(parameters=shown)  # type: ignore[attr-defined]
        lines = (f"    ``{field.name}``: {option_of(field).help}" for field in fields)
        function.__doc__ = "\n".join([(function.__doc__ or "").rstrip(), "", "    Settings:", "", *lines, "    "])
        return function

    return decorate


@cache
def _hints(cls: type[Settings]) -> dict[str, Any]:
    return get_type_hints(cls)


def type_of(cls: type[Settings], name: str) -> tuple[type, ...]:
    """The types that a field may have."""
    hint = _hints(cls)[name]  # type: ignore[arg-type]
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def group_of(cls: type[Settings], name: str) -> type[Settings] | None:
    """The class of a field that is a group of settings itself."""
    kinds = [kind for kind in type_of(cls, name) if isinstance(kind, type) and issubclass(kind, Settings)]
    return kinds[0] if kinds else None


def _required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _is_default(field: dataclasses.Field[Any], value: Any) -> bool:
    if _required(field):
        return False
    default = field.default
    if field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
    return type(value) is type(default) and value == default


def _to_json(field: dataclasses.Field[Any], value: Any) -> Any:
    if isinstance(value, Settings):
        return value.to_json()
    about = field.metadata.get("option")
    if about is not None and about.kind is not None and value is not None:
        return [about.kind.to_json(one) for one in value] if about.several else about.kind.to_json(value)
    return list(value) if isinstance(value, tuple) else value


def _checked(about: Option, types: tuple[type, ...], value: Any, name: str) -> Any:
    """``value`` as the field has it; raises :class:`InputError`."""
    if value is None and type(None) in types:
        return None
    if about.several:
        if isinstance(value, str) or not hasattr(value, "__iter__"):
            raise InputError(f"{name}: {value!r} is not a list")
        value = list(value.items()) if isinstance(value, Mapping) else list(value)
        return tuple(_single(about, (str,), one, name) for one in value)
    return _single(about, types, value, name)


def _single(about: Option, types: tuple[type, ...], value: Any, name: str) -> Any:
    if about.kind is not None:
        return about.kind.check(value)
    if bool in types or str in types:
        wanted = bool if bool in types else str
        if str in types and hasattr(value, "__fspath__"):
            value = str(value)
        if not isinstance(value, wanted):
            raise InputError(f"{name}: {value!r} is not of type {wanted.__name__}")
    elif float in types or int in types:
        value = _number(value, float in types, name)
        if about.minimum is not None and value < about.minimum:
            raise InputError(f"{name}: {value} is too small; give at least {about.minimum:g}")
        if about.maximum is not None and value > about.maximum:
            raise InputError(f"{name}: {value} is too large; give at most {about.maximum:.10g}")
    if about.choices and value not in about.choices:
        raise InputError(f"{name}: '{value}' is unknown; use one of {', '.join(about.choices)}")
    return value


def _number(value: Any, real: bool, name: str) -> int | float:
    """A number of Python's own, from one of NumPy's too."""
    try:
        if isinstance(value, (bool, str)):
            raise TypeError
        number: int | float = float(value) if real else value.__index__()
    except (TypeError, ValueError, AttributeError, OverflowError):
        raise InputError(f"{name}: {value!r} is not of type {'float' if real else 'int'}") from None
    if not math.isfinite(number):
        raise InputError(f"{name}: {value} is not a finite number")
    return number
