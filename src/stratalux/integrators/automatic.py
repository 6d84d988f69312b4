"""``direct_stratified`` by itself: a pilot of every pixel, then samples where the error is."""

from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..adaptive import Plan, plan_samples
from ..environment import MapCache, MapLight
from ..leaf_sampler import LeafSampler
from ..points import mix, sobol_2d
from .common import DirectIntegrator
from .light_samples import FreshLight, SharedLight
from .lobes import Allocation
from .nested_strata import NestedStrata, PixelPoints

_Pixels = NDArray[np.float32]

LAUNCH = 1 << 21
"""Camera samples of one launch, about: a second on two cores."""
PILOT_FROM = 4
"""Samples per pixel from which a pilot pays."""
PARTS = 4
"""Of a pilot, whose differences tell its error; two where it has only two samples."""
DIM = 0.15
"""Of the map's mean radiance: surfaces darker than that are not thought to be looked at for their noise."""


class AutomaticSample(DirectIntegrator):
    """The estimate for a camera sample, in whatever order Mitsuba or another integrator asks for them."""

    automatic = True
    strata, proposals, bsdf_samples = 0, 0, -1

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self._cache: MapCache[LeafSampler] = MapCache(LeafSampler)
        self._scene: mi.Scene | None = None

    def prepare(self, scene: mi.Scene) -> MapLight[LeafSampler] | None:
        """Build (or fetch) the tables for ``scene``; rendering calls this by itself."""
        light = self._cache.get(scene)
        if light is not None and self._scene is not scene:
            self._allocation, self._scene = Allocation(scene), scene
        return light

    def environment_light(
        self,
        scene: mi.Scene,
        light: MapLight[LeafSampler],
        sampler: mi.Sampler | PixelPoints,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        points = sampler if isinstance(sampler, PixelPoints) else PixelPoints.of(sampler)
        samples = points.samples or FreshLight(light, points.seed)
        return NestedStrata(self._allocation, points, samples).estimate(scene, light, si, bsdf, active)

    def to_string(self) -> str:
        return "DirectStratified[automatic]"


class Automatic(AutomaticSample):
    """The same for whole images: it chooses the camera samples, too.

    Every pixel gets a pilot of a few samples; the rest of the budget goes where :func:`stratalux.adaptive.plan_samples`
    puts it. ``spp`` is the mean over the image. Few samples are spread evenly. Spectral variants and films that are not
    made of colours get Mitsuba's own order of samples.
    """

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self._plain = AutomaticSample(props)
        self._plain._cache = self._cache

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

    def adapts_to(self, scene: mi.Scene, sensor: mi.Sensor) -> bool:
        """Whether :meth:`passes` can render this."""
        film = sensor.film()
        special = mi.has_flag(film.flags(), mi.FilmFlags.Special) or mi.has_flag(film.flags(), mi.FilmFlags.Spectral)
        return not (mi.is_spectral or special or film.sample_border()) and self.prepare(scene) is not None

    def passes(
        self, scene: mi.Scene, sensor: mi.Sensor, seed: int | mi.UInt32 = 0, spp: int = 0
    ) -> Iterator[tuple[_Pixels, float]]:
        """Render launch by launch: the image so far, with the film's channels and weights, and its samples per pixel.

        Only what :meth:`adapts_to` can be rendered so.
        """
        spp = spp or sensor.sampler().sample_count()
        light = self.prepare(scene)
        assert light is not None
        sensor.film().prepare([])
        view = _View(self, scene, sensor, light)
        seed = mi.UInt32(seed)
        dr.make_opaque(seed)  # or every value would be compiled into a kernel of its own

        few = spp if spp < PILOT_FROM else _pilot(spp)
        parts = min(PARTS, few)
        groups = None if few == spp else dr.zeros(mi.Float, 3 * parts * view.pixels)
        dim = DIM * light.tables.energy / (4 * np.pi) * float(light.scale[0])
        block = view.film.create_block()
        rows = max(1, LAUNCH // (few * view.width))
        for top in range(0, view.height, rows):
            bottom = min(view.height, top + rows)
            view.even(block, groups, parts, seed, few, dim, top, bottom)
            if bottom < view.height:
                yield _image(block), few * bottom / view.height
        pilot = _image(block)
        yield pilot, float(few)
        if groups is None:
            return

        plan = view.plan(groups, parts, few, dim, spp)
        counts = plan.counts.ravel() - few
        expected = mi.Float(np.maximum(plan.level, dim).astype(np.float32).ravel())
        rounds = -(-int(counts.sum()) // LAUNCH)
        block = view.film.create_block()
        for k in range(rounds):
            samples = SharedLight(light, mix(seed + mi.UInt32(k + 1)))
            start, end = k * counts // rounds, (k + 1) * counts // rounds
            view.uneven(block, seed, samples, few + start, end - start, counts, expected)
            done = end.reshape(plan.counts.shape)
            yield _combined(pilot, _image(block), few, done), few + float(done.mean())


class _View:
    """The pixels of a sensor, and the launches that give them samples."""

    def __init__(self, integrator: Automatic, scene: mi.Scene, sensor: mi.Sensor, light: MapLight[LeafSampler]) -> None:
        self.integrator, self.scene, self.sensor, self.light = integrator, scene, sensor, light
        self.film = sensor.film()
        self.width, self.height = (int(side) for side in self.film.crop_size())
        self.pixels = self.width * self.height

    def even(
        self,
        block: mi.ImageBlock,
        groups: mi.Float | None,
        parts: int,
        seed: mi.UInt32,
        count: int,
        expected: float,
        top: int,
        bottom: int,
    ) -> None:
        """``count`` samples of every pixel of some rows; sums over ``parts`` of a pixel's samples go to ``groups``."""
        lane = dr.arange(mi.UInt32, (bottom - top) * self.width * count)
        each = dr.opaque(mi.UInt32, count)
        pixel = lane // each
        index = lane - pixel * each
        pixel += dr.opaque(mi.UInt32, top * self.width)
        points = PixelPoints(index, mix(pixel ^ mix(seed)), None, dr.opaque(mi.Float, expected))
        L = self._samples(block, pixel, points, mi.Float(1))
        if groups is not None:
            group = index * dr.opaque(mi.UInt32, parts) // each
            for c in range(3):
                dr.scatter_add(groups, L[c % dr.size_v(mi.Spectrum)], 3 * (group * self.pixels + pixel) + c)
        dr.eval(block.tensor(), groups)

    def uneven(
        self,
        block: mi.ImageBlock,
        seed: mi.UInt32,
        samples: SharedLight,
        first: NDArray[np.int64],
        number: NDArray[np.int64],
        counts: NDArray[np.int64],
        expected: mi.Float,
    ) -> None:
        """Of the samples of each pixel, ``number`` from the ``first`` on, which share a weight with all ``counts``."""
        pixel = mi.UInt32(np.repeat(np.arange(self.pixels, dtype=np.uint32), number))
        before = np.cumsum(number) - number - first  # the first lane of a pixel, less the index of its sample
        index = dr.arange(mi.UInt32, dr.width(pixel)) - dr.gather(mi.UInt32, _unsigned(before), pixel)
        points = PixelPoints(index, mix(pixel ^ mix(seed)), samples, dr.gather(mi.Float, expected, pixel))
        self._samples(block, pixel, points, dr.rcp(mi.Float(dr.gather(mi.UInt32, _unsigned(counts), pixel))))
        dr.eval(block.tensor())

    def _samples(self, block: mi.ImageBlock, pixel: mi.UInt32, points: PixelPoints, weight: mi.Float) -> mi.Spectrum:
        """A camera sample for each lane, put into the block with its ``weight``; their radiance."""
        y = pixel // dr.opaque(mi.UInt32, self.width)
        corner = mi.Vector2f(mi.Float(pixel - y * dr.opaque(mi.UInt32, self.width)), mi.Float(y))
        position = corner + sobol_2d(points.index, mix(points.seed ^ 0x51633E2D))
        sensor = self.sensor
        aperture = points.next_2d() if sensor.needs_aperture_sample() else mi.Point2f(0.5)
        time = mi.Float(sensor.shutter_open())
        if sensor.shutter_open_time() > 0:
            time += points.next_1d() * sensor.shutter_open_time()
        ray, importance = sensor.sample_ray_differential(
            time, mi.Float(0), position / mi.ScalarVector2f(self.film.crop_size()), aperture
        )
        L, valid = self.integrator.radiance(self.scene, self.light, points, ray, True)
        L = L * importance
        box = self.film.rfilter().is_box_filter()
        place = (corner if box else position) + mi.Vector2f(self.film.crop_offset())
        block.put(place, [], L * weight, dr.select(valid, weight, 0), weight)
        return L

    def plan(self, groups: mi.Float, parts: int, count: int, dim: float, budget: int) -> Plan:
        """What follows from the sums of a pilot of ``count`` samples."""
        means = groups.numpy().reshape(parts, self.height, self.width, 3) * (parts / count)
        filter = self.film.rfilter()
        if filter.is_box_filter():
            return plan_samples(means, dim, budget, count)
        # A sample counts in several pixels, so each needs later ones.
        return plan_samples(means, dim, budget, 2 * count, int(np.ceil(filter.radius() - 0.5)))


def _pilot(spp: int) -> int:
    """Samples of a pilot for ``spp`` in all, a power of two."""
    return max(2, (1 << spp.bit_length()) >> 4)


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
