"""What the launches of a picture have added up to."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.float32]
"""(H, W, C): the channels of a film, the last of which is the weight."""
Memory = dict[str, Any]
"""All that makes the rest of a picture the same: arrays and numbers by name, and memories of its parts."""

_TWICE = 1.99
"""As much as before, nearly: numbers of samples are rounded."""
Noise = NDArray[np.float32] | None
"""See :meth:`Sums.noise`."""
UNLIMITED = 1 << 40
"""So many samples per pixel and more stand for as many as there is time for."""


class Sums:
    """Sums over launches, in double precision and one after the other, which are kept in a ``memory``.

    Whenever there is twice as much as before, the older half and the younger one are compared, which tells the error.
    """

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    @property
    def launches(self) -> int:
        """How many there were."""
        return int(self._memory.get("launches", 0))

    def add(self, raw: NDArray[Any], launches: int | None = None) -> None:
        """A launch more: (H, W, C), the last channel is the weight, by which the others are multiplied.

        Or the sum of several, after which there are so many ``launches``.
        """
        memory = self._memory
        if self.launches == 0:
            memory["total"] = raw.astype(np.float64)
            memory["older"] = _grey(memory["total"])
        else:
            memory["total"] += raw
            self._compare()
        memory["launches"] = self.launches + 1 if launches is None else launches

    def _compare(self) -> None:
        memory = self._memory
        older, total = memory["older"], memory["total"]
        before, now = older[..., 1].sum(), total[..., -1].sum()
        if now > _TWICE * before:
            both = _grey(total)
            younger = both - older
            one, other = (normalised(sums)[..., 0] for sums in (older, younger))
            # As much as the mean of both differs from the truth, if they are independent and alike.
            seen = (older[..., 1] != 0) & (younger[..., 1] != 0)
            share = np.divide(older[..., 1], both[..., 1], out=np.full(seen.shape, np.nan), where=seen)
            memory["noise"] = ((one - other) * np.sqrt(share * (1 - share))).astype(np.float32)
            memory["older"] = both

    def raw(self) -> NDArray[np.float64]:
        """The sum of all."""
        total: NDArray[np.float64] = self._memory["total"]
        return total

    def image(self) -> Pixels:
        """The mean of all; every pixel has the weight 1 where it has any."""
        return normalised(self.raw())

    def noise(self) -> Noise:
        """How far, about, each pixel (H, W) is from the truth, the mean of the colours, in the sense of its square.

        It is NaN where one half has no sample, and rather too large for strata, as their error falls faster than that
        of independent samples. None if there is one launch.
        """
        if "noise" not in self._memory:
            return None
        then, now = self._memory["older"][..., 1].sum(), self.raw()[..., -1].sum()
        return np.asarray(self._memory["noise"] * np.sqrt(then / now), dtype=np.float32)


def _grey(raw: NDArray[Any]) -> NDArray[Any]:
    colours = 3 if raw.shape[-1] > 3 else 1
    return np.stack([raw[..., :colours].mean(axis=-1), raw[..., -1]], axis=-1)


def reach_of(film: mi.Film) -> int:
    """How many pixels beyond its own a sample counts in."""
    filter = film.rfilter()
    return 0 if filter.is_box_filter() else int(np.ceil(filter.radius() - 0.5))


def normalised(sums: NDArray[Any]) -> Pixels:
    """(H, W, C) divided by the last channel, the weight, where there is any."""
    weight = sums[..., -1:]
    return np.divide(sums, weight, out=np.zeros_like(sums), where=weight != 0).astype(np.float32)


def added_noise(a: Noise, b: Noise) -> Noise:
    """That of the sum of two pictures; None if one of them is not known."""
    return None if a is None or b is None else a + b
