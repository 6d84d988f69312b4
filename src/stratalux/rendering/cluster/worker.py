"""What a worker does: it loads the scene of a picture once, and makes launches of it."""

from __future__ import annotations

import json
import os
import signal
import socket
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from distributed import WorkerPlugin

from ...errors import InputError
from ...integrators.launches import Arrays, Launch, together
from ...sampling.recording import nobody_else_renders
from ...scenes.load import Loaded
from ..checkpoint import identity_of
from ..identity import differences
from ..ready import loaded_for, ready
from ..settings import PictureSettings
from ..steps import Steps
from ..variants import choose_variant
from .job import Job, Missing, found, settings_of

RESOURCE = "stratalux"
"""Of a worker: it makes launches of one task at a time, with all of its threads."""
_OF_LIMIT = 0.6
"""Of a worker's memory: Dask lets nothing begin beyond 80 %, and has the results of tasks beside."""
_SCENES = 2
"""Kept by a worker."""
_STAGES = 4
"""Whose launches a worker is ready to make: a picture has two of two images at the same time, at most."""

_memory: int | None = None
"""Bytes that launches may take here, with all that the process has, if it is known."""
_renderer = ThreadPoolExecutor(1, "stratalux")
"""Dr.Jit's recordings are for one thread; Dask has several for its tasks."""
_steps: OrderedDict[str, Steps] = OrderedDict()
_launches: OrderedDict[tuple[str, str], Launch] = OrderedDict()
_ahead: tuple[tuple[Any, ...], Loaded] | None = None
"""A scene that was loaded before anybody asked for it, after what it was loaded from."""


class Renderer(WorkerPlugin):
    """Prepares a worker, now or when it joins: Mitsuba's first scene has to be made on a process's main thread."""

    idempotent = True

    def __init__(self, variant: str, ahead: str | None = None, *, local: bool = False) -> None:
        """``ahead``: settings (JSON) of a picture, whose scene is loaded before it is asked for. ``local``: on the
        machine that asks."""
        self.name = f"stratalux-{variant}"
        self._variant, self._ahead, self._local = variant, ahead, local

    async def setup(self, worker: Any) -> None:
        global _memory
        limit = worker.memory_manager.memory_limit
        _memory = int(limit * _OF_LIMIT) if limit else None
        if self._local:  # Ctrl-C reaches all processes of a terminal; it is the first one's to stop
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        dr.set_thread_count(worker.state.nthreads)
        choose_variant(self._variant)
        mi.load_dict({"type": "scene", "shape": {"type": "sphere"}})
        _renderer.submit(nobody_else_renders).result()
        if self._ahead is not None:
            _renderer.submit(_load_ahead, self._ahead)
        await worker.set_resources(**{RESOURCE: 1})


def made(job: Job, files: Mapping[str, bytes], stage: str, known: Mapping[str, Any], first: int, last: int) -> Arrays:
    """The sum of the launches from ``first`` up to ``last``, and the ``seconds`` that they took.

    ``files``: contents of those that a worker has lacked, by their hashes.
    """
    return _renderer.submit(_made, job, files, stage, known, first, last).result()


def in_turn(function: Callable[[Any], Any], part: Any) -> Any:
    """``function`` of ``part``, where everything is rendered."""
    return _renderer.submit(_whatever, function, part).result()


def prepared(job: Job) -> None:
    """Load the scene, if its files are here."""
    with suppress(Missing):
        _renderer.submit(_loaded, job, {}).result()


def added(one: Arrays, other: Arrays) -> Arrays:
    """The sum of what two tasks have made."""
    return together(one, other)


def held(value: Any) -> Any:
    """The same: what is a task's result is found again when the worker that has it is lost."""
    return value


def _whatever(function: Callable[[Any], Any], part: Any) -> Any:
    dr.set_thread_count(max(2, dr.thread_count()))  # with one, Mitsuba waits for ever when it writes OpenEXR
    return function(part)


def _made(job: Job, files: Mapping[str, bytes], stage: str, known: Mapping[str, Any], first: int, last: int) -> Arrays:
    launch = _launch(job, files, stage, known)
    start = time.perf_counter()
    total = launch(first)
    for k in range(first + 1, last):
        total = together(total, launch(k))
    return {**total, "seconds": np.array(time.perf_counter() - start)}


def _scene(picture: PictureSettings) -> Loaded:
    """That of a picture, whether it was loaded ahead or not."""
    global _ahead
    key = picture.scene, picture.camera, picture.machine
    ahead, _ahead = _ahead, None
    if ahead is not None and ahead[0] == key:
        return ahead[1]
    choose_variant(picture.machine.variant)
    return loaded_for(picture)


def _load_ahead(picture: str) -> None:
    """Load the scene of a picture; whatever is wrong with that is told when it is asked for."""
    global _ahead
    found = settings_of(picture, lambda name: os.path.abspath(name) if os.path.isfile(name) else name)
    found = replace(found, machine=replace(found.machine, max_memory=_share(found.machine.max_memory)))
    loaded = _scene(found)
    _ahead = (found.scene, found.camera, found.machine), loaded


def _launch(job: Job, files: Mapping[str, bytes], stage: str, known: Mapping[str, Any]) -> Launch:
    place = job.key, stage
    if place not in _launches:
        steps = _loaded(job, files)
        while len(_launches) >= _STAGES:
            _launches.popitem(last=False)
        _launches[place] = steps.launch(stage, dict(known))
    _launches.move_to_end(place)
    return _launches[place]


def _loaded(job: Job, files: Mapping[str, bytes]) -> Steps:
    if job.key not in _steps:
        paths = found(job, files)  # once: it reads all of them
        while len(_steps) >= _SCENES:
            gone, _ = _steps.popitem(last=False)
            for place in [place for place in _launches if place[0] == gone]:
                del _launches[place]
        picture = job.settings(paths)
        picture = replace(picture, machine=replace(picture.machine, max_memory=_share(picture.machine.max_memory)))
        loaded = _scene(picture)
        prepared = ready(loaded, picture)
        _check(job, identity_of(loaded.scene, prepared.picture))
        _steps[job.key] = prepared.steps
    _steps.move_to_end(job.key)
    return _steps[job.key]


def _share(asked: int | None) -> int | None:
    """Of the memory that Dask gives this worker, which it ends beyond that: less than the one that is asked for."""
    if _memory is None:
        return asked
    return _memory if asked is None else min(asked, _memory)


def _check(job: Job, identity: Mapping[str, Any]) -> None:
    """Raise :class:`InputError` if this worker would render another picture."""
    wanted = json.loads(job.identity)
    own = json.loads(json.dumps({name: identity[name] for name in wanted}))
    for name, there, here in differences(wanted, own):
        what = f"another {name}" if name in ("map", "scene") else f"{name} {here} instead of {there}"
        raise InputError(f"cluster: the worker on {socket.gethostname()} has {what}; install and mount the same there")
