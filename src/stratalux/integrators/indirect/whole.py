"""For a few samples: the whole light in one, with one ray to the map and one of the BSDF at every surface."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from ...sampling.leaf_sampler import BrightLeafSampler
from ..automatic.nested_strata import PixelPoints
from ..automatic.sample import AllocatedLight
from ..environment import image_emitter
from ..light_samples import FreshLight
from ..other_emitters import OtherEmitters
from ..sight import Sight
from .paths import Paths
from .vertex import VertexLight

FEW, FEW_MATTE = 8, 2
"""Samples per pixel, at most, that are better spent so, and where all that is there is matte: camera samples are what
counts then, and a pilot and a plan take as long as what they save."""
FEW_IN_THE_SUN = 32
"""The same where nearly all light beyond the mean comes from one direction: there, more rays to it bring nothing."""
_SUN = 0.95
EACH = 4
"""Camera samples in the place of each of those asked for: they cost so much less."""
LARGEST_MAP = 1 << 25
"""Texels of a map, at most, of which a second table is made."""
_LESS, _PROPOSALS = 4, 4
"""Rays to the map at the first surface are so many times fewer than those of direct light alone; and samples of the map
for each ray. In the sun, both are one."""


class Whole:
    """Estimates it for camera rays, in place of an integrator of direct light.

    The map is sampled by what is brighter than its mean, with a few rays at the first surface and one at later ones,
    and the sample of the BSDF that leads on finds the rest. Not where light goes straight through anything, or where
    something else than the map is behind.
    """

    def __init__(self, paths: Paths, hide_emitters: bool) -> None:
        self._paths, self.hide_emitters = paths, hide_emitters

    def sight(self, scene: mi.Scene, prepared: Any, sensor: mi.Sensor | None) -> Sight:
        """What rays see of ``scene``."""
        return Sight(scene, "map", self.hide_emitters, sensor)

    def radiance(
        self,
        scene: mi.Scene,
        prepared: AllocatedLight[BrightLeafSampler],
        others: OtherEmitters,
        sight: Sight,
        sampler: PixelPoints,
        ray: mi.Ray3f,
        active: mi.Bool | bool,
    ) -> tuple[mi.Spectrum, mi.Bool]:
        """Radiance along ``ray``, and its alpha."""
        samples = sampler.samples or FreshLight(prepared, sampler.seed)
        light = _FewRays(scene, scene, others, prepared, samples)
        return self._paths.whole(scene, light, sampler.index, sampler.seed, ray, mi.Bool(active))


def few(light: AllocatedLight[BrightLeafSampler]) -> int:
    """Samples per pixel, at most, that are better spent so under this map, on what there is."""
    if sunny(light):
        return FEW_IN_THE_SUN
    return FEW if light.allocation.any_bsdf_samples else FEW_MATTE


def too_large(scene: mi.Scene) -> bool:
    """Whether its map is, for a second table."""
    height, width, *_ = mi.traverse(image_emitter(scene))["data"].shape
    return bool(height * width > LARGEST_MAP)


def sunny(light: AllocatedLight[BrightLeafSampler]) -> bool:
    """Whether nearly all light beyond the mean of the map comes from one direction."""
    return light.tables.gathered > _SUN


class _FewRays(VertexLight):
    def proposals(self, shape: mi.ShapePtr, bsdf: mi.BSDFPtr, active: mi.Bool) -> mi.UInt32:
        assert self._light is not None
        return dr.opaque(mi.UInt32, 1 if sunny(self._light) else _PROPOSALS)

    def rays(self, shape: mi.ShapePtr, bsdf: mi.BSDFPtr, first: mi.Bool, active: mi.Bool) -> mi.UInt32:
        assert self._light is not None
        if sunny(self._light):
            return mi.UInt32(1)
        N, *_ = self._light.allocation.of(shape, bsdf, mi.UInt32(0), active)
        return mi.UInt32(dr.select(first, dr.maximum(N // _LESS, 1), 1))
