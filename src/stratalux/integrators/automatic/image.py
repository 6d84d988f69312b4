"""``direct_stratified`` by itself: a pilot of every pixel, then samples where the error is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ...sampling.points import mix
from ...sampling.recording import one_at_a_time, step_by_step
from .adaptive import Plan, plan_samples
from .launch import Launch, Launcher
from .lobes import DIM
from .look import Look
from .sample import AutomaticSample
from .visibility import Visibility

_Pixels = NDArray[np.float32]

LAUNCH = 1 << 21
"""Camera samples of one launch, about: a second on two cores."""
FIRST = 8
"""Where there are several launches, the first is smaller by this factor: there is something to see soon."""
CAMERAS = ("PerspectiveCamera", "ThinLensCamera", "OrthographicCamera", "BatchSensor")
"""What has pixels that are neighbours of each other."""
PARTS = 4
"""Of a pilot, whose differences tell its error."""


class Automatic(AutomaticSample):
    """The same for whole images: it chooses the camera samples, too.

    Every pixel gets a pilot of a few samples; the rest of the budget goes where :func:`.adaptive.plan_samples`
    puts it. Where the pilots around a pixel say that it pays, light on what is matte gets a control variate. ``spp`` is
    the mean over the image. Spectral variants, films that are not made of colours and sensors that are no cameras get
    Mitsuba's own order of samples, and no variate.
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self._plain = AutomaticSample(props)
        self._plain._cache = self._cache
        self._launcher: Launcher | None = None

    @one_at_a_time
    def render(
        self,
        scene: mi.Scene,
        sensor: mi.Sensor | int = 0,
        seed: int | mi.UInt32 = 0,
        spp: int = 0,
        develop: bool = True,
        evaluate: bool = True,
    ) -> mi.TensorXf:
        """As Mitsuba's."""
        if isinstance(sensor, int):
            sensor = scene.sensors()[sensor]
        if not self.adapts_to(scene, sensor):
            return self._plain.render(scene, sensor, seed, spp, develop, evaluate)
        *_, (raw, _) = self.passes(scene, sensor, seed, spp)
        film = sensor.film()
        film.prepare([])
        film.put_block(mi.ImageBlock(mi.TensorXf(raw), film.crop_offset()))
        return film.develop() if develop else mi.TensorXf()

    def render_forward(
        self, scene: mi.Scene, params: Any, sensor: mi.Sensor | int = 0, seed: int | mi.UInt32 = 0, spp: int = 0
    ) -> mi.TensorXf:
        """As Mitsuba's, from the same estimate in Mitsuba's own order of samples."""
        return self._plain.render_forward(scene, params, sensor, seed, spp)

    def render_backward(
        self,
        scene: mi.Scene,
        params: Any,
        grad_in: mi.TensorXf,
        sensor: mi.Sensor | int = 0,
        seed: int | mi.UInt32 = 0,
        spp: int = 0,
    ) -> None:
        """As Mitsuba's, from the same estimate in Mitsuba's own order of samples."""
        self._plain.render_backward(scene, params, grad_in, sensor, seed, spp)

    def adapts_to(self, scene: mi.Scene, sensor: mi.Sensor) -> bool:
        """Whether :meth:`passes` can render this."""
        film = sensor.film()
        if sensor.class_name() not in CAMERAS:
            return False
        special = mi.has_flag(film.flags(), mi.FilmFlags.Special) or mi.has_flag(film.flags(), mi.FilmFlags.Spectral)
        return not (mi.is_spectral or special or film.sample_border()) and self.prepare(scene) is not None

    def passes(
        self, scene: mi.Scene, sensor: mi.Sensor, seed: int | mi.UInt32 = 0, spp: int = 0
    ) -> Iterator[tuple[_Pixels, float]]:
        """Render launch by launch: the image so far, with the film's channels and weights, and its samples per pixel.

        Only what :meth:`adapts_to` can be rendered so.
        """
        return step_by_step(self._passes(scene, sensor, seed, spp))

    def _passes(
        self, scene: mi.Scene, sensor: mi.Sensor, seed: int | mi.UInt32, spp: int
    ) -> Iterator[tuple[_Pixels, float]]:
        spp = spp or sensor.sampler().sample_count()
        light = self.prepare(scene)
        assert light is not None
        sensor.film().prepare([])
        launcher = self._launcher_of(scene, sensor)
        launcher.begin(light)
        view = _View(launcher, launcher.look() if light.allocation.any_bsdf_samples else None)
        seed = mi.UInt32(seed)
        dr.make_opaque(seed)  # or every value would be compiled into a kernel of its own

        few = _pilot(spp)
        # As neighbours' errors choose the number of a pixel's samples, they may share those of the map only where all
        # do, the pilot's and the later ones: with any such set fixed, pixels are independent.
        shared = launcher.light_samples(mix(~seed)) if view.pixels * spp <= LAUNCH else None
        if few < spp:
            view.counts = Visibility.nothing(view.width, view.height)
        grey = light.tables.energy / (4 * np.pi) * float(light.scale[0])
        pilot = _Pilot(view, few, min(PARTS, few), shared, grey)
        dim = DIM * grey
        for rendered in pilot.passes(seed, dim):
            if rendered < few:
                yield pilot.image(0), rendered
        plan = pilot.plan(dim, spp)
        first = pilot.image(plan.share.numpy().reshape(plan.counts.shape))
        yield first, float(few)
        if few == spp:
            return

        view.learn()
        counts = plan.counts.ravel() - few
        expected = dr.maximum(plan.level, dim)
        block = view.film.create_block()
        for k, (start, end) in enumerate(view.launches(counts)):
            samples = shared if shared is not None else launcher.light_samples(mix(mix(seed) + mi.UInt32(k + 1)))
            lanes = view.samples(few + start, end - start, seed, expected, samples)
            L = lanes.L + dr.gather(mi.Float, plan.share, lanes.pixel) * lanes.difference
            weight = dr.rcp(mi.Float(dr.gather(mi.UInt32, _unsigned(counts), lanes.pixel)))
            view.put(block, lanes, L, lanes.alpha, weight)
            dr.eval(block.tensor())
            done = end.reshape(plan.counts.shape)
            yield _combined(first, _image(block), few, done), few + float(done.mean())

    def _launcher_of(self, scene: mi.Scene, sensor: mi.Sensor) -> Launcher:
        if self._launcher is None or self._launcher.scene is not scene or self._launcher.sensor is not sensor:
            self._launcher = Launcher(self, scene, sensor)
        return self._launcher


