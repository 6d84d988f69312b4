"""Dr.Jit code that is traced and compiled once, and replayed from then on."""

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
        with _no_garbage_collection():
            return recordings[variant](*arguments)

    return call  # type: ignore[return-value]


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    """A scene that is freed while a function is recorded aborts the process (Dr.Jit 1.5.0)."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
