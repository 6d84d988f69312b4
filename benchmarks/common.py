"""What the benchmarks share: real data, and the machine."""

from __future__ import annotations

import platform
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np

import stratalux
from stratalux import InputError
from stratalux.assets import Assets
from stratalux.comparison import provenance


def asset(file: str) -> Path:
    """A file of real data, by its path in the folder of assets; ends the program where it is missing."""
    try:
        return Assets().require(file)
    except InputError as error:
        sys.exit(str(error))


def machine() -> str:
    """One line that says where the numbers come from."""
    versions = f"stratalux {stratalux.__version__}, mitsuba {mi.__version__}, numpy {np.__version__}"
    return f"{provenance.machine()}, Python {platform.python_version()}, {versions}"
