"""Launches of a picture on many machines, by Dask."""

from __future__ import annotations

import importlib.util

from ...errors import InputError


def check_packages() -> None:
    """Raise :class:`InputError` where Dask is missing."""
    if importlib.util.find_spec("distributed") is None:
        raise InputError("cluster: rendering on many machines needs more packages: pip install 'stratalux[cluster]'")
