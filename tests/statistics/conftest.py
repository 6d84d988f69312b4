"""Every test starts without the scenes of others."""

from __future__ import annotations

import gc

import pytest


@pytest.fixture(autouse=True)
def alone() -> None:
    """Kernels number the objects that live: beside those of another test, a scene is compiled anew."""
    gc.collect()
