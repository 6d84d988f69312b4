"""Launches of a picture on many machines, by Dask."""

from __future__ import annotations

import importlib.util

from ...errors import InputError

LOCAL = "local:"
"""What the address of a cluster begins with that is made of processes of this machine."""


def check_packages() -> None:
    """Raise :class:`InputError` where Dask is missing."""
    if importlib.util.find_spec("distributed") is None:
        raise InputError("cluster: rendering on many machines needs more packages: pip install 'stratalux[cluster]'")
