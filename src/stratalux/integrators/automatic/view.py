"""Launches of camera samples over a film, and the pilot that tells where more are needed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ...sampling.points import mix
from .adaptive import Plan, plan_samples
from .launch import Launch, Launcher
from .look import Look
from .visibility import Visibility

Pixels = NDArray[np.float32]
"""(H, W, C): the channels of a film, the last of which is the weight."""

LAUNCH = 1 << 21
"""Camera samples of one launch, about: a second on two cores."""
FIRST = 8
"""Where there are several launches, the first is smaller by this factor: there is something to see soon."""


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


class View:
    """The film of a sensor, and launches of samples for it, which add to ``counts`` or make use of what is ``learned``
    (see :class:`~.visibility.Visibility`)."""

    def __init__(self, launcher: Launcher, look: Look | None) -> None:
        self.launcher, self.look = launcher, look
        self.film = launcher.sensor.film()
        self.width, self.height = (int(side) for side in self.film.crop_size())
        self.pixels = self.width * self.height
        self.counts: tuple[mi.UInt32, mi.UInt32] | None = None
        self.learned: mi.Float | None = None

    def at_once(self, spp: int) -> bool:
        """Whether one launch does for so many samples per pixel."""
        return self.pixels * spp <= LAUNCH

    def launches(self, counts: NDArray[np.int64]) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
        """The samples of each pixel from which and up to which a launch goes, until there are ``counts``.

        Where one launch does not do, the first are smaller and double; every one goes over the whole image.
        """
        total = int(counts.sum())
        row = np.repeat((np.arange(self.height) + 0.5) / self.height, self.width)  # where the fractions change
        start, done, step = np.zeros_like(counts), 0, LAUNCH if total <= LAUNCH else LAUNCH // FIRST
        while done < total:
            done = min(done + step, total)
            step = max(step, min(done, LAUNCH))
            end = np.floor(counts * (done / total) + row).astype(np.int64)
            if (end > start).any():
                yield start, end
                start = end

    def samples(
        self,
        first: NDArray[np.int64],
        number: NDArray[np.int64],
        seed: mi.UInt32,
        expected: mi.Float,
        shared: mi.Float | None,
    ) -> Lanes:
        """``number`` samples of each pixel, from the ``first`` on; ``expected`` is one for each, or one for all."""
        pixel = mi.UInt32(np.repeat(np.arange(self.pixels, dtype=np.uint32), number))
        before = np.cumsum(number) - number - first  # the first lane of a pixel, less the index of its sample
        index = dr.arange(mi.UInt32, dr.width(pixel)) - dr.gather(mi.UInt32, unsigned(before), pixel)
        if dr.width(expected) > 1:
            expected = dr.gather(mi.Float, expected, pixel)
        dr.eval(index, expected)
        detailed = self.look.detailed if self.look else None
        launch = Launch(pixel, index, seed, expected, shared, detailed, self.counts, self.learned)
        return Lanes(pixel, index, *self.launcher.samples(launch))

    def learn(self) -> None:
        """Make use of what was counted, from now on."""
        assert self.counts is not None
        self.learned = Visibility.learn(self.counts)
        self.counts = None

    def later(
        self,
        first: Pixels,
        few: int,
        counts: NDArray[np.int64],
        seed: mi.UInt32,
        expected: mi.Float,
        shared: mi.Float | None,
        share: mi.Float | None = None,
    ) -> Iterator[tuple[Pixels, float]]:
        """Launch by launch, the image so far and its samples per pixel, where ``counts`` (H, W) follow the ``few`` of
        the image ``first``. ``share`` of the variate's difference that counts in each pixel; none unless given."""
        block = self.film.create_block()
        for k, (start, end) in enumerate(self.launches(counts.ravel())):
            samples = shared if shared is not None else self.launcher.light_samples(mix(mix(seed) + mi.UInt32(k + 1)))
            lanes = self.samples(few + start, end - start, seed, expected, samples)
            L = lanes.L
            if share is not None:
                L = L + dr.gather(mi.Float, share, lanes.pixel) * lanes.difference
            weight = dr.rcp(mi.Float(dr.gather(mi.UInt32, unsigned(counts.ravel()), lanes.pixel)))
            self.put(block, lanes, L, lanes.alpha, weight)
            dr.eval(block.tensor())
            done = end.reshape(counts.shape)
            yield combined(first, developed(block), few, done), few + float(done.mean())

    def put(
        self, block: mi.ImageBlock, lanes: Lanes, value: mi.Spectrum, alpha: mi.Bool | mi.Float, weight: mi.Float
    ) -> None:
        """Add a ``value`` and an ``alpha`` to ``block`` at the place of each sample."""
        place = lanes.place
        if self.film.rfilter().is_box_filter():
            width = dr.opaque(mi.UInt32, self.width)
            row = lanes.pixel // width
            place = mi.Point2f(mi.Float(lanes.pixel - row * width), mi.Float(row))
        place += mi.Vector2f(self.film.crop_offset())
        alpha = dr.select(alpha, weight, 0) if dr.is_mask_v(alpha) else alpha * weight
        block.put(place, [], value * weight, alpha, weight)


