"""Dr.Jit code that is traced: without Python's garbage collector, and once only where it can be replayed."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, TypeVar

import drjit as dr
import mitsuba as mi

Function = TypeVar("Function", bound=Callable[..., Any])


def recorded(function: Function, **options: Any) -> Function:
    """``function``, recorded by :func:`drjit.freeze` for each variant and each layout of its arguments.

    The widths of arrays may change from call to call. ``options`` are those of :func:`drjit.freeze`.
    """
    recordings: dict[str, Function] = {}

    @wraps(function)
    def call(*arguments: Any) -> Any:
        variant = mi.variant()
        if variant not in recordings:
            recordings[variant] = dr.freeze(function, **{"warn_after": 1 << 30, **options})
        with no_garbage_collection():
            return recordings[variant](*arguments)

    return call  # type: ignore[return-value]


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """While Dr.Jit traces, no scene of the past may be freed: that aborts the process (Dr.Jit 1.5.0).

    A method is compiled as a function of one kind if a single object of its class is known, and of another kind if
    there are several. If one kernel calls it before and after the other objects are freed, both kinds come out alike,
    with one name: LLVM ends with "invalid redefinition of function". And what is freed while :func:`drjit.freeze`
    records ends with "this function cannot be recorded".
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
