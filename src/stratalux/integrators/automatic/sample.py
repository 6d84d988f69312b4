"""What ``direct_stratified`` estimates by itself for one camera sample."""

from __future__ import annotations

import math
from typing import Any, TypeVar

import drjit as dr
import mitsuba as mi

from ...maps.envmap import EnvironmentMap
from ...sampling.leaf_sampler import LeafSampler
from ...sampling.recording import one_at_a_time
from ..common import DirectIntegrator
from ..environment import MapCache, MapLight
from ..light_samples import FreshLight
from ..straight import Arrival, Scene
from .lobes import Allocation
from .nested_strata import NestedStrata, PixelPoints
from .variate import MatteVariate


class NestedTables(LeafSampler):
    """The leaves of the whole map, and the variate for what is matte; spectral variants have none."""

    def __init__(self, environment: EnvironmentMap) -> None:
        super().__init__(environment)
        self.variate = None if mi.is_spectral else MatteVariate(environment.texels)

    def arrays(self) -> tuple[Any, ...]:
        return *super().arrays(), *(self.variate.arrays() if self.variate else ())


Tables = TypeVar("Tables", bound=LeafSampler, covariant=True)


class AllocatedLight(MapLight[Tables]):
    """The map, and what surfaces get of samples of it in one scene."""

    def __init__(self, light: MapLight[Tables], allocation: Allocation) -> None:
        super().__init__(light.emitter, light.tables, light.to_world, light.scale, light.differentiated)
        self.allocation = allocation

    @property
    def mean(self) -> float:
        """Luminance of the map, averaged over all directions, as it shines in the scene."""
        return float(self.tables.energy / (4 * math.pi) * float(self.scale[0]))

    def arrays(self) -> tuple[Any, ...]:
        return *super().arrays(), *self.allocation.arrays()


class AutomaticSample(DirectIntegrator):
    """The estimate for a camera sample, in whatever order Mitsuba or another integrator asks for them."""

    automatic = True
    strata, proposals, bsdf_samples = 0, 0, -1

    def __init__(self, props: mi.Properties) -> None:
        super().__init__(props)
        self._cache: MapCache[NestedTables] = MapCache(NestedTables)
        self._scene: mi.Scene | None = None
        self._tables: NestedTables | None = None

    @one_at_a_time
    def prepare(self, scene: mi.Scene) -> AllocatedLight | None:
        """Build (or fetch) the tables for ``scene``; rendering calls this by itself."""
        light = self._cache.get(scene)
        if light is None:
            return None
        if self._scene is not scene or self._tables is not light.tables:
            with dr.suspend_grad():
                self._allocation = Allocation(scene, light, self._catchers.white if self._catchers else None)
            self._scene, self._tables = scene, light.tables
        return AllocatedLight(light, self._allocation)

    def environment_light(
        self,
        scene: Scene,
        light: AllocatedLight,
        sampler: mi.Sampler | PixelPoints,
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        active: mi.Bool,
    ) -> mi.Spectrum:
        points = sampler if isinstance(sampler, PixelPoints) else PixelPoints.of(sampler)
        samples = points.samples or FreshLight(light, points.seed)
        variate = light.tables.variate if points is sampler and light.allocation.any_matte else None
        strata = NestedStrata(light.allocation, points, samples, variate)
        estimate = strata.differentiable if light.differentiated else strata.estimate
        return estimate(scene, light, si, bsdf, active)

    def weigh(self, sampler: mi.Sampler | PixelPoints, seen: Arrival) -> None:
        # A product with a constant 0 would be one as well, but of the number of lanes of the first launch recorded.
        if isinstance(sampler, PixelPoints) and sampler.varied:
            sampler.difference = seen.reflected(sampler.difference)

    def to_string(self) -> str:
        return "DirectStratified[automatic]"
