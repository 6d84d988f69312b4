"""Makes the launches of a picture on a Dask cluster.

Launches are cut into batches. Each batch is as many tasks as there are workers; a task makes launches that follow each
other, and what the tasks bring is added up on the workers, two and two, so that one sum comes here for each batch. What
a task makes depends on nothing but the picture and its numbers, so it can be made again anywhere: a task of a worker
that is lost, or that does not answer, is given to another, and of several answers one counts.
"""

from __future__ import annotations

import importlib.util
import logging
import multiprocessing
import os
import threading
import warnings
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any
from uuid import uuid4

import dask
from distributed import CancelledError, Client, Future, LocalCluster, as_completed, wait
from distributed import TimeoutError as Late
from distributed.utils import get_mp_context

from ...errors import InputError, SceneWarning
from ...integrators.launches import Arrays, Launch
from . import LOCAL
from .job import Job, Missing
from .worker import RESOURCE, Renderer, added, held, made, prepared

_SHORTEST = 1.0
"""Seconds that a task takes at least, where there is enough to do: less is lost between tasks."""
_TRANSFERS = 20
"""So many times as long as sending its result does."""
_BANDWIDTH = 1e9
"""Bytes per second, about."""
_PATIENCE, _TIMES = 120.0, 10
"""Seconds, and times the longest wait so far, after which a task without an answer goes to another worker, too."""
_TRIES = 10
"""Of a task, until its failure is told."""
_AHEAD = 3
"""Tasks for each worker that wait or are under way."""
_CONNECT = "30s"
_SETTINGS = {
    "distributed.admin.large-graph-warning-threshold": "1TB",  # pictures are large
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.worker.memory.monitor-interval": "500ms",
    "distributed.worker.profile.enabled": False,
}
"""Of Dask, here and in processes of this machine. As it is, it looks after each process fifty times a second, which
takes 3 to 4 % of a processor for each."""


@contextmanager
def cluster(where: str, variant: str, processes: Processes | None = None) -> Iterator[Cluster]:
    """The cluster at the address ``where``, or that of the ``processes`` of this machine that have been started.
    Raises :class:`InputError` if there is none."""
    if processes is not None or where.startswith(LOCAL):
        with closing(processes or Processes(where, variant)) as local:
            yield local.ready()
        return
    with _quietly():
        try:
            client = Client(where, timeout=_CONNECT, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, ValueError, Late) as error:
            raise InputError(f"cluster {where}: there is no scheduler ({' '.join(str(error).split())[:100]})") from None
        with client:
            yield Cluster(where, client, Renderer(variant))


