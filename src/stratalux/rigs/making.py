"""Lights as the settings ask for them."""

from __future__ import annotations

from dataclasses import replace

from ..maps.envmap import EnvironmentMap
from . import LightRig, light_rig
from .fitted import fitted, sun_and_sky
from .lights import Lights
from .quality import quality
from .settings import RigSettings


def make_lights(environment: EnvironmentMap, settings: RigSettings) -> tuple[Lights, LightRig | None]:
    """The lights of a map, with their errors, and their strata where the technique has these.

    Raises :class:`InputError` as the techniques do.
    """
    rig = None
    if settings.sun:
        made = sun_and_sky(environment, ambient=settings.ambient or "sh2")
    elif settings.method == "fitted":
        made = fitted(environment, settings.lights, ambient=settings.ambient or "none")
    else:
        rig = light_rig(settings.method, environment, settings.lights)
        made = rig.lights()
    return replace(made, map=settings.source, quality=quality(environment, made)), rig
