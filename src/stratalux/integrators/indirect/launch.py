"""Launches in two steps: all paths begin, and those that meet a second surface are followed in lanes of their own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from ...sampling.points import mix
from ..automatic.launch import Estimator, Launch, Launcher, camera_samples
from ..light_samples import FreshLight, SharedLight
from .paths import Paths, Way
from .vertex import VertexLight

FOLLOWED = 11.0
"""Cost of a path that meets a second surface, where one that does not costs 1."""


class PathLauncher(Launcher):
    """As :class:`~.automatic.launch.Launcher`, for ``paths``. Where one in ten goes on, the other lanes would idle."""

    def __init__(self, integrator: Estimator, paths: Paths, scene: mi.Scene, sensor: mi.Sensor) -> None:
        super().__init__(integrator, scene, sensor)
        self._paths = paths
        self._begin: Callable[..., Any] = self._begin_paths
        self._follow: Callable[..., Any] = self._follow_paths
        self.record(self._begin, self._follow)

    def samples(self, launch: Launch) -> tuple[mi.Spectrum, mi.Spectrum, mi.Bool, mi.Point2f, mi.Float]:
        """Radiance, nothing for the variate and for alpha, place in pixels, and cost of each sample."""
        way, importance, place = self.replayed(self._begin, launch)
        L = dr.zeros(mi.Spectrum, dr.width(launch.pixel))
        lanes = dr.compress(way.alive)
        if len(lanes):
            some = way.at(lanes)
            index, pixel = dr.gather(mi.UInt32, launch.index, lanes), dr.gather(mi.UInt32, launch.pixel, lanes)
            dr.eval(some, index, pixel)
            brought = self.replayed(self._follow, some, index, pixel, launch.seed, launch.shared)
            dr.scatter(L, brought, lanes)
        return L * importance, mi.Spectrum(0), mi.Bool(False), place, dr.select(way.alive, FOLLOWED, 1)

    def _begin_paths(
        self, scene: mi.Scene, sensor: mi.Sensor, width: mi.UInt32, extent: mi.Vector2f, launch: Launch
    ) -> tuple[Way, mi.Spectrum, mi.Point2f]:
        *_, sight = self.seen
        points, ray, importance, place = camera_samples(sensor, width, extent, launch)
        way = self._paths.begin(scene, sight, points.index, points.seed, ray, mi.Bool(True))
        return way, importance, place

    def _follow_paths(
        self,
        scene: mi.Scene,
        sensor: mi.Sensor,
        width: mi.UInt32,
        extent: mi.Vector2f,
        way: Way,
        index: mi.UInt32,
        pixel: mi.UInt32,
        seed: mi.UInt32,
        shared: mi.Float | None,
    ) -> mi.Spectrum:
        light, others, sight = self.seen
        seed = mix(pixel ^ mix(seed))
        samples = FreshLight(light, seed) if shared is None else SharedLight(shared)
        arriving = VertexLight(scene, sight.obstacles or scene, others, light, samples, sight.ways)
        return self._paths.follow(scene, arriving, sight, index, seed, way)
