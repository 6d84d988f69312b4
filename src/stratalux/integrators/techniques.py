"""The techniques that can be named and compared, all through one interface.

A technique is one file in :mod:`.integrators` and one line in :data:`.plugins.INTEGRATORS`. The file
says what it is in ``TECHNIQUES``; the command line, the comparison and the tests pick it up there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..errors import InputError

Value = bool | int | float | str


@dataclass(frozen=True)
class Property:
    """A property of an integrator: its default, which also gives its type, and what it means.

    ``minimum`` and ``maximum`` bound numbers, which are counts, and some may be ``barred``, for a reason; ``choices``
    lists the admissible strings.
    """

    default: Value
    meaning: str
    minimum: float | None = None
    choices: tuple[str, ...] = ()
    maximum: float = 1 << 20
    barred: Mapping[Value, str] = field(default_factory=dict)

    def parse(self, text: str, name: str) -> Value:
        """The value that ``text`` denotes; raises :class:`InputError`."""
        kind = type(self.default)
        try:
            value: Value = {"true": True, "false": False}[text.lower()] if kind is bool else kind(text)
        except (KeyError, ValueError):
            raise InputError(f"{name}: '{text}' is not of type {kind.__name__}") from None
        return self.check(value, name)

    def check(self, value: Any, name: str) -> Value:
        """``value`` if it is admissible; raises :class:`InputError` otherwise."""
        kind = type(self.default)
        if kind is float and type(value) is int:
            value = float(value)
        if type(value) is not kind:
            raise InputError(f"{name}: {value!r} is not of type {kind.__name__}")
        if self.minimum is not None and not isinstance(value, str) and value < self.minimum:
            raise InputError(f"{name}: {value!r} is too small; give at least {self.minimum:g}")
        if not isinstance(value, str) and value > self.maximum:
            raise InputError(f"{name}: {value!r} is too large; give at most {self.maximum:.10g}")
        if value in self.barred:
            raise InputError(f"{name}: {value!r} {self.barred[value]}")
        if self.choices and value not in self.choices:
            raise InputError(f"{name}: '{value}' is unknown; use one of {', '.join(self.choices)}")
        return value


@dataclass(frozen=True)
class Technique:
    """An estimator of direct light that can be run on any scene by name.

    ``plugin``: type of the Mitsuba integrator. ``fixed``: properties that make the plugin this technique. ``rays``: the
    properties that count rays per shading point; the first of them is what a comparison varies. A technique without
    such properties traces ``rays_per_sample`` rays, and a comparison varies its samples per pixel. ``pinned``: defaults
    that replace those of ``properties`` as soon as one of them is given; until then the technique chooses by itself,
    with up to ``automatic_rays`` rays. ``needs_rays``: those that ``rays`` names cannot all be 0.
    """

    name: str
    plugin: str
    summary: str
    source: str
    unbiased: bool
    properties: Mapping[str, Property] = field(default_factory=dict)
    fixed: Mapping[str, Value] = field(default_factory=dict)
    rays: tuple[str, ...] = ()
    rays_per_sample: int = 0
    pinned: Mapping[str, Value] = field(default_factory=dict)
    automatic_rays: int = 0
    needs_rays: bool = False

    def settings(self, given: Mapping[str, Value] | None = None) -> dict[str, Value]:
        """All properties, ``given`` ones checked and the others at their defaults; raises :class:`InputError`."""
        given = given or {}
        for name in given:
            if name not in self.properties:
                known = ", ".join(self.properties) or "none"
                raise InputError(f"technique {self.name}: no property '{name}'; it has {known}")
        defaults = {name: prop.default for name, prop in self.properties.items()}
        settings = defaults | {
            name: self.properties[name].check(value, f"technique {self.name}: {name}") for name, value in given.items()
        }
        if self.needs_rays and not any(settings[name] for name in self.rays):
            raise InputError(f"technique {self.name}: {' and '.join(self.rays)} are all 0; give one of them at least 1")
        if settings == defaults:
            return settings
        return settings | {name: value for name, value in self.pinned.items() if settings[name] == defaults[name]}

    def is_automatic(self, given: Mapping[str, Value] | None = None) -> bool:
        """Whether the technique chooses its rays by itself."""
        defaults = {name: prop.default for name, prop in self.properties.items()}
        return bool(self.pinned) and self.settings(given) == defaults

    def integrator(self, given: Mapping[str, Value] | None = None) -> dict[str, Value]:
        """Dictionary for ``mi.load_dict``."""
        return {"type": self.plugin, **self.settings(given), **self.fixed}

    def shadow_rays(self, given: Mapping[str, Value] | None = None) -> int:
        """Rays that one camera sample sends from its shading point, at most."""
        settings = self.settings(given)
        if self.is_automatic(given):
            return self.automatic_rays
        return sum(int(settings[name]) for name in self.rays) + self.rays_per_sample

    def with_rays(self, count: int, given: Mapping[str, Value] | None = None) -> tuple[dict[str, Value], int]:
        """Properties and samples per pixel with which a shading point gets ``count`` rays, or as many as come next.

        What ``given`` sets stays as it is, so a technique whose number of rays is set there is given more samples, and
        so is one that cannot take as many rays at once.
        """
        given = dict(given or {})
        if self.rays and self.rays[0] not in given and not self.is_automatic(given):
            others = self.shadow_rays({**given, self.rays[0]: 1}) - 1
            samples = math.ceil(count / (self.properties[self.rays[0]].maximum + others))
            given[self.rays[0]] = max(1, math.ceil(count / samples) - others)
        return given, max(1, round(count / max(1, self.shadow_rays(given))))


def techniques() -> dict[str, Technique]:
    """All techniques by name. Mitsuba must be importable and a vectorised variant active."""
    from .plugins import integrator_modules

    return {technique.name: technique for module in integrator_modules() for technique in module.TECHNIQUES}


def parse_technique(text: str) -> tuple[Technique, dict[str, Value]]:
    """Read ``NAME[:key=value,...]``; raises :class:`InputError` that lists what is known."""
    name, _, tail = text.partition(":")
    known = techniques()
    if name not in known:
        raise InputError(f"technique '{name}' is unknown; use one of {', '.join(known)}")
    technique, given = known[name], {}
    for part in filter(None, tail.split(",")):
        key, separator, value = part.partition("=")
        if not separator:
            raise InputError(f"technique {name}: '{part}' is not key=value")
        if key not in technique.properties:
            raise InputError(
                f"technique {name}: no property '{key}'; it has {', '.join(technique.properties) or 'none'}"
            )
        given[key] = technique.properties[key].parse(value, f"technique {name}: {key}")
    return technique, given


def properties_from(technique: Technique, props: Any) -> dict[str, Value]:
    """Read a technique's properties from ``mi.Properties``; raises :class:`InputError` that names a bad one."""
    return technique.settings({name: props[name] for name in technique.properties if name in props})
