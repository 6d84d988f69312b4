"""The variants that the tests run in. STRATALUX_TEST_BACKEND=cuda runs them all on an NVIDIA GPU."""

from __future__ import annotations

import os

BACKEND = os.environ.get("STRATALUX_TEST_BACKEND", "llvm")

RGB, MONO, SPECTRAL = (f"{BACKEND}_ad_{colour}" for colour in ("rgb", "mono", "spectral"))
