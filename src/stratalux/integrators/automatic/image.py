"""``direct_stratified`` by itself: a pilot of every pixel, then samples where the error is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, TypeVar

import drjit as dr
import mitsuba as mi

from ...sampling.recording import one_at_a_time, step_by_step
from ..environment import image_emitter
from ..launches import Arrays, Maker, here, of_part
from ..memory import samples_at_once
from ..sums import Memory, Noise, Pixels
from .launch import Constants, Launcher
from .lobes import DIM
from .sample import AllocatedLight, AutomaticSample
from .stages import PARTS, TwoStages
from .view import IMAGE_BYTES, LEAST, PART_BYTES, PIXEL_BYTES, SAMPLE_BYTES, SHARE, View, pilot_samples

AnyLauncher = TypeVar("AnyLauncher", bound=Launcher)
CAMERAS = ("PerspectiveCamera", "ThinLensCamera", "OrthographicCamera", "BatchSensor")
"""What has pixels that are neighbours of each other."""


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
        self._launchers: dict[str, Launcher] = {}
        self.max_memory: int | None = None
        """Bytes that launches may take, with all that the process has; None for half of what the machine has."""
        self._under_way: dict[str, TwoStages] = {}
        self._constants: Constants = {}
        """Of the picture that is under way."""

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
        return not (mi.is_spectral or special or film.sample_border()) and image_emitter(scene) is not None

    def passes(
        self,
        scene: mi.Scene,
        sensor: mi.Sensor,
        seed: int | mi.UInt32 = 0,
        spp: int = 0,
        memory: Memory | None = None,
        make: Maker = here,
    ) -> Iterator[tuple[Pixels, float, Noise]]:
        """Render launch by launch: the image so far, with the film's channels and weights, its samples per pixel, and
        its noise (:meth:`~..sums.Sums.noise`).

        ``spp``: :data:`~..sums.UNLIMITED` for as many as are asked for. ``memory``: begins empty, and is of all that is
        done whenever there is an image; with a memory of the same picture it goes on from there. ``make``: who makes
        the launches. Only what :meth:`adapts_to` can be rendered so.
        """
        return step_by_step(self._passes(scene, sensor, seed, spp, {} if memory is None else memory, make))

    def _passes(
        self, scene: mi.Scene, sensor: mi.Sensor, seed: int | mi.UInt32, spp: int, memory: Memory, make: Maker
    ) -> Iterator[tuple[Pixels, float, Noise]]:
        parts = self._parts(scene, sensor, seed, spp or sensor.sampler().sample_count(), memory)
        self._under_way = parts
        yield from parts["direct"].passes(of_part(make, "direct"))

    @property
    def work(self) -> dict[str, tuple[float, float]]:
        """Samples of a pixel that are done, and all there will be, of each kind in the picture that is under way."""
        return {name + kind: done for name, part in self._under_way.items() for kind, done in part.work.items()}

    @one_at_a_time
    def launch(
        self, scene: mi.Scene, sensor: mi.Sensor, seed: int, spp: int, stage: str, known: Memory
    ) -> Callable[[int], Arrays]:
        """That of a ``stage`` of :meth:`passes`, for who makes launches elsewhere: see :class:`~..launches.Maker`."""
        part, _, name = stage.partition("/")
        made = self._parts(scene, sensor, seed, spp, {part: dict(known)})[part].launch(name)

        @one_at_a_time
        def launch(k: int) -> Arrays:
            with dr.suspend_grad():
                return made(k)

        return launch

    def _parts(
        self, scene: mi.Scene, sensor: mi.Sensor, seed: int | mi.UInt32, spp: int, memory: Memory
    ) -> dict[str, TwoStages]:
        """Images that make up the picture, by name; each has its part of the ``memory``."""
        return {"direct": self._direct(self._begin(scene, sensor), scene, sensor, seed, spp, memory)}

    def _direct(
        self,
        light: AllocatedLight,
        scene: mi.Scene,
        sensor: mi.Sensor,
        seed: int | mi.UInt32,
        spp: int,
        memory: Memory,
    ) -> TwoStages:
        launcher = self._launcher("direct", light, scene, sensor, partial(Launcher, self))
        own, dim = memory.setdefault("direct", {}), DIM * light.mean
        few, grey = pilot_samples(spp), light.mean
        most = self._most(sensor, own, spp)
        view = View(launcher, launcher.look() if light.allocation.any_bsdf_samples else None, most)
        return TwoStages(view, few, spp, opaque_seed(seed), dim, own, grey=grey, varied=True)

    def _pilots(self, sensor: mi.Sensor, spp: int) -> tuple[int, ...]:
        """Samples of the pilots of all images, where there are ``spp`` of direct light."""
        return (pilot_samples(spp),)

    def _most(self, sensor: mi.Sensor, own: Memory, spp: int) -> int:
        """Samples under way at the same time; as before, where an image goes on that has this ``own`` memory. ``spp``:
        of direct light."""
        width, height = (int(side) for side in sensor.film().crop_size())
        least = max(LEAST, width * height // SHARE)
        pilots = self._pilots(sensor, spp)
        of_pixel = PIXEL_BYTES + sum(IMAGE_BYTES + PART_BYTES * min(PARTS, few) for few in pilots)
        most = samples_at_once(self.max_memory, (width, height), of_pixel, SAMPLE_BYTES, least)
        own["most"] = min(most, int(own.get("most", most)))
        return own["most"]  # type: ignore[no-any-return]

    def _begin(self, scene: mi.Scene, sensor: mi.Sensor) -> AllocatedLight:
        light = self.prepare(scene)
        assert light is not None
        sensor.film().prepare([])
        self._constants = {}
        return light

    def _launcher(
        self,
        part: str,
        light: AllocatedLight[Any],
        scene: mi.Scene,
        sensor: mi.Sensor,
        make: Callable[[mi.Scene, mi.Sensor], AnyLauncher],
    ) -> AnyLauncher:
        """That of a part of the picture, which is kept for the next one; it has begun."""
        launcher = self._launchers.get(part)
        if launcher is None or launcher.scene is not scene or launcher.sensor is not sensor:
            launcher = self._launchers[part] = make(scene, sensor)
        launcher.begin(light, self._constants)
        return launcher  # type: ignore[return-value]  # a part has one kind


def opaque_seed(seed: int | mi.UInt32) -> mi.UInt32:
    """Or every value would be compiled into a kernel of its own."""
    found = mi.UInt32(seed)
    dr.make_opaque(found)
    return found
