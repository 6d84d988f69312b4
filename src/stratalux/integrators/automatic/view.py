"""Launches of camera samples over a film, and the pilot that tells where more are needed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ...sampling.exact import ExactSums
from ...sampling.points import mix
from ..launches import Arrays, accumulate, grown, number_for
from ..sums import UNLIMITED, Pixels, normalised, reach_of
from .adaptive import Plan, plan_samples
from .launch import Group, Launch, Launcher
from .look import Look
from .visibility import Visibility

LAUNCH = 1 << 21
"""Camera samples of one launch, about: a second on two cores."""
LARGEST = 8
"""So many times as many, at most, for a film that has more pixels: what a launch costs besides grows with these."""
KNOWN = 128
"""Samples per pixel that a pilot is made for where their number is not known."""
PLENTY = 1 << 24
"""As many as there will ever be, then."""
PIXEL_BYTES, IMAGE_BYTES, PART_BYTES, SAMPLE_BYTES = 730, 75, 145, 250
"""Memory that a pixel of the film takes, of each image that adds to it, and of each part of its pilot; and that a
sample takes which is under way. As measured, from the first sample until the file is written."""
LEAST, SHARE = 1 << 17, 16
"""Samples under way at least, and that share of the pixels: each time, sums over the whole film are made."""
FIRST = 8
"""Where there are several launches, the first is smaller by this factor: there is something to see soon."""


Range = NDArray[np.int64]
"""Of each pixel, the number of a sample."""


@dataclass
class Lanes:
    """Camera samples: ``index`` within its ``pixel``, radiance ``L``, the variate's ``difference``, and place.

    ``cost``: of each, in any unit; None where all cost about the same.
    """

    pixel: mi.UInt32
    index: mi.UInt32
    L: mi.Spectrum
    difference: mi.Spectrum
    alpha: mi.Bool | mi.Float
    place: mi.Point2f
    cost: mi.Float | None = None


def room(pixels: int) -> int:
    """Camera samples of one launch over a film of so many pixels, about: one for each, within bounds."""
    return min(max(LAUNCH, pixels), LARGEST * LAUNCH)


class Division:
    """So many ``counts`` (H, W) of samples of each pixel, in launches of about ``room``.

    Where one launch does not do, the first are smaller and double; every one goes over the whole image.
    """

    def __init__(self, counts: NDArray[np.int64], width: int, height: int, room: int) -> None:
        self._counts = counts.ravel()
        self._total, self._room = int(self._counts.sum()), room
        # Where fractions change. None is rounded up in the first row: of a pilot, each launch has something to do.
        self._rows = np.repeat(np.arange(height) / height, width)

    def __len__(self) -> int:
        if self._total <= self._room:
            return min(self._total, 1)
        step = self._room // FIRST
        return number_for(-(-self._total // step), FIRST)

    def __getitem__(self, k: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The samples of each pixel from which and up to which launch ``k`` goes."""
        if not 0 <= k < len(self):
            raise IndexError(k)
        return self.until(k), self.until(k + 1)

    def until(self, k: int) -> NDArray[np.int64]:
        """Samples of each pixel after ``k`` launches."""
        return np.floor(self._counts * self._share(k) + self._rows).astype(np.int64)

    def _share(self, k: int) -> float:
        """Of all, after ``k`` launches."""
        return 1.0 if k >= len(self) else grown(k, FIRST) * (self._room // FIRST) / self._total


class View:
    """The film of a sensor, and samples for it."""

    def __init__(self, launcher: Launcher, look: Look | None, most: int = 1 << 40) -> None:
        """``most``: samples that are under way at the same time."""
        self.launcher, self.look, self.most = launcher, look, most
        self.film = launcher.sensor.film()
        self.width, self.height = (int(side) for side in self.film.crop_size())
        self.pixels = self.width * self.height

    @property
    def channels(self) -> int:
        """Of what is put: colours, alpha where the film has it, and the weight."""
        return 5 if self.film.create_block(mi.ScalarVector2u(1)).channel_count() > 4 else 4

    def at_once(self, spp: int) -> bool:
        """Whether one launch does for so many samples per pixel."""
        return self.pixels * spp <= self.room

    def first(self, spp: int) -> int:
        """How many of so many samples of each pixel come first, where nothing is planned: all that one launch does for,
        or one, so that there is something to see, and to go on with, after each launch."""
        return spp if self.at_once(spp) else 1

    @property
    def room(self) -> int:
        """Camera samples of one launch, about."""
        return room(self.pixels)

    def launches(self, counts: NDArray[np.int64], first: int = 0) -> Division:
        """Those that give each pixel so many samples, by their number, after the ``first`` ones."""
        return Division(counts, self.width, self.height, self.room)

    def lanes(self, first: NDArray[np.int64], number: NDArray[np.int64]) -> tuple[mi.UInt32, mi.UInt32, Group]:
        """The pixel of each lane, the index of its sample there, and which lanes belong together, if any do."""
        pixel = mi.UInt32(np.repeat(np.arange(self.pixels, dtype=np.uint32), number))
        before = np.cumsum(number) - number - first  # the first lane of a pixel, less the index of its sample
        return pixel, dr.arange(mi.UInt32, dr.width(pixel)) - dr.gather(mi.UInt32, unsigned(before), pixel), None

    def in_pieces(self, start: Range, end: Range, piece: Callable[[Range, Range], dict[str, Any]]) -> dict[str, Any]:
        """The sum of ``piece`` over the samples of each pixel from ``start`` to ``end``, a part of them at a time."""
        total = int((end - start).sum())
        if total <= self.most:
            return piece(start, end)
        found: dict[str, Any] = {}
        for low, high in self.pieces(start, end, -(-total // self.most)):
            some = piece(low, high)
            found = accumulate(found, some) if found else some
            some = {}  # of a large film, it is much
        return found

    def pieces(self, start: Range, end: Range, count: int) -> Iterator[tuple[Range, Range]]:
        """The samples of each pixel from ``start`` to ``end`` in so many parts."""
        until = np.cumsum(end - start)
        before, total = start - (until - (end - start)), int(until[-1])
        for k in range(count):
            low, high = (np.clip(before + total * i // count, start, end) for i in (k, k + 1))
            yield low, high

    def samples(
        self,
        first: NDArray[np.int64],
        number: NDArray[np.int64],
        seed: mi.UInt32,
        expected: mi.Float,
        shared: mi.Float | None,
        counts: tuple[mi.UInt32, mi.UInt32] | None = None,
        learned: mi.Float | None = None,
    ) -> Lanes:
        """``number`` samples of each pixel, from the ``first`` on; ``expected`` is one for each, or one for all.

        They add to ``counts``, or make use of what is ``learned``: see :class:`~.visibility.Visibility`.
        """
        pixel, index, group = self.lanes(first, number)
        if dr.width(expected) > 1:
            expected = dr.gather(mi.Float, expected, pixel)
        dr.eval(pixel, index, expected, group)
        detailed = self.look.detailed if self.look else None
        launch = Launch(pixel, index, seed, expected, shared, detailed, counts, learned, group)
        return Lanes(pixel, index, *self.launcher.samples(launch))

    def put(
        self, lanes: Lanes, value: mi.Spectrum, alpha: mi.Bool | mi.Float, weight: mi.Float, most: int
    ) -> NDArray[np.float64]:
        """The film's channels (H, W, C) with a ``value`` and an ``alpha`` at the place of each sample, times its
        ``weight``, which is 1 at most and the last channel. ``most``: samples of a pixel."""
        filter = self.film.rfilter()
        reach = reach_of(self.film)
        colours = [value[c % dr.size_v(mi.Spectrum)] * weight for c in range(3)]
        alphas = [dr.select(alpha, weight, 0) if dr.is_mask_v(alpha) else alpha * weight]
        if self.channels < 5:
            alphas = []
        sums = ExactSums(self.pixels, 4 * most * (2 * reach + 1) ** 2)
        sums.begin(colours, [*alphas, weight])
        if reach == 0:
            sums.add([*colours, *alphas, weight], lanes.pixel)
        else:
            width, height = dr.opaque(mi.Int32, self.width), dr.opaque(mi.Int32, self.height)
            row = mi.Int32(lanes.pixel) // width
            column = mi.Int32(lanes.pixel) - row * width
            x, y = lanes.place.x - mi.Float(column), lanes.place.y - mi.Float(row)
            steps = range(-reach, reach + 1)
            across = [filter.eval(step + 0.5 - x) for step in steps]
            for j in steps:
                down = filter.eval(j + 0.5 - y)
                for i, beside in zip(steps, across, strict=True):
                    r, c = row + j, column + i
                    inside = (r >= 0) & (r < height) & (c >= 0) & (c < width)
                    share = down * beside
                    sums.add([v * share for v in (*colours, *alphas, weight)], mi.UInt32(r * width + c), inside)
        del lanes, colours, alphas
        return filled(sums, (self.height, self.width, self.channels), -1)


class Pilot:
    """A few samples of every pixel, and what follows from them. It ``learns`` what is visible.

    Its samples are in so many ``parts``, whose differences tell what is to be planned; in none if nothing is.
    """

    def __init__(
        self,
        view: View,
        count: int,
        parts: int,
        shared: mi.Float | None,
        seed: mi.UInt32,
        dim: float,
        grey: float = 0.0,
        varied: bool = False,
        learns: bool = False,
    ) -> None:
        self.view, self.count, self.parts, self._shared, self._grey = view, count, parts, shared, grey
        self._seed, self._dim, self._varied, self._learns = seed, dim, varied, learns
        self._found: Arrays | None = None
        self.launches = view.launches(np.full(view.pixels, count))

    def launch(self, k: int) -> Arrays:
        """One of those of :attr:`launches`."""
        shared = self._shared
        if shared is None and not self.parts:  # as nothing is planned, pixels may have samples of the map in common
            shared = self.view.launcher.light_samples(mix(self._seed + mi.UInt32(~k & 0xFFFFFFFF)))
        return self.view.in_pieces(*self.launches[k], partial(self._piece, shared))

    def _piece(self, shared: mi.Float | None, first: Range, last: Range) -> dict[str, Any]:
        view, count = self.view, self.count
        expected = dr.opaque(mi.Float, self._dim)
        counts = Visibility.nothing(view.width, view.height) if self._learns else None
        lanes = view.samples(first, last - first, self._seed, expected, shared, counts)
        most = int((last - first).max())
        found: dict[str, Any] = {"sums": self._parts(lanes, most)} if self.parts else {}
        weight = dr.opaque(mi.Float, 1 / count, dr.width(lanes.pixel))
        found["image"] = view.put(lanes, lanes.L, lanes.alpha, weight, most)
        if self._varied:
            found["difference"] = view.put(lanes, lanes.difference, mi.Bool(False), weight, most)
        if lanes.cost is not None:
            cost = dr.zeros(mi.UInt32, view.pixels)
            dr.scatter_add(cost, mi.UInt32(lanes.cost), lanes.pixel)
            found["costs"] = cost.numpy().astype(np.float64)
        if counts is not None:
            found["rays"], found["free"] = (count.numpy().astype(np.float64) for count in counts)
        return found

    def _parts(self, lanes: Lanes, most: int) -> NDArray[np.float64]:
        """Sums of each part (1 or 2, 3, P, H, W): of what errors are looked for in, and of the variate's difference."""
        view = self.view
        part = lanes.index * dr.opaque(mi.UInt32, self.parts) // dr.opaque(mi.UInt32, self.count)
        sums = ExactSums(self.parts * view.pixels, most)
        values = (self._worth(lanes), lanes.difference) if self._varied else (self._worth(lanes),)
        groups = [[value[c % dr.size_v(mi.Spectrum)] for c in range(3)] for value in values]
        sums.begin(*groups)
        sums.add([value for group in groups for value in group], part * view.pixels + lanes.pixel)
        del values, groups
        shape = self.parts, view.height, view.width
        images = 6 if self._varied else 3
        return filled(sums, (images, *shape), 0).reshape(images // 3, 3, *shape)

    def add(self, found: Arrays) -> None:
        """What a launch has brought, or several."""
        self._found = accumulate(dict(self._found), found) if self._found else found

    def forget(self) -> None:
        """What has been found."""
        self._found = None

    @property
    def found(self) -> Arrays:
        """The sum of all."""
        assert self._found is not None
        return self._found

    def learned(self) -> NDArray[np.float32]:
        """What is visible."""
        return np.array(Visibility.learn((mi.Float(self.found["rays"]), mi.Float(self.found["free"]))))

    def _worth(self, lanes: Lanes) -> mi.Spectrum:
        """What errors are looked for in: the radiance, or that over a picture as ``grey`` as the map where alpha is a
        share, or shadows would not count there."""
        if dr.is_mask_v(lanes.alpha):
            return lanes.L
        return lanes.L + (1 - lanes.alpha) * dr.opaque(mi.Float, self._grey)

    def image(self, share: NDArray[np.float32] | float) -> Pixels:
        """The image, with a ``share`` of the variate's difference in each pixel."""
        image = normalised(self.found["image"])
        if self._varied:
            difference = normalised(self.found["difference"])
            image[..., :-1] += np.asarray(share, dtype=np.float32)[..., None] * difference[..., :-1]
        return image

    def plan(self, budget: int, beside: Pixels | None = None) -> Plan:
        """How to go on. ``beside``: an image that this one is added to, which its errors are measured by."""
        view = self.view
        means = (self.found["sums"] * (self.parts / self.count)).astype(np.float32)
        pilot, difference = mi.TensorXf(means[0]), mi.TensorXf(means[1] if self._varied else np.zeros_like(means[0]))
        if beside is not None:
            pilot += mi.TensorXf(np.moveaxis(beside[..., :3], -1, 0)[:, None])
        # With a wider filter, a sample counts in several pixels, so each needs later ones.
        least = self.count if view.film.rfilter().is_box_filter() else 2 * self.count
        footprint = reach_of(view.film)
        marks = view.look.marks if view.look else ()
        known = KNOWN if budget >= UNLIMITED else budget
        costs = [mi.Float(self.found["costs"])] if "costs" in self.found else []
        plan = plan_samples(pilot, difference, self._dim, max(known, least), least, footprint, marks, costs)
        return plan if known == budget else replace(plan, counts=plan.counts * (PLENTY // known))


def unsigned(numbers: NDArray[np.int64]) -> mi.UInt32:
    """Modulo 2³²."""
    return mi.UInt32(numbers.astype(np.uint32))


def filled(sums: ExactSums, shape: tuple[int, ...], axis: int) -> NDArray[np.float64]:
    """An array of that ``shape``, which has all the sums along the ``axis``."""
    found = np.empty(shape)
    along = np.moveaxis(found, axis, 0)
    for k, values in enumerate(sums):
        along[k] = values.reshape(along[k].shape)
    return found


def pilot_samples(spp: int) -> int:
    """Samples of a pilot for ``spp`` in all, a power of two."""
    if spp >= UNLIMITED:
        spp = KNOWN
    return max(1, (1 << spp.bit_length()) >> 4)


def combined(pilot: Pixels, later: Pixels, few: int, counts: NDArray[np.int64]) -> Pixels:
    """The mean of ``few`` samples and of ``counts`` later ones."""
    share = np.where(later[..., -1] != 0, counts / (few + counts), 0)[..., None].astype(np.float32)
    return pilot + share * (later - pilot)
