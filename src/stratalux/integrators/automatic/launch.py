"""Camera samples of chosen pixels: traced and compiled once for a camera, replayed from then on."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import drjit as dr
import mitsuba as mi

from ...sampling.points import mix, sobol_2d
from ...sampling.recording import living_bsdfs, recorded
from ..both_ways import BothWays
from ..derivatives import parameters
from ..light_samples import SharedLight
from ..other_emitters import OtherEmitters
from ..sight import Sight
from .look import Look, look, shape_numbers
from .nested_strata import PixelPoints
from .sample import AllocatedLight
from .visibility import Visibility

_RECORDINGS = 8
"""Kept for one camera: a pilot's, later ones', and some changes of what is compiled into kernels."""

Constants = dict[int, tuple[Hashable, ...]]
"""Of parts of a scene, by their addresses."""
Group = tuple[mi.UInt32, mi.UInt32] | None
"""The first of the lanes that one belongs together with, and the one after the last."""
_Samples = tuple[mi.Spectrum, mi.Spectrum, mi.Bool | mi.Float, mi.Point2f]


@dataclass
class Launch:
    """Which samples to take: number ``index`` of each ``pixel``.

    ``seed``: of the points of all pixels, opaque. ``expected``: luminance at each lane, or one for all. ``shared``: the
    samples of the map that all lanes share, from :meth:`Launcher.light_samples`; None where each is to have its own.
    ``detailed``: for every pixel of the film, as in a :class:`~.look.Look`; None where that makes no difference.
    ``counts`` and ``learned``: those of a :class:`~.visibility.Visibility`. ``group``: lanes that share what they find.
    """

    pixel: mi.UInt32
    index: mi.UInt32
    seed: mi.UInt32
    expected: mi.Float
    shared: mi.Float | None
    detailed: mi.UInt32 | None
    counts: tuple[mi.UInt32, mi.UInt32] | None
    learned: mi.Float | None
    group: Group = None

    def start_counting(self) -> None:
        """Again: what was counted so far would be counted twice."""
        for count in self.counts or ():
            count &= 0
        dr.make_opaque(self.counts)


class Estimator(Protocol):
    """What is launched: the part of an integrator of ours that knows of no film."""

    hide_emitters: bool

    def sight(self, scene: mi.Scene, prepared: Any, sensor: mi.Sensor | None) -> Sight:
        """What rays see of ``scene``."""

    def radiance(
        self,
        scene: mi.Scene,
        prepared: Any,
        others: OtherEmitters,
        sight: Sight,
        sampler: PixelPoints,
        ray: mi.RayDifferential3f,
        active: mi.Bool | bool,
    ) -> tuple[mi.Spectrum, mi.Bool | mi.Float]:
        """Radiance along ``ray``, and its alpha."""


class Launcher:
    """Takes camera samples of a ``sensor``. Python traces a kernel in 5 to 10 ms, as long as small images render.

    What the scene has in arrays may change from image to image. Everything else that Mitsuba lets be changed is
    compared at the beginning of each, and traced anew if it differs.
    """

    def __init__(self, integrator: Estimator, scene: mi.Scene, sensor: mi.Sensor) -> None:
        self.integrator, self.scene, self.sensor = integrator, scene, sensor
        self._light: AllocatedLight[Any] | None = None
        self._others: OtherEmitters | None = None
        self._sight: Sight | None = None
        self._numbers: mi.UInt32 | None = None
        self._fixed: tuple[Hashable, ...] = ()
        self._recorded: dict[Callable[..., Any], Callable[..., Any]] = {}
        self.record(self._samples, self._light_samples, look)

    def record(self, *functions: Callable[..., Any]) -> None:
        """Prepare ``functions`` to be :meth:`replayed`."""
        for function in functions:
            self._recorded[function] = recorded(function, state_fn=self._state, limit=_RECORDINGS)

    def begin(self, light: AllocatedLight[Any], known: Constants | None = None) -> None:
        """Look at the scene as it is now; the launches that follow render that. ``known``: what has been seen of it by
        other launchers of the same picture."""
        self._light, self._sight = light, self.integrator.sight(self.scene, light, self.sensor)
        self._others = OtherEmitters(self.scene, True, obstacles=self._sight.obstacles)
        parts = self.scene, self.sensor, *self._sight.parts()
        known = {} if known is None else known
        for part in parts:
            if part.ptr not in known:
                known[part.ptr] = tuple(_constants(part))
        self._fixed = tuple(constant for part in parts for constant in known[part.ptr])
        # Its state, as wide as the last wavefront of another integrator, would be handed to every kernel replayed.
        self.sensor.sampler().seed(0, 1)

    def samples(self, launch: Launch) -> tuple[Any, ...]:
        """Radiance, difference of the variate, alpha, and place in pixels of each sample; its cost, if they differ."""
        samples: _Samples = self.replayed(self._samples, launch)
        return samples

    def light_samples(self, seed: mi.UInt32) -> mi.Float:
        """Samples of the map for launches that share them: one in each leaf."""
        records: mi.Float = self._recorded[self._light_samples](seed)
        return records

    def look(self) -> Look:
        """At every pixel of a scene with shapes."""
        width, height = (int(side) for side in self.sensor.film().crop_size())
        corner, pixel = dr.arange(mi.UInt32, (width + 1) * (height + 1)), dr.arange(mi.UInt32, width * height)
        dr.eval(corner, pixel)
        if self._numbers is None:
            self._numbers = shape_numbers(self.scene)
        return self.replayed(look, self._numbers, corner, pixel)

    def replayed(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """``function`` of the scene, the sensor, the width and the size of the film in pixels, and ``arguments``."""
        size = self.sensor.film().crop_size()
        width, extent = mi.UInt32(int(size[0])), mi.Vector2f(float(size[0]), float(size[1]))
        dr.make_opaque(width, extent)
        arguments = self.scene, self.sensor, width, extent, *arguments
        try:
            return self._recorded[function](*arguments)
        except RuntimeError:
            # Dr.Jit cannot record every scene: not one without shapes, for instance.
            self._recorded[function] = function
            for argument in arguments:
                if isinstance(argument, Launch):
                    argument.start_counting()
            return function(*arguments)

    def _samples(
        self, scene: mi.Scene, sensor: mi.Sensor, width: mi.UInt32, extent: mi.Vector2f, launch: Launch
    ) -> _Samples:
        light, others, sight = self.seen
        points, ray, importance, place = camera_samples(sensor, width, extent, launch)
        L, alpha = self.integrator.radiance(scene, light, others, sight, points, ray, True)
        return L * importance, points.difference * importance, alpha, place

    def share(self, ways: BothWays | None) -> None:
        """Share what there is to find with paths from the map; None without such."""
        self.seen[-1].ways = ways

    @property
    def seen(self) -> tuple[AllocatedLight[Any], OtherEmitters, Sight]:
        """What the scene has, as it was at the last :meth:`begin`."""
        assert self._light is not None and self._others is not None and self._sight is not None
        return self._light, self._others, self._sight

    def _light_samples(self, seed: mi.UInt32) -> mi.Float:
        assert self._light is not None
        return SharedLight.drawn(self._light, seed)

    def _state(self, *_: Any) -> Any:
        """What a launch depends on besides its arguments."""
        light, others, sight = self.seen
        arrays = light.arrays(), light.tables.arrays(), others.arrays(), sight.arrays()
        return arrays, light.tables.depth, self.integrator.hide_emitters, self._fixed, living_bsdfs()


def camera_samples(
    sensor: mi.Sensor, width: mi.UInt32, extent: mi.Vector2f, launch: Launch
) -> tuple[PixelPoints, mi.RayDifferential3f, mi.Spectrum, mi.Point2f]:
    """Points, rays and their weights, and places in pixels of the samples of a ``launch``."""
    samples = None if launch.shared is None else SharedLight(launch.shared)
    points = PixelPoints(launch.index, mix(launch.pixel ^ mix(launch.seed)), samples, launch.expected)
    if launch.detailed is not None:
        points.detailed = dr.gather(mi.UInt32, launch.detailed, launch.pixel)
    row = launch.pixel // width
    column = launch.pixel - row * width
    points.visibility = Visibility(Visibility.tile(column, row, width), launch.counts, launch.learned)
    place = mi.Vector2f(mi.Float(column), mi.Float(row))
    place += sobol_2d(points.index, mix(points.seed ^ 0x51633E2D))
    aperture = points.next_2d() if sensor.needs_aperture_sample() else mi.Point2f(0.5)
    time = mi.Float(sensor.shutter_open())
    if sensor.shutter_open_time() > 0:
        time += points.next_1d() * sensor.shutter_open_time()
    ray, importance = sensor.sample_ray_differential(time, mi.Float(0), mi.Point2f(place / extent), aperture)
    return points, ray, importance, mi.Point2f(place)


def _constants(part: mi.Object) -> Iterator[Hashable]:
    """What may be compiled into a kernel: numbers that are no arrays, and the shapes of those that are."""
    for _, value in parameters(part):
        if dr.is_tensor_v(value):
            yield tuple(value.shape)
        elif isinstance(value, bool | int | float | str):
            yield value
        elif dr.is_array_v(value) and not dr.is_jit_v(value):
            yield str(value)