@dataclass
class _Lanes:
    """Camera samples: ``index`` within its ``pixel``, radiance ``L``, the variate's ``difference``, and place."""

    pixel: mi.UInt32
    index: mi.UInt32
    L: mi.Spectrum
    difference: mi.Spectrum
    alpha: mi.Bool | mi.Float
    place: mi.Point2f


class _View:
    """The film of a sensor, and launches of samples for it, which add to ``counts`` or make use of what is ``learned``
    (see :class:`~.visibility.Visibility`)."""

    def __init__(self, launcher: Launcher, look: Look | None) -> None:
        self.launcher, self.look = launcher, look
        self.film = launcher.sensor.film()
        self.width, self.height = (int(side) for side in self.film.crop_size())
        self.pixels = self.width * self.height
        self.counts: tuple[mi.UInt32, mi.UInt32] | None = None
        self.learned: mi.Float | None = None

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
    ) -> _Lanes:
        """``number`` samples of each pixel, from the ``first`` on; ``expected`` is one for each, or one for all."""
        pixel = mi.UInt32(np.repeat(np.arange(self.pixels, dtype=np.uint32), number))
        before = np.cumsum(number) - number - first  # the first lane of a pixel, less the index of its sample
        index = dr.arange(mi.UInt32, dr.width(pixel)) - dr.gather(mi.UInt32, _unsigned(before), pixel)
        if dr.width(expected) > 1:
            expected = dr.gather(mi.Float, expected, pixel)
        dr.eval(index, expected)
        detailed = self.look.detailed if self.look else None
        launch = Launch(pixel, index, seed, expected, shared, detailed, self.counts, self.learned)
        return _Lanes(pixel, index, *self.launcher.samples(launch))

    def learn(self) -> None:
        """Make use of what was counted, from now on."""
        assert self.counts is not None
        self.learned = Visibility.learn(self.counts)
        self.counts = None

    def put(
        self, block: mi.ImageBlock, lanes: _Lanes, value: mi.Spectrum, alpha: mi.Bool | mi.Float, weight: mi.Float
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


class _Pilot:
    """A few samples of every pixel, and what follows from them."""

    def __init__(self, view: _View, count: int, parts: int, shared: mi.Float | None, grey: float) -> None:
        self.view, self.count, self.parts, self._shared, self._grey = view, count, parts, shared, grey
        self._images = view.film.create_block(), view.film.create_block()
        self._sums = [dr.zeros(mi.Float, 3 * parts * view.pixels) for _ in range(2)]

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
            weight = dr.opaque(mi.Float, 1 / count)
            view.put(self._images[0], lanes, lanes.L, lanes.alpha, weight)
            view.put(self._images[1], lanes, lanes.difference, mi.Bool(False), weight)
            dr.eval(*(block.tensor() for block in self._images), self._sums)
            yield float(last.mean())

    def _worth(self, lanes: _Lanes) -> mi.Spectrum:
        """What errors are looked for in: the radiance, or that over a picture as ``grey`` as the map where alpha is a
        share, or shadows would not count there."""
        if dr.is_mask_v(lanes.alpha):
            return lanes.L
        return lanes.L + (1 - lanes.alpha) * dr.opaque(mi.Float, self._grey)

    def image(self, share: NDArray[np.float32] | float) -> _Pixels:
        """The image, with a ``share`` of the variate's difference in each pixel."""
        image, difference = (_image(block) for block in self._images)
        image[..., :-1] += np.asarray(share, dtype=np.float32)[..., None] * difference[..., :-1]
        return image

    def plan(self, dim: float, budget: int) -> Plan:
        """How to go on."""
        view = self.view
        shape = (3, self.parts, view.height, view.width)
        scale = dr.opaque(mi.Float, self.parts / self.count)
        pilot, difference = (mi.TensorXf(sums * scale, shape) for sums in self._sums)
        filter = view.film.rfilter()
        box = filter.is_box_filter()
        # With a wider filter, a sample counts in several pixels, so each needs later ones.
        least, footprint = (self.count, 0) if box else (2 * self.count, int(np.ceil(filter.radius() - 0.5)))
        marks = view.look.marks if view.look else ()
        return plan_samples(pilot, difference, dim, max(budget, least), least, footprint, marks)


def _pilot(spp: int) -> int:
    """Samples of a pilot for ``spp`` in all, a power of two."""
    return max(1, (1 << spp.bit_length()) >> 4)


def _unsigned(numbers: NDArray[np.int64]) -> mi.UInt32:
    """Modulo 2³²."""
    return mi.UInt32(numbers.astype(np.uint32))


def _image(block: mi.ImageBlock) -> _Pixels:
    """The image that a block stands for, (H, W, C), every pixel with weight 1 where it has any."""
    sums = block.tensor().numpy()
    weight = sums[..., -1:]
    return np.divide(sums, weight, out=np.zeros_like(sums), where=weight != 0)


def _combined(pilot: _Pixels, later: _Pixels, few: int, counts: NDArray[np.int64]) -> _Pixels:
    """The mean of ``few`` samples and of ``counts`` later ones."""
    share = np.where(later[..., -1] != 0, counts / (few + counts), 0)[..., None].astype(np.float32)
    return pilot + share * (later - pilot)
