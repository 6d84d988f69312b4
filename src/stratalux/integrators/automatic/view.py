"""Launches of camera samples over a film, and the pilot that tells where more are needed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ...sampling.exact import ExactSums
from ...sampling.points import mix
from ..sums import UNLIMITED, Memory, Pixels, Sums
from .adaptive import Plan, plan_samples
from .launch import Launch, Launcher
from .look import Look
from .visibility import Visibility

Noise = NDArray[np.float32] | None
"""See :meth:`~..sums.Sums.noise`."""
LAUNCH = 1 << 21
"""Camera samples of one launch, about: a second on two cores."""
KNOWN = 128
"""Samples per pixel that a pilot is made for where their number is not known."""
_PLENTY = 1 << 24
"""As many as there will ever be, then."""
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

    def learn(self) -> NDArray[np.float32]:
        """Stop to count, and tell what was learned; nothing where nothing was counted."""
        if self.counts is None:
            return np.zeros(0, dtype=np.float32)
        learned: NDArray[np.float32] = Visibility.learn(self.counts).numpy()
        self.counts = None
        return learned

    def later(
        self,
        first: Pixels,
        few: int,
        counts: NDArray[np.int64],
        seed: mi.UInt32,
        expected: mi.Float,
        shared: mi.Float | None,
        share: mi.Float | None = None,
        memory: Memory | None = None,
    ) -> Iterator[tuple[Pixels, float, Noise]]:
        """Launch by launch, the image so far, its samples per pixel and its noise, where ``counts`` (H, W) follow the
        ``few`` of the image ``first``. ``share`` of the variate's difference that counts in each pixel; none unless
        given. Launches that the ``memory`` has are not made again."""
        sums = Sums({} if memory is None else memory)
        for k, (start, end) in enumerate(self.launches(counts.ravel())):
            if k >= sums.launches:
                samples = shared
                if samples is None:
                    samples = self.launcher.light_samples(mix(mix(seed) + mi.UInt32(k + 1)))
                lanes = self.samples(few + start, end - start, seed, expected, samples)
                L = lanes.L
                if share is not None:
                    L = L + dr.gather(mi.Float, share, lanes.pixel) * lanes.difference
                weight = dr.rcp(mi.Float(dr.gather(mi.UInt32, unsigned(counts.ravel()), lanes.pixel)))
                sums.add(self.put(lanes, L, lanes.alpha, weight, int((end - start).max())))
            elif k + 1 < sums.launches:
                continue
            done = end.reshape(counts.shape)
            yield combined(first, sums.image(), few, done), few + float(done.mean()), sums.noise()

    def put(
        self, lanes: Lanes, value: mi.Spectrum, alpha: mi.Bool | mi.Float, weight: mi.Float, most: int
    ) -> NDArray[np.float64]:
        """The film's channels (H, W, C) with a ``value`` and an ``alpha`` at the place of each sample, times its
        ``weight``, which is 1 at most and the last channel. ``most``: samples of a pixel."""
        filter = self.film.rfilter()
        reach = 0 if filter.is_box_filter() else int(np.ceil(filter.radius() - 0.5))
        colours = [value[c % dr.size_v(mi.Spectrum)] * weight for c in range(3)]
        alphas = [dr.select(alpha, weight, 0) if dr.is_mask_v(alpha) else alpha * weight]
        if self.film.create_block(mi.ScalarVector2u(1)).channel_count() < 5:
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
        return np.stack([s.reshape(self.height, self.width) for s in sums], axis=-1)


class Pilot:
    """A few samples of every pixel, and what follows from them."""

    def __init__(self, view: View, count: int, parts: int, shared: mi.Float | None, grey: float) -> None:
        self.view, self.count, self.parts, self._shared, self._grey = view, count, parts, shared, grey
        self._images = Sums({}), Sums({})
        self._sums = np.zeros((2, 3, parts * view.pixels))
        self._costs: list[mi.Float] = []

    def passes(self, seed: mi.UInt32, dim: float) -> Iterator[float]:
        """Launch by launch, the samples per pixel so far."""
        view, count = self.view, self.count
        expected = dr.opaque(mi.Float, dim)
        for first, last in view.launches(np.full(view.pixels, count)):
            lanes = view.samples(first, last - first, seed, expected, self._shared)
            most = int((last - first).max())
            group = lanes.index * dr.opaque(mi.UInt32, self.parts) // dr.opaque(mi.UInt32, count)
            sums = ExactSums(self.parts * view.pixels, most)
            worth, difference = (
                [value[c % dr.size_v(mi.Spectrum)] for c in range(3)]
                for value in (self._worth(lanes), lanes.difference)
            )
            sums.begin(worth, difference)
            sums.add([*worth, *difference], group * view.pixels + lanes.pixel)
            self._sums += np.reshape(list(sums), self._sums.shape)
            weight = dr.opaque(mi.Float, 1 / count, dr.width(lanes.pixel))
            for image, value, alpha in zip(
                self._images, (lanes.L, lanes.difference), (lanes.alpha, mi.Bool(False)), strict=True
            ):
                image.add(view.put(lanes, value, alpha, weight, most))
            if lanes.cost is not None:
                self._costs = self._costs or [dr.zeros(mi.Float, view.pixels)]
                dr.scatter_add(self._costs[0], lanes.cost, lanes.pixel)  # whole numbers, exact in any order
                dr.eval(self._costs)
            yield float(last.mean())

    def _worth(self, lanes: Lanes) -> mi.Spectrum:
        """What errors are looked for in: the radiance, or that over a picture as ``grey`` as the map where alpha is a
        share, or shadows would not count there."""
        if dr.is_mask_v(lanes.alpha):
            return lanes.L
        return lanes.L + (1 - lanes.alpha) * dr.opaque(mi.Float, self._grey)

    def image(self, share: NDArray[np.float32] | float) -> Pixels:
        """The image, with a ``share`` of the variate's difference in each pixel."""
        image, difference = (sums.image() for sums in self._images)
        image[..., :-1] += np.asarray(share, dtype=np.float32)[..., None] * difference[..., :-1]
        return image

    def plan(self, dim: float, budget: int, beside: Pixels | None = None) -> Plan:
        """How to go on. ``beside``: an image that this one is added to, which its errors are measured by."""
        view = self.view
        shape = (2, 3, self.parts, view.height, view.width)
        means = (self._sums * (self.parts / self.count)).astype(np.float32).reshape(shape)
        pilot, difference = (mi.TensorXf(x) for x in means)
        if beside is not None:
            pilot += mi.TensorXf(np.moveaxis(beside[..., :3], -1, 0)[:, None])
        filter = view.film.rfilter()
        box = filter.is_box_filter()
        # With a wider filter, a sample counts in several pixels, so each needs later ones.
        least, footprint = (self.count, 0) if box else (2 * self.count, int(np.ceil(filter.radius() - 0.5)))
        marks = view.look.marks if view.look else ()
        known = KNOWN if budget >= UNLIMITED else budget
        plan = plan_samples(pilot, difference, dim, max(known, least), least, footprint, marks, self._costs)
        return plan if known == budget else replace(plan, counts=plan.counts * (_PLENTY // known))


def unsigned(numbers: NDArray[np.int64]) -> mi.UInt32:
    """Modulo 2³²."""
    return mi.UInt32(numbers.astype(np.uint32))


def pilot_samples(spp: int) -> int:
    """Samples of a pilot for ``spp`` in all, a power of two."""
    if spp >= UNLIMITED:
        spp = KNOWN
    return max(1, (1 << spp.bit_length()) >> 4)


def combined(pilot: Pixels, later: Pixels, few: int, counts: NDArray[np.int64]) -> Pixels:
    """The mean of ``few`` samples and of ``counts`` later ones."""
    share = np.where(later[..., -1] != 0, counts / (few + counts), 0)[..., None].astype(np.float32)
    return pilot + share * (later - pilot)