class Pilot:
    """A few samples of every pixel, and what follows from them."""

    def __init__(self, view: View, count: int, parts: int, shared: mi.Float | None, grey: float) -> None:
        self.view, self.count, self.parts, self._shared, self._grey = view, count, parts, shared, grey
        self._images = view.film.create_block(), view.film.create_block()
        self._sums = [dr.zeros(mi.Float, 3 * parts * view.pixels) for _ in range(2)]
        self._costs: list[mi.Float] = []

    def passes(self, seed: mi.UInt32, dim: float) -> Iterator[float]:
        """Launch by launch, the samples per pixel so far."""
        view, count = self.view, self.count
        expected = dr.opaque(mi.Float, dim)
        for first, last in view.launches(np.full(view.pixels, count)):
            lanes = view.samples(first, last - first, seed, expected, self._shared)
            group = lanes.index * dr.opaque(mi.UInt32, self.parts) // dr.opaque(mi.UInt32, count)
            for sums, value in zip(self._sums, (self._worth(lanes), lanes.difference), strict=True):
                for c in range(3):
                    place = (c * self.parts + group) * view.pixels + lanes.pixel
                    dr.scatter_add(sums, value[c % dr.size_v(mi.Spectrum)], place)
            if lanes.cost is not None:
                self._costs = self._costs or [dr.zeros(mi.Float, view.pixels)]
                dr.scatter_add(self._costs[0], lanes.cost, lanes.pixel)
            weight = dr.opaque(mi.Float, 1 / count)
            view.put(self._images[0], lanes, lanes.L, lanes.alpha, weight)
            view.put(self._images[1], lanes, lanes.difference, mi.Bool(False), weight)
            dr.eval(*(block.tensor() for block in self._images), self._sums, self._costs)
            yield float(last.mean())

    def _worth(self, lanes: Lanes) -> mi.Spectrum:
        """What errors are looked for in: the radiance, or that over a picture as ``grey`` as the map where alpha is a
        share, or shadows would not count there."""
        if dr.is_mask_v(lanes.alpha):
            return lanes.L
        return lanes.L + (1 - lanes.alpha) * dr.opaque(mi.Float, self._grey)

    def image(self, share: NDArray[np.float32] | float) -> Pixels:
        """The image, with a ``share`` of the variate's difference in each pixel."""
        image, difference = (developed(block) for block in self._images)
        image[..., :-1] += np.asarray(share, dtype=np.float32)[..., None] * difference[..., :-1]
        return image

    def plan(self, dim: float, budget: int, beside: Pixels | None = None) -> Plan:
        """How to go on. ``beside``: an image that this one is added to, which its errors are measured by."""
        view = self.view
        shape = (3, self.parts, view.height, view.width)
        scale = dr.opaque(mi.Float, self.parts / self.count)
        pilot, difference = (mi.TensorXf(sums * scale, shape) for sums in self._sums)
        if beside is not None:
            pilot += mi.TensorXf(np.moveaxis(beside[..., :3], -1, 0)[:, None])
        filter = view.film.rfilter()
        box = filter.is_box_filter()
        # With a wider filter, a sample counts in several pixels, so each needs later ones.
        least, footprint = (self.count, 0) if box else (2 * self.count, int(np.ceil(filter.radius() - 0.5)))
        marks = view.look.marks if view.look else ()
        budget = max(budget, least)
        return plan_samples(pilot, difference, dim, budget, least, footprint, marks, self._costs)


def unsigned(numbers: NDArray[np.int64]) -> mi.UInt32:
    """Modulo 2³²."""
    return mi.UInt32(numbers.astype(np.uint32))


def developed(block: mi.ImageBlock) -> Pixels:
    """The image that a block stands for, (H, W, C), every pixel with weight 1 where it has any."""
    sums = block.tensor().numpy()
    weight = sums[..., -1:]
    return np.divide(sums, weight, out=np.zeros_like(sums), where=weight != 0)


def pilot_samples(spp: int) -> int:
    """Samples of a pilot for ``spp`` in all, a power of two."""
    return max(1, (1 << spp.bit_length()) >> 4)


def combined(pilot: Pixels, later: Pixels, few: int, counts: NDArray[np.int64]) -> Pixels:
    """The mean of ``few`` samples and of ``counts`` later ones."""
    share = np.where(later[..., -1] != 0, counts / (few + counts), 0)[..., None].astype(np.float32)
    return pilot + share * (later - pilot)
