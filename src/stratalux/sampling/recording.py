"""Dr.Jit code that is traced: without garbage collection, one thread at a time, and once where it can be replayed."""

from __future__ import annotations

import gc
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import wraps
from itertools import count
from typing import Any, TypeVar
from weakref import WeakSet

import drjit as dr
import mitsuba as mi

Function = TypeVar("Function", bound=Callable[..., Any])
Item = TypeVar("Item")

_LONG = 5.0
"""Seconds, far more than Dr.Jit looks through arguments for, and few enough for what shows progress in a thread."""
_turn = threading.RLock()
"""Held by the thread that prepares or renders."""
_users: WeakSet[threading.Thread] = WeakSet()
"""Those that have ever done so."""
_traced: list[float] = []
"""Seconds that went into what was recorded since somebody has asked."""
_only: threading.Thread | None = None
"""The one that nobody else renders beside, if it has said so."""


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


def seconds_of_recordings() -> float:
    """That have gone into tracing and compiling what was recorded since it was asked last."""
    total = sum(_traced)
    _traced.clear()
    return total


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
            replay = recordings[variant]
            before, start = replay.n_recordings, time.perf_counter()  # type: ignore[attr-defined]
            try:
                with no_garbage_collection(), _no_other_thread():
                    return replay(*arguments)
            finally:
                if replay.n_recordings != before:  # type: ignore[attr-defined]
                    _traced.append(time.perf_counter() - start)

    return call  # type: ignore[return-value]


@contextmanager
def _no_other_thread() -> Iterator[None]:
    """Python goes on with this thread until it waits for something.

    Dr.Jit looks through the arguments of what is recorded with a lock taken, by Python code too. A thread that got its
    turn there and let go of an array would wait for that lock, and this thread for Python's: for ever (Dr.Jit 1.5.0).
    Dr.Jit has such a thread itself, for arrays that came to it from NumPy, and to NumPy from Dr.Jit.
    """
    before = sys.getswitchinterval()
    sys.setswitchinterval(_LONG)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


def living_bsdfs() -> list[mi.BSDF]:
    """All there are, those that belong to no scene too: as soon as there is one more kind of BSDF, each call of one may
    be a call of any, and :func:`drjit.freeze` wants to know all that it may read."""
    found: list[mi.BSDF] = []
    with suppress(RuntimeError):  # beyond the last one
        for number in count(1):
            bsdf = dr.reinterpret_array(mi.BSDFPtr, mi.UInt32(number))[0]
            if bsdf is not None:  # one that is gone has left its number
                found.append(bsdf)
    return found


def nobody_else_renders() -> None:
    """A promise of the thread that calls it: whatever other threads there are, they do not render."""
    global _only
    _only = threading.current_thread()


def _alone() -> bool:
    """Whether no other thread seems to render: one that ever has, or any but the daemons of progress bars and such."""
    me = threading.current_thread()
    if me is _only:
        return all(thread is me or thread not in _users for thread in threading.enumerate())
    return all(thread is me or (thread.daemon and thread not in _users) for thread in threading.enumerate())


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
