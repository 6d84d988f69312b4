"""Every test starts in the same variant."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from typing import Any

import drjit as dr
import mitsuba as mi
import pytest
from hypothesis import HealthCheck, settings

import stratalux  # noqa: F401  (registers the plugins)
from tests.variants import RGB

# No example fails for being slow, and none is there because an earlier run had found it.
settings.register_profile("tests", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("tests")

if threads := os.environ.get("STRATALUX_TEST_THREADS"):
    dr.set_thread_count(int(threads))


@pytest.fixture(scope="module", autouse=True)
def what_is_imported_stays() -> None:
    """No later test looks through it for garbage again."""
    gc.collect()
    gc.freeze()


def pytest_sessionfinish() -> None:
    gc.unfreeze()


@pytest.fixture(autouse=True)
def variant(what_is_imported_stays: None) -> Iterator[None]:
    """And without the scenes of others: Dr.Jit traces all objects that live, and compiles a kernel anew beside them."""
    gc.collect()
    mi.set_variant(RGB)
    yield


@pytest.fixture
def launches(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Every launch of the automatic estimator, as it happens."""
    from stratalux.integrators.automatic.launch import Launch, Launcher

    seen: list[Launch] = []
    samples = Launcher.samples

    def watched(self: Launcher, launch: Launch) -> Any:
        seen.append(launch)
        return samples(self, launch)

    monkeypatch.setattr(Launcher, "samples", watched)
    return seen