@contextmanager
def _quietly() -> Iterator[None]:
    """What matters is told in one line."""
    for name in ("distributed", "distributed.client", "distributed.worker", "distributed.nanny"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with dask.config.set(_SETTINGS):
        yield


class Processes:
    """Those of ``local:N``, which share the processors. They start while this process does something else; with the
    settings of a ``picture`` (JSON), they load its scene at once."""

    def __init__(self, where: str, variant: str, picture: str | None = None) -> None:
        self._where = where
        self._made = ExitStack()
        self._cluster: Cluster | None = None
        self._failed: Exception | None = None
        self._thread = threading.Thread(target=self._start, args=(Renderer(variant, picture, local=True),), daemon=True)
        self._thread.start()

    def _start(self, renderer: Renderer) -> None:
        count = int(self._where.removeprefix(LOCAL))
        try:
            self._made.enter_context(_quietly())
            if "forkserver" in multiprocessing.get_all_start_methods():
                self._made.enter_context(dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"}))
                get_mp_context()  # it names some of Dask's own first
                multiprocessing.set_forkserver_preload(["distributed", f"{__package__}.worker"])
            local = LocalCluster(  # type: ignore[no-untyped-call]
                n_workers=count,
                threads_per_worker=max(1, (os.cpu_count() or 1) // count),
                dashboard_address=":0",
                silence_logs=logging.CRITICAL,
            )
            self._made.enter_context(local)
            client = self._made.enter_context(Client(local, set_as_default=False))  # type: ignore[no-untyped-call]
            self._cluster = Cluster(self._where, client, renderer)
        except Exception as error:
            self._failed = error

    def ready(self) -> Cluster:
        """They, when they have started. Raises :class:`InputError` if they cannot."""
        self._thread.join()
        if isinstance(self._failed, (RuntimeError, OSError, Late)):
            why = " ".join(str(self._failed).split())[:100]
            raise InputError(f"cluster {self._where}: cannot be started ({why})") from None
        if self._failed is not None:
            raise self._failed
        assert self._cluster is not None
        return self._cluster

    def close(self) -> None:
        """End them."""
        self._thread.join()
        self._made.close()


@dataclass
class _Task:
    """Launches from ``first`` up to ``last``, at one worker or, where that one is late, at several."""

    first: int
    last: int
    futures: list[Future] = field(default_factory=list)
    tries: int = 0


class Cluster:
    """Workers that are prepared, and what they are given to do."""

    def __init__(self, where: str, client: Client, renderer: Renderer) -> None:
        self._where, self._client = where, client
        self._files: dict[str, Future] = {}
        self._alone = False
        client.register_plugin(renderer)  # type: ignore[no-untyped-call]
        if not self._workers:
            warnings.warn(f"cluster {where}: waiting for its first worker", SceneWarning, stacklevel=4)
            client.wait_for_workers(1)  # type: ignore[no-untyped-call]

    def __str__(self) -> str:
        count = self._workers
        dashboard = f"; dashboard {self._client.dashboard_link}" if importlib.util.find_spec("bokeh") else ""
        return f"{count} worker{'s' if count != 1 else ''}{dashboard}"

    @property
    def _workers(self) -> int:
        return len(self._client.nthreads())  # type: ignore[no-untyped-call]

    def maker(self, job: Job) -> Maker:
        """Who makes the launches of that picture."""
        return Maker(self, job)

    def submit(self, function: Any, *arguments: Any, **options: Any) -> Future:
        """A task of its own, whatever other ones there are."""
        key = f"stratalux-{function.__name__}-{uuid4().hex}"
        future: Future = self._client.submit(function, *arguments, key=key, pure=False, **options)  # type: ignore[no-untyped-call]
        return future

    def everywhere(self, function: Any, *arguments: Any) -> list[Future]:
        """The same task for each worker that is there now."""
        addresses = self._client.nthreads()  # type: ignore[no-untyped-call]
        return [self.submit(function, *arguments, workers=[address]) for address in addresses]

    def one_of_each_machine(self) -> list[str]:
        """Addresses of workers, no two of them on one machine."""
        found = self._client.scheduler_info(n_workers=-1)["workers"]  # type: ignore[no-untyped-call]
        return list({worker["host"]: address for address, worker in sorted(found.items())}.values())

    def sent(self, job: Job, hashes: list[str]) -> dict[str, Future]:
        """Files that a worker lacks, on their way, by the hashes of their contents."""
        for file in job.files:
            future = self._files.get(file.sha256)
            if file.sha256 in hashes and (future is None or future.status not in ("pending", "finished")):
                self._files[file.sha256] = self.submit(held, Path(file.path).read_bytes())
        return {sha256: self._files[sha256] for sha256 in hashes}

    def lost(self, why: str) -> InputError:
        """The error that says so."""
        return InputError(f"cluster {self._where}: {why}")

    @property
    def width(self) -> int:
        """How many tasks run at the same time."""
        return max(1, self._workers)

    def check(self) -> None:
        """Raise :class:`InputError` if nobody is there any more, and say so if nobody is there now."""
        if self._client.status != "running":
            raise self.lost("the connection to the scheduler is lost")
        if self._workers:
            self._alone = False
        elif not self._alone:
            warnings.warn(f"cluster {self._where}: no worker is left; waiting for others", SceneWarning, stacklevel=5)
            self._alone = True

    def wait(self, futures: list[Future], seconds: float) -> None:
        """Until one of them has an answer. Raises :class:`Late`."""
        with self._client.as_current():  # type: ignore[no-untyped-call]
            wait(futures, timeout=seconds, return_when="FIRST_COMPLETED")  # type: ignore[no-untyped-call]

    def as_they_come(self, futures: list[Future]) -> Iterator[Future]:
        """One after the other, when it has an answer."""
        found: Iterator[Future] = iter(as_completed(futures, loop=self._client.loop))  # type: ignore[no-untyped-call]
        return found

    def forget(self, futures: list[Future]) -> None:
        """What nobody waits for any more."""
        if futures and self._client.status == "running":
            self._client.cancel(futures, force=True)  # type: ignore[no-untyped-call]


def launches_of_a_task(seconds: float, size: int, bandwidth: float = _BANDWIDTH) -> int:
    """How many, if each takes so many ``seconds`` and their sum has so many bytes."""
    return max(1, round(max(_SHORTEST, _TRANSFERS * size / bandwidth) / max(seconds, 1e-6)))


class Maker:
    """See :class:`~...integrators.launches.Maker`."""

    def __init__(self, cluster: Cluster, job: Job) -> None:
        self._cluster, self._job = cluster, job
        self._longest = 0.0
        # The others load the scene while the first one is at the first launch.
        self._ready = cluster.everywhere(prepared, job)

    def __call__(
        self, stage: str, known: Mapping[str, Any], first: int, count: int, launch: Launch
    ) -> Iterator[tuple[int, Arrays]]:
        batches: deque[list[_Task]] = deque()
        about = _Known(self._cluster, known)
        each = 1  # Launches of a task
        try:
            while first < count or batches:
                while first < count and sum(map(len, batches)) < _AHEAD * self._cluster.width:
                    # The first one is a launch, so that what begins with it is the same everywhere.
                    tasks = 1 if first == 0 else self._cluster.width
                    batch = []
                    for _ in range(tasks):
                        if first < count:
                            batch.append(_Task(first, min(first + each, count)))
                            first = batch[-1].last
                            self._give(batch[-1], stage, about)
                    batches.append(batch)
                batch = batches[0]
                total = dict(self._gathered(batch, stage, about))
                batches.popleft()
                seconds = float(total.pop("seconds")) / (batch[-1].last - batch[0].first)
                size = sum(value.nbytes for value in total.values())
                each = launches_of_a_task(seconds, size)
                yield batch[-1].last, total
        finally:
            self._cluster.forget([future for batch in batches for task in batch for future in task.futures])

    def _give(self, task: _Task, stage: str, about: _Known, files: Mapping[str, Future] = MappingProxyType({})) -> None:
        arguments = self._job, dict(files), stage, about.future, task.first, task.last
        # Those that come first are done first: their sum is what is waited for.
        task.futures.append(self._cluster.submit(made, *arguments, resources={RESOURCE: 1}, priority=-task.first))

    def _gathered(self, batch: list[_Task], stage: str, about: _Known) -> Arrays:
        """The sum of what a batch brings."""
        while True:
            done = self._finished(batch, stage, about)
            while len(done) > 1:
                pairs = [self._cluster.submit(added, *pair) for pair in zip(done[::2], done[1::2], strict=False)]
                done = [*pairs, *done[len(pairs) * 2 :]]
            try:
                total: Arrays = done[0].result()  # type: ignore[no-untyped-call]
                return total
            except Exception as error:  # of a worker: whatever it is, others may do better
                for task in batch:
                    self._again(task, stage, about, error)

    def _finished(self, batch: list[_Task], stage: str, about: _Known) -> list[Future]:
        """One answer for each task."""
        done: dict[int, Future] = {}
        waited = 0.0
        while len(done) < len(batch):
            open_ = {future: task for task in batch if task.first not in done for future in task.futures}
            try:
                self._cluster.wait(list(open_), _PATIENCE / 8)
                self._longest, waited = max(self._longest, waited), 0.0
            except Late:
                self._cluster.check()
                waited += _PATIENCE / 8
                if waited > max(_PATIENCE, _TIMES * self._longest):
                    for task in batch:
                        if task.first not in done:
                            self._give(task, stage, about)
                    waited = 0.0
                continue
            except (CancelledError, OSError):
                self._cluster.check()
            for future, task in open_.items():
                if future.status == "finished":
                    done.setdefault(task.first, future)
                elif future.status != "pending":
                    task.futures.remove(future)
                    if not task.futures:
                        self._again(task, stage, about, _failure(future))
        for task in batch:
            self._cluster.forget([future for future in task.futures if future is not done[task.first]])
        return [done[task.first] for task in batch]

    def _again(self, task: _Task, stage: str, about: _Known, error: BaseException | None) -> None:
        """Give a task to another worker, as it has ended with an ``error``."""
        self._cluster.check()
        if isinstance(error, InputError):
            raise error
        if isinstance(error, Missing):
            self._give(task, stage, about, self._cluster.sent(self._job, error.hashes))
            return
        task.tries += 1
        if task.tries >= _TRIES:
            raise self._cluster.lost(f"launch {task.first} of {stage} has failed {_TRIES} times ({error})")
        about.renew()
        self._give(task, stage, about)


class _Known:
    """What the launches of a stage depend on: sent once, and passed on from worker to worker."""

    def __init__(self, cluster: Cluster, known: Mapping[str, Any]) -> None:
        self._cluster, self._known = cluster, dict(known)
        self.future = cluster.submit(held, self._known)

    def renew(self) -> None:
        """Send it again if it is lost."""
        if self.future.status in ("lost", "cancelled", "error"):
            self.future = self._cluster.submit(held, self._known)


def _failure(future: Future) -> BaseException | None:
    """What it has ended with."""
    if future.status == "error":
        error: BaseException = future.exception()  # type: ignore[no-untyped-call]
        return error
    return None
