"""``direct_stratified`` by itself: a pilot of every pixel, then samples where the error is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import drjit as dr
import mitsuba as mi

from ...sampling.points import mix
from ...sampling.recording import one_at_a_time, step_by_step
from ..sums import Memory, Pixels
from .launch import Launcher
from .lobes import DIM
from .sample import AutomaticSample
from .view import Noise, Pilot, View, pilot_samples
from .visibility import Visibility

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
        *_, (raw, *_) = self.passes(scene, sensor, seed, spp)
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
        self,
        scene: mi.Scene,
        sensor: mi.Sensor,
        seed: int | mi.UInt32 = 0,
        spp: int = 0,
        memory: Memory | None = None,
    ) -> Iterator[tuple[Pixels, float, Noise]]:
        """Render launch by launch: the image so far, with the film's channels and weights, its samples per pixel, and
        its noise (:meth:`~..sums.Sums.noise`).

        ``spp``: :data:`~..sums.UNLIMITED` for as many as are asked for. ``memory``: begins empty, and is of all that is
        done whenever there is an image; with a memory of the same picture it goes on from there. Only what
        :meth:`adapts_to` can be rendered so.
        """
        return step_by_step(self._passes(scene, sensor, seed, spp, {} if memory is None else memory))

    def _passes(
        self, scene: mi.Scene, sensor: mi.Sensor, seed: int | mi.UInt32, spp: int, memory: Memory
    ) -> Iterator[tuple[Pixels, float, Noise]]:
        spp = spp or sensor.sampler().sample_count()
        light = self.prepare(scene)
        assert light is not None
        sensor.film().prepare([])
        launcher = self._launcher_of(scene, sensor)
        launcher.begin(light)
        view = View(launcher, launcher.look() if light.allocation.any_bsdf_samples else None)
        seed = mi.UInt32(seed)
        dr.make_opaque(seed)  # or every value would be compiled into a kernel of its own

        few = pilot_samples(spp)
        # As neighbours' errors choose the number of a pixel's samples, they may share those of the map only where all
        # do, the pilot's and the later ones: with any such set fixed, pixels are independent.
        shared = launcher.light_samples(mix(~seed)) if view.at_once(spp) else None
        dim = DIM * light.mean
        if "first" not in memory:
            if few < spp:
                view.counts = Visibility.nothing(view.width, view.height)
            pilot = Pilot(view, few, min(PARTS, few), shared, light.mean)
            for rendered in pilot.passes(seed, dim):
                if rendered < few:
                    yield pilot.image(0), rendered, None
            plan = pilot.plan(dim, spp)
            memory["first"] = pilot.image(plan.share.numpy().reshape(plan.counts.shape))
            memory["counts"], memory["level"], memory["share"] = plan.counts, plan.level.numpy(), plan.share.numpy()
            memory["learned"] = view.learn()
        yield memory["first"], float(few), None
        if few == spp:
            return

        view.learned = mi.Float(memory["learned"])
        level, share = mi.Float(memory["level"]), mi.Float(memory["share"])
        yield from view.later(
            memory["first"], few, memory["counts"] - few, seed, dr.maximum(level, dim), shared, share, memory
        )

    def _launcher_of(self, scene: mi.Scene, sensor: mi.Sensor) -> Launcher:
        if self._launcher is None or self._launcher.scene is not scene or self._launcher.sensor is not sensor:
            self._launcher = Launcher(self, scene, sensor)
        return self._launcher
