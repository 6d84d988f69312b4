"""For a few samples: the whole light in one, with a few rays to the map and one of the BSDF at every surface."""

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
from .vertex import DETAIL, VertexLight

FEW, FEW_MATTE, FEW_DETAILED, FEW_IN_THE_SUN = 16, 4, 4, 128
"""Samples per pixel, at most, that are better spent so: usually, where all that is there is matte, where the map has so
much detail inside of lobes that direct light takes :data:`~.vertex.DETAIL` proposals for each ray, and where nearly all
light beyond the mean comes from one direction, as more rays bring nothing there."""
USUAL, FEW_IN_MANY = 10_000, 4
"""Pixels up to which that is so. In more, plans pay that are made of the pixels around: with four times as many, half
as many samples are, and so many at least."""
EACH = 4
"""Camera samples in the place of each of those asked for: they cost so much less."""
LARGEST_MAP = 1 << 25
"""Texels of a map, at most, of which a second table is made."""
_LESS, _PROPOSALS = 4, 4
"""Rays to the map at the first surface are so many times fewer than those of direct light alone; and samples of the map
for each ray."""
_RAYS_IN_THE_SUN, _PROPOSALS_IN_THE_SUN = 3, 1
"""The same under one sun: as many rays at most."""
_LEVEL = 0.35
"""Of the map's mean: what other surfaces send, about."""
PLANNED, PLANNED_ON_GPU = 1 << 18, 1 << 24
"""Camera samples of a picture from which on a pilot, of a quarter of them, tells where the others go: a plan takes as
long as so many do."""
_PLANNED_IN_THE_SUN = 32
"""Samples per pixel from which on that is so under one sun, too."""
_LEAST = 4
"""Camera samples of a pixel's pilot, at least."""


class Whole:
    """Estimates it for camera rays, in place of an integrator of direct light.

    The map is sampled by what is brighter than a share of its mean, with a few rays at the first surface and one at
    later ones, and the sample of the BSDF that leads on finds the rest. At the first surface, what is alike from
    everywhere is left to that sample alone: then it matters little whether it meets a thing or the sky. Not where light
    goes straight through anything, or where something else than the map is behind.
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
        light = FewRays(scene, scene, others, prepared, samples, sight.ways)
        return self._paths.whole(scene, light, sampler.index, sampler.seed, ray, mi.Bool(active))


def few(light: AllocatedLight[BrightLeafSampler], pixels: int) -> int:
    """Samples per pixel, at most, that are better spent so under this map, on what there is, in so many pixels."""
    if light.tables.sunny:
        return FEW_IN_THE_SUN
    if not light.allocation.any_bsdf_samples:
        return FEW_MATTE
    if light.allocation.most_proposals >= DETAIL:
        return FEW_DETAILED
    return max(FEW_IN_MANY, round(FEW * min(1.0, USUAL / pixels) ** 0.5))


def pilot_whole(light: AllocatedLight[BrightLeafSampler], spp: int, pixels: int, shared: bool) -> int:
    """Camera samples of a pilot for ``spp`` of those asked for, a power of two; all, where nothing is planned: under a
    sun, among others, whose glints no pilot finds, but where these are ``shared`` with light paths."""
    many = spp * EACH
    if light.tables.sunny and not (shared and spp >= _PLANNED_IN_THE_SUN):
        return many
    enough = PLANNED_ON_GPU if dr.backend_v(mi.Float) == dr.JitBackend.CUDA else PLANNED
    return 1 << spp.bit_length() - 1 if spp >= _LEAST and pixels * many >= enough else many


def too_large(scene: mi.Scene) -> bool:
    """Whether its map is, for a second table."""
    height, width, *_ = mi.traverse(image_emitter(scene))["data"].shape
    return bool(height * width > LARGEST_MAP)


class FewRays(VertexLight):
    """The light of :class:`Whole` at a vertex."""

    def proposals(self, shape: mi.ShapePtr, bsdf: mi.BSDFPtr, active: mi.Bool) -> mi.UInt32:
        return dr.opaque(mi.UInt32, _PROPOSALS_IN_THE_SUN if self._bright.tables.sunny else _PROPOSALS)

    def rays(self, shape: mi.ShapePtr, bsdf: mi.BSDFPtr, first: mi.Bool, active: mi.Bool) -> mi.UInt32:
        N, *_ = self._bright.allocation.of(shape, bsdf, mi.UInt32(0), active)
        N = dr.maximum(N // _LESS, 1)
        if self._bright.tables.sunny:
            N = dr.minimum(N, _RAYS_IN_THE_SUN)
        return mi.UInt32(dr.select(first, N, 1))

    @property
    def level(self) -> mi.Float:
        return _LEVEL * self._bright.tables.mean * self._bright.scale

    @property
    def _bright(self) -> AllocatedLight[BrightLeafSampler]:
        assert self._light is not None
        return self._light
