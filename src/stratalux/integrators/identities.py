"""Tables by the number that Dr.Jit gives each shape or BSDF of a scene (Dr.Jit)."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi


def by_identity(pointers: Any, values: mi.UInt32, default: int, another: tuple[Any, int] | None = None) -> mi.UInt32:
    """A table of the ``values`` of ``pointers`` by the number that Dr.Jit gives each, which is not the same twice.

    ``another``: one more pointer, and its value.
    """
    identity = dr.reinterpret_array(mi.UInt32, pointers)
    if another is not None:
        identity = dr.concat((identity, dr.reinterpret_array(mi.UInt32, another[0])))
        values = dr.concat((values, mi.UInt32(another[1])))
    table = dr.full(mi.UInt32, default, int(dr.max(identity)[0]) + 1)
    dr.scatter(table, values, identity)
    dr.eval(table)
    return table


def told(table: mi.UInt32, pointers: Any, default: int, active: mi.Bool | bool = True) -> mi.UInt32:
    """What a :func:`by_identity` table tells of ``pointers``, and the ``default`` of those that are not in it."""
    identity = dr.reinterpret_array(mi.UInt32, pointers)
    known = active & (identity < dr.width(table))
    return dr.select(known, dr.gather(mi.UInt32, table, identity, known), default)
