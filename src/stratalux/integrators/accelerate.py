"""Our integrators in place of Mitsuba's, with the same settings."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from typing import Any

import mitsuba as mi

from ..errors import SceneWarning

OURS = {"direct": "direct_stratified", "path": "path_stratified"}
"""By the type of Mitsuba's."""
KEPT = {"direct": ("hide_emitters",), "path": ("max_depth", "rr_depth", "hide_emitters")}
"""Properties that mean the same. How many samples of which kind ``direct`` takes, ours choose by themselves."""
_AROUND = ("aov", "moment")
"""What has integrators inside."""
_SEALED = {
    f"{kind}Integrator": (name, "once loaded, it does not tell what is inside; give its description")
    for kind, name in (("AOV", "aov"), ("Moment", "moment"))
}
_CLASSES = {"DirectIntegrator": "direct", "PathIntegrator": "path"}
_NO_LIMIT = 0xFFFFFFFF


def accelerate(what: mi.Scene | mi.Integrator | Mapping[str, Any]) -> Any:
    """Ours for what ``what`` is rendered with: ``direct_stratified`` for ``direct``, ``path_stratified`` for ``path``.

    A description, of a scene or of an integrator as :func:`mitsuba.load_dict` takes it, becomes another description,
    inside of ``aov`` and ``moment`` as well. Of a loaded scene or integrator, what is returned is a loaded integrator;
    a scene without any gets ``path_stratified``. ``max_depth``, ``rr_depth`` and ``hide_emitters`` stay. All others are
    returned as they are, with one :class:`SceneWarning`, and so are a ``path`` that leaves no light on surfaces
    (``max_depth`` 0 or 1), and a loaded ``aov`` or ``moment``, which does not tell what is inside.
    """
    if isinstance(what, Mapping):
        return _described(what)
    if isinstance(what, mi.Scene):
        own = what.integrator()
        return mi.load_dict({"type": OURS["path"]}) if own is None else accelerate(own)
    description = description_of(what)
    if description is None:
        if not hasattr(what, "environment_light"):  # as all of ours have
            _leave(*_SEALED.get(what.class_name(), (what.class_name(),)))
        return what
    replaced = _described(description)
    return what if replaced is description else mi.load_dict(replaced)


def description_of(integrator: mi.Integrator) -> dict[str, Any] | None:
    """The description of a loaded ``path`` or ``direct`` of Mitsuba's, as far as :data:`KEPT`; else None."""
    name = _CLASSES.get(integrator.class_name())
    if name is None:
        return None
    found = dict(re.findall(r"(\w+) = (\d+)", str(integrator)))
    numbers = {key: int(found[key]) for key in KEPT[name] if key in found}
    if numbers.get("max_depth") == _NO_LIMIT:
        numbers["max_depth"] = -1
    return {"type": name, **numbers, "hide_emitters": integrator.hide_emitters}


def _described(what: Mapping[str, Any]) -> Any:
    kind = what.get("type")
    if kind == "scene":
        inner = {key: part for key, part in what.items() if _is_integrator(part)}
        if not inner:
            return {**what, "integrator": {"type": OURS["path"]}}
        return {**what, **{key: accelerate(part) for key, part in inner.items()}}
    if kind in _AROUND:
        return {**what, **{key: accelerate(part) for key, part in what.items() if _is_integrator(part)}}
    if kind in OURS.values():
        return what
    if kind not in OURS:
        _leave(str(kind))
        return what
    if kind == "path" and what.get("max_depth", -1) in (0, 1):
        _leave(f"path with max_depth {what['max_depth']}")
        return what
    return {"type": OURS[kind], **{key: what[key] for key in KEPT[kind] if key in what}}


def _is_integrator(part: Any) -> bool:
    if not isinstance(part, Mapping):
        return isinstance(part, mi.Integrator)
    kind = part.get("type", "")
    try:
        return mi.PluginManager.instance().plugin_type(kind) == mi.ObjectType.Integrator
    except RuntimeError:  # what Mitsuba does not know either
        return False


def _leave(name: str, instead: str = "") -> None:
    """Tell that an integrator is left as it is."""
    warnings.warn(f"{name}: left as it is{instead and '; '}{instead}", SceneWarning, stacklevel=3)
