"""What is recorded once, when it is not, and who waits for whom."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import pytest

from stratalux.sampling import recording
from stratalux.sampling.recording import (
    no_garbage_collection,
    one_at_a_time,
    recorded,
    seconds_of_recordings,
    step_by_step,
)
from tests.helpers import PATIENCE
from tests.variants import MONO


@pytest.fixture
def thread() -> Iterator[Callable[..., threading.Thread]]:
    """Starts threads that do something, and then live until the test ends."""
    end, threads = threading.Event(), []

    def start(work: Callable[[], object], *, daemon: bool) -> threading.Thread:
        done = threading.Event()

        def run() -> None:
            work()
            done.set()
            end.wait(PATIENCE)

        made = threading.Thread(target=run, daemon=daemon)
        threads.append(made)
        made.start()
        assert done.wait(PATIENCE)
        return made

    yield start
    end.set()
    for each in threads:
        each.join(PATIENCE)


def counted() -> tuple[Any, list[bool]]:
    """A recorded function, and a list that grows where its Python code runs: whether garbage was collected there."""
    ran: list[bool] = []
    # Not the list itself, of which the layout would be one of an argument.
    notes = type("Notes", (), {"take": staticmethod(lambda: ran.append(gc.isenabled()))})

    def double(x: mi.Float) -> mi.Float:
        notes.take()
        return 2 * x

    return recorded(double), ran


def values(*x: float) -> mi.Float:
    made = mi.Float(x)
    dr.eval(made)
    return made


def test_a_function_is_traced_once_for_each_variant() -> None:
    double, ran = counted()
    for x in ([1.0, 2.0], [3.0, 4.0], [5.0, 6.0, 7.0]):
        assert double(values(*x)).numpy().tolist() == [2 * v for v in x]
    assert ran == [False]  # nor was any garbage collected
    mi.set_variant(MONO)
    assert double(values(8.0, 9.0)).numpy().tolist() == [16, 18]
    assert len(ran) == 2


def test_nothing_is_recorded_where_another_thread_may_render(thread: Callable[..., threading.Thread]) -> None:
    double, ran = counted()
    thread(lambda: None, daemon=True)  # a progress bar's
    for _ in range(2):
        double(values(1.0, 2.0))
    assert len(ran) == 1
    other = thread(one_at_a_time(lambda: None), daemon=True)  # this one has rendered
    assert other in recording._users
    for _ in range(2):
        assert double(values(1.0, 2.0)).numpy().tolist() == [2, 4]
    assert len(ran) == 3


def test_threads_that_outlive_the_program_may_render(thread: Callable[..., threading.Thread]) -> None:
    double, ran = counted()
    thread(lambda: None, daemon=False)
    for _ in range(2):
        double(values(1.0, 2.0))
    assert len(ran) == 2


def test_many_layouts_are_no_reason_to_warn(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[dict[str, Any]] = []

    def freeze(function: Any, **options: Any) -> Any:
        seen.append(options)
        function.n_recordings = 0
        return function

    monkeypatch.setattr(dr, "freeze", freeze)
    recorded(lambda: None)()
    recorded(lambda: None, limit=3, warn_after=2)()
    assert seen[0]["warn_after"] > 1 << 20 and seen[1] == {"limit": 3, "warn_after": 2}


def test_how_long_recordings_have_taken() -> None:
    """Those alone, and each once."""
    seconds_of_recordings()
    twice = recorded(lambda x: 2 * x)
    assert twice(mi.Float(1, 2)).numpy().tolist() == [2, 4]
    first = seconds_of_recordings()
    assert first > 0 == seconds_of_recordings()
    twice(mi.Float(3, 4))
    assert seconds_of_recordings() == 0


@pytest.mark.parametrize("enabled", [True, False])
def test_garbage_is_collected_again_where_it_was(enabled: bool) -> None:
    try:
        (gc.enable if enabled else gc.disable)()
        with pytest.raises(KeyError), no_garbage_collection():
            assert not gc.isenabled()
            raise KeyError
        assert gc.isenabled() == enabled
    finally:
        gc.enable()


def test_no_other_thread_gets_a_turn() -> None:
    """As Dr.Jit's lock may be taken, which that might want: until this one waits."""
    seen: list[float] = []
    notes = type("Notes", (), {"take": staticmethod(lambda: seen.append(sys.getswitchinterval()))})

    @recorded
    def same(x: mi.Float) -> mi.Float:
        notes.take()
        return x + 1

    before = sys.getswitchinterval()
    same(values(1.0, 2.0))
    assert seen == [recording._LONG] and sys.getswitchinterval() == before
    with pytest.raises(KeyError), recording._no_other_thread():
        raise KeyError
    assert sys.getswitchinterval() == before


PROGRAM = """
import sys
from dataclasses import dataclass
import drjit as dr
import mitsuba as mi
mi.set_variant("llvm_ad_rgb")
from stratalux.sampling.recording import recorded
@dataclass
class Things:
    some: mi.Float
    more: mi.Float
add = recorded(lambda things: things.some + things.more)
sys.setswitchinterval(1e-6)
for n in range(20_000):
    there = dr.arange(mi.Float, 64) + n
    dr.eval(there)
    things = Things(mi.Float(there.numpy()), dr.ones(mi.Float, 64))
    del there
    dr.eval(things)
    dr.eval(add(things))
"""


@pytest.mark.slow
def test_arrays_that_go_to_and_fro_end_no_program() -> None:
    """By itself, ``drjit.freeze`` waits for ever in one of some thousand calls."""
    command = [sys.executable, "-c", PROGRAM]
    subprocess.run(command, cwd=Path(__file__).parents[2], env=os.environ, timeout=PATIENCE, check=True)


def test_threads_take_turns() -> None:
    inside, most = 0, 0

    @one_at_a_time
    def enter(times: int = 1) -> None:
        nonlocal inside, most
        inside += 1
        most = max(most, inside)
        for _ in range(1000 * times):
            pass
        inside -= 1

    def steps() -> Iterator[int]:
        for k in range(20):
            enter.__wrapped__()
            yield k

    found: list[int] = []
    work = [lambda: [enter(times=2) for _ in range(20)], lambda: found.extend(step_by_step(steps()))]
    threads = [threading.Thread(target=w) for w in 2 * work[:1] + work[1:]]
    for each in threads:
        each.start()
    for each in threads:
        each.join(PATIENCE)
    assert most == 1 and found == list(range(20))


def test_steps_have_no_derivatives() -> None:
    def steps() -> Iterator[bool]:
        x = mi.Float(1)
        dr.enable_grad(x)
        yield dr.grad_enabled(x * 2)

    assert list(steps()) == [True] and list(step_by_step(steps())) == [False]
