"""Derivatives of a picture: what is sampled is held fixed, and what is evaluated there is differentiated.

An estimate Σ_j f(x_j) / p(x_j) has the derivative Σ_j f'(x_j) / p(x_j) if its directions x_j, their densities p and all
weights are constants. It is unbiased for what reflects and shines, whatever the samples were made for. It is wrong for
what moves, as the places where light begins to be blocked move along (Vicini, Speierer and Jakob 2021).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import drjit as dr
import mitsuba as mi

from ..errors import InputError

SUM = -1
"""Hint for the loops of sums: Dr.Jit differentiates them backward term by term, and keeps none of them in memory."""
_TRANSMISSION = {"opacity", "weight", "eta", "specular_transmittance"}
"""Parameters of BSDFs on which the transmission of their ``Null`` lobes depends."""


def parameters(part: mi.Object) -> Iterator[tuple[str, Any]]:
    """Names and values of what Mitsuba lets be changed of a scene or a part of one; not those that are not set."""
    params = mi.traverse(part)
    for name in params.keys():  # noqa: SIM118
        try:
            yield name, params[name]
        except TypeError:  # what Mitsuba 3.9 makes of None, as ``hair`` has it
            continue


def wanted(scene: mi.Scene) -> bool:
    """Whether Dr.Jit records derivatives now, and something in ``scene`` has them."""
    probe = mi.Float(0)
    dr.enable_grad(probe)
    return dr.grad_enabled(probe) and any(dr.grad_enabled(value) for _, value in parameters(scene))


def refuse_transmission(scene: mi.Scene) -> None:
    """Raise :class:`InputError` if what surfaces let through straight on changes with what is differentiated."""
    params = mi.traverse(scene)
    for name, (_, _, node, _) in params.properties.items():
        if _TRANSMISSION.isdisjoint(name.split(".")):
            continue
        while node is not None and not (isinstance(node, mi.BSDF) and mi.has_flag(node.flags(), mi.BSDFFlags.Null)):
            node = params.hierarchy[node][0]
        if node is not None and dr.grad_enabled(params[name]):
            raise InputError(
                f"no derivatives for '{name}': which rays pass a surface depends on it; use Mitsuba's 'prb' for those"
            )


def refuse_motion(scene: mi.Scene, sensor: mi.Sensor | int) -> None:
    """Raise :class:`InputError` if shapes or the camera move with what is differentiated."""
    sensor = scene.sensors()[sensor] if isinstance(sensor, int) else sensor
    moving = ["shapes"] if scene.shapes_grad_enabled() else []
    moving += ["the camera"] if any(dr.grad_enabled(value) for _, value in parameters(sensor)) else []
    if moving:
        raise InputError(
            f"no derivatives for the motion of {' and '.join(moving)}: edges of shadows would be left out; "
            "use Mitsuba's 'direct_projective' for those"
        )
