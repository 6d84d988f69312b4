"""Dr.Jit code that is traced and compiled once, and replayed from then on; and threads, which that does not suit."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, TypeVar
from weakref import WeakSet

import drjit as dr
import mitsuba as mi

Function = TypeVar("Function", bound=Callable[..., Any])
Item = TypeVar("Item")

_turn = threading.RLock()
"""Held by the thread that prepares or renders."""
_users: WeakSet[threading.Thread] = WeakSet()
"""Those that have ever done so."""


@contextmanager
def _in_turn() -> Iterator[None]:
    _users.add(threading.current_thread())
    with _turn:
        yield


def one_at_a_time(function: Function) -> Function:
    """``function``, which threads execute one after the other."""

    @wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        with _in_turn():
            return function(*arguments, **options)

    return call  # type: ignore[return-value]


def step_by_step(steps: Iterator[Item]) -> Iterator[Item]:
    """``steps``, each without derivatives, and one thread at a time; between them others may go on."""
    while True:
        with _in_turn(), dr.suspend_grad():
            try:
                step = next(steps)
            except StopIteration:
                return
        yield step


def recorded(function: Function, **options: Any) -> Function:
    """``function``, recorded by :func:`drjit.freeze` for each variant and each layout of its arguments.

    The widths of arrays may change from call to call. ``options`` are those of :func:`drjit.freeze`. It takes all
    objects of Mitsuba for arguments, those of other scenes too, and gives them their arrays back at the end. So where
    another thread may be rendering, nothing is recorded or replayed (Dr.Jit 1.5.0: wrong pictures, or none).
    """
    recordings: dict[str, Function] = {}

    @wraps(function)
    def call(*arguments: Any) -> Any:
        with _in_turn():
            if not _alone():
                return function(*arguments)
            variant = mi.variant()
            if variant not in recordings:
                recordings[variant] = dr.freeze(function, **{"warn_after": 1 << 30, **options})
            with _no_garbage_collection():
                return recordings[variant](*arguments)

    return call  # type: ignore[return-value]


def _alone() -> bool:
    """Whether no other thread seems to render: one that ever has, or any but the daemons of progress bars and such."""
    me = threading.current_thread()
    return all(thread is me or (thread.daemon and thread not in _users) for thread in threading.enumerate())


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
