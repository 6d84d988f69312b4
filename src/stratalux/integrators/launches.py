"""Pictures are made of launches, whose results add up: here, one after the other, or wherever somebody makes them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any]]
"""What a launch brings, by name. Those of several launches of one stage add up."""
Launch = Callable[[int], Arrays]
"""Make the launch of that number. It depends on nothing but its number, and on what is known when its stage begins."""


class Maker(Protocol):
    """Who makes the launches of a picture."""

    def __call__(
        self, stage: str, known: Mapping[str, Any], first: int, count: int, launch: Launch
    ) -> Iterator[tuple[int, Arrays]]:
        """Those of a ``stage`` from number ``first`` on, up to ``count``: the number after the last one that is done,
        and the sum of what has come since the last time. ``known``: what they depend on, beside the picture."""


def here(stage: str, known: Mapping[str, Any], first: int, count: int, launch: Launch) -> Iterator[tuple[int, Arrays]]:
    """One after the other, in this process."""
    for k in range(first, count):
        yield k + 1, launch(k)


def of_part(make: Maker, part: str) -> Maker:
    """The same for one of the parts of a picture, whose stages have its name before their own."""

    def maker(
        stage: str, known: Mapping[str, Any], first: int, count: int, launch: Launch
    ) -> Iterator[tuple[int, Arrays]]:
        return make(f"{part}/{stage}", known, first, count, launch)

    return maker


def together(one: Arrays, other: Arrays) -> Arrays:
    """The sum of both."""
    return {name: value + other[name] for name, value in one.items()}


def accumulate(total: dict[str, Any], more: Arrays) -> dict[str, Any]:
    """The sum of both, in the memory of ``total`` where that may be written to."""
    for name, value in more.items():
        if total[name].flags.writeable:
            total[name] += value
        else:
            total[name] = total[name] + value
    return total


def grown(k: int, times: int) -> int:
    """How much ``k`` launches are where the first is 1, and each as large as all before it, up to ``times``.

    That is a power of two.
    """
    doubled = times.bit_length()
    return times * (k - doubled + 1) if k >= doubled else (1 << k) >> 1


def number_for(much: int, times: int) -> int:
    """How many of those launches are ``much``, which is ``times`` at least."""
    return times.bit_length() - 1 + -(-much // times)
