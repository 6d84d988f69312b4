"""USD: .usd, .usda, .usdc and .usdz, by Pixar's own library.

It reads in a process of its own: a damaged file of 10 KB has made it take 15 GB and two minutes. Nor does it matter
then what the library prints.

Source: "OpenUSD", openusd.org: the schemas UsdGeom, UsdShade, UsdLux and UsdSkel, and the "UsdPreviewSurface
Specification".
"""

from __future__ import annotations

import importlib.util
import os
import pickle
import signal
import subprocess
import sys
import warnings
from pathlib import Path

from ....errors import InputError, SceneWarning
from ...model import Model
from ...sources import source

_SECONDS = 600
"""What takes longer counts as hung."""
_PROGRAM = f"import sys; sys.path[:] = sys.argv[2:]; import {__name__}.process as program; program.main(sys.argv[1])"


def read(path: Path) -> Model:
    """All surfaces, lights and cameras of a stage, as it is at its first moment.

    Surfaces that are subdivided are shown as their cages. Raises InputError without the package that reads them, for
    what is no stage, and if the process that reads it does not survive that.
    """
    if importlib.util.find_spec("pxr") is None:
        raise InputError(f"{path}: USD needs another package: pip install 'stratalux[usd]'")
    try:
        process = subprocess.run(
            # What site-packages run at every start is not needed there, but what they put on the path is.
            [sys.executable, "-I", "-S", "-c", _PROGRAM, str(path.absolute()), *map(os.path.abspath, sys.path)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            check=False,
            timeout=_SECONDS,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"},
        )
    except subprocess.TimeoutExpired:
        raise InputError(
            f"{path}: reading it was given up after {_SECONDS} s; export it again, or less of it"
        ) from None
    if process.returncode:
        raise InputError(f"{path}: damaged: reading it ended the reader ({_end(process.returncode)}); export it again")
    kind, answer, told, files = pickle.loads(process.stdout)
    for file in files:
        source(file)
    for text in told:
        warnings.warn(str(text).replace(str(path.absolute()), str(path), 1), SceneWarning, stacklevel=2)
    if kind == "refused":
        raise InputError(str(answer).replace(str(path.absolute()), str(path), 1))
    if kind == "failed":
        raise ValueError(answer)
    found: Model = answer
    return found


def _end(code: int) -> str:
    if code < 0 and -code in set(signal.Signals):
        return signal.Signals(-code).name
    return f"exit code {code}"
