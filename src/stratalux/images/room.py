"""Memory that this process shares with those that read for it: so large images need no way through a pipe."""

from __future__ import annotations

import mmap
import os

import numpy as np
from numpy.typing import NDArray


class Room:
    """Memory without a size yet; a context manager, whose array stays when it ends. Linux alone has it."""

    def __init__(self) -> None:
        self.descriptor = os.memfd_create("stratalux")

    @classmethod
    def there(cls) -> bool:
        """Whether the system has such memory."""
        return hasattr(os, "memfd_create")

    def __enter__(self) -> Room:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self.descriptor)

    def array(self, size: int) -> NDArray[np.uint8]:
        """All of it, of so many bytes from now on. Raises :class:`OSError` where there is no room."""
        os.ftruncate(self.descriptor, max(size, 1))
        return np.frombuffer(mmap.mmap(self.descriptor, max(size, 1)), np.uint8)[:size]
