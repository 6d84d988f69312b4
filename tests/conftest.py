"""Every test starts in the same variant."""

from __future__ import annotations

from collections.abc import Iterator

import mitsuba as mi
import pytest

import stratalux  # noqa: F401  (registers the plugins)


@pytest.fixture(autouse=True)
def variant() -> Iterator[None]:
    mi.set_variant("llvm_ad_rgb")
    yield
