"""An image of all light beyond the direct one: a pilot of every pixel, then samples where the error is."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from ..automatic.nested_strata import PixelPoints
from ..automatic.sample import AllocatedLight, AutomaticSample
from ..automatic.view import KNOWN
from ..light_samples import FreshLight
from ..other_emitters import OtherEmitters
from ..sight import Sight
from ..sums import UNLIMITED, Pixels
from .paths import Paths
from .vertex import VertexLight


def pilot_paths(spp: int, box: bool) -> int:
    """Paths of a pilot for ``spp`` in all, a power of two: half of them, as rare events show in no smaller one.

    With another filter than a ``box``, a quarter: every pixel gets as many again, see :meth:`.Pilot.plan`.
    """
    if spp >= UNLIMITED:
        spp = KNOWN
    return max(1, (1 << (spp * 4 // 3).bit_length()) >> (2 if box else 3))


class Indirect:
    """Estimates it for camera rays, in place of an integrator of direct light: of the one whose light it goes with."""

    def __init__(self, direct: AutomaticSample, paths: Paths) -> None:
        self._direct, self.paths = direct, paths
        self.hide_emitters = direct.hide_emitters

    def sight(self, scene: mi.Scene, prepared: Any, sensor: mi.Sensor | None) -> Sight:
        """As that of direct light."""
        return self._direct.sight(scene, prepared, sensor)

    def radiance(
        self,
        scene: mi.Scene,
        prepared: AllocatedLight | None,
        others: OtherEmitters,
        sight: Sight,
        sampler: PixelPoints,
        ray: mi.Ray3f,
        active: mi.Bool | bool,
    ) -> tuple[mi.Spectrum, mi.Bool]:
        """Radiance along ``ray`` after two scatterings or more; of alpha it knows nothing."""
        samples = None
        if prepared is not None:
            samples = sampler.samples or FreshLight(prepared, sampler.seed)
        arriving = VertexLight(scene, sight.obstacles or scene, others, prepared, samples, sight.ways)
        way = self.paths.begin(scene, sight, sampler.index, sampler.seed, ray, mi.Bool(active))
        return self.paths.follow(scene, arriving, sight, sampler.index, sampler.seed, way), mi.Bool(False)


def added(direct: Pixels, rest: Pixels) -> Pixels:
    """Both together; ``rest`` has an alpha of 0."""
    total = direct.copy()
    total[..., :-1] += np.where(direct[..., -1:] != 0, rest[..., :-1], 0)
    return total
