"""Light rigs: an environment map as a few directional lights, by the techniques that the field compares.

A technique is a function ``technique(environment, n, **options) -> LightRig``. All of them conserve energy: the colours
of a rig add up to ∫ L dω over the sphere. The number of lights is ``n``, or fewer where a map has less to tell apart,
such as a few lit texels on black. On a map that is all black, solid angle is distributed in place of energy (median cut
has one light there). To add a technique, write it in a file of its own and name it in :data:`RIGS`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from ..errors import InputError
from ..maps.envmap import EnvironmentMap
from .kmeans import kmeans
from .lloyd import lloyd
from .median_cut_lights import median_cut_lights
from .penrose import penrose
from .rig import LightRig, rig_from_labels
from .structured import structured

__all__ = [
    "RIGS",
    "LightRig",
    "Method",
    "kmeans",
    "light_rig",
    "lloyd",
    "median_cut_lights",
    "penrose",
    "rig_from_labels",
    "structured",
]


Method = Callable[..., LightRig]
"""``technique(environment, n, **options)``, the options being keyword-only and having defaults.

Returns at most ``n`` lights; raises :class:`InputError` if ``n`` is less than 1 or more than the number of texels.
"""

RIGS: dict[str, Method] = {
    "median-cut": median_cut_lights,
    "structured": structured,
    "kmeans": kmeans,
    "lloyd": lloyd,
    "penrose": penrose,
}
"""The techniques by name."""


def light_rig(method: str, environment: EnvironmentMap, n: int, **options: Any) -> LightRig:
    """The rig of ``n`` lights by the technique named ``method`` in :data:`RIGS`, with its own ``options``.

    Raises :class:`InputError` if the technique or an option is unknown, or as the technique does.
    """
    if method not in RIGS:
        raise InputError(f"light rig: method {method!r} is unknown; give one of {', '.join(RIGS)}")
    known = list(inspect.signature(RIGS[method]).parameters)[2:]
    for option in options:
        if option not in known:
            raise InputError(f"light rig {method}: option {option!r} is unknown; it has {', '.join(known) or 'none'}")
    return RIGS[method](environment, n, **options)
