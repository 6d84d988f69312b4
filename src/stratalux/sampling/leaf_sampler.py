"""Directions from the density of the map by one look-up: a leaf, and a uniform point inside (Dr.Jit)."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..images.colour import LUMINANCE
from ..images.half import single
from ..maps.energy_table import EnergyTable
from ..maps.envmap import EnvironmentMap
from ..maps.regions import Regions
from .leaves import added_luminance, cut_regions
from .region_sampler import DirectionSample, lattice_position

DEPTH = 16
"""Of all leaves: twice as many have 0.9 to 1 times the error and take twice as long to make."""
_MANY_REGIONS = 256
"""More regions than that share half as many leaves: 1,024 of them have 1.00 to 1.01 times the error (64: 1.01 to 1.06).
"""

_SPARED, _SPARED_IN_THE_SUN, _SPARED_BY_GLOSS = 0.25, 0.5, 1.0
"""Share of the mean of a map that is left to samples of the BSDF: usually, and under one sun, where a ray that goes to
the sky is missing in the sun, and gloss alone has no use for it."""
_EVEN = 1e-5
"""A map that is this close to its mean has nothing that is brighter."""
_SUN = 0.95
"""Length of the mean direction of what is brighter than the mean, from which on that is one sun."""


class LeafSampler:
    """Draws directions with a density that is constant, per du dv, in each of 2^depth leaves of equal energy.

    A leaf takes 16 bytes. The table is made once, for the variant that is active at construction. ``table``: energies
    to be followed in place of the map's own.
    """

    def __init__(
        self,
        environment: EnvironmentMap,
        depth: int | None = None,
        regions: Regions | None = None,
        table: EnergyTable | None = None,
    ) -> None:
        table = environment.energy_table if table is None else table
        trees = 1 if regions is None else len(regions)
        if depth is None:
            depth = max(DEPTH - (trees > _MANY_REGIONS) - (trees - 1).bit_length(), 0)
        self.depth, self.count = depth, trees << depth
        self.energy = table.total
        """∫ luminance dω over the sphere."""
        self.total = dr.opaque(mi.Float, self.energy)
        """The same for kernels, which are none of their own for each map."""
        self.spared = dr.opaque(mi.Float, 0.0)
        """Luminance that it leaves to samples of the BSDF, of the map as it is."""
        bounds = cut_regions(table, None if regions is None else regions.bounds, depth)
        x0, y0, x1, y1 = dr.gather(mi.Vector4d, bounds, dr.arange(mi.UInt32, self.count))
        across, down = dr.opaque(mi.Float64, environment.width), dr.opaque(mi.Float64, environment.height - 1)
        # u of texel j is (j + ½) / W.
        self._leaves = dr.ravel(mi.Vector4f((x0 + 0.5) / across, y0 / down, (x1 - x0) / across, (y1 - y0) / down))
        dr.eval(self._leaves)

    def arrays(self) -> tuple[mi.Float, ...]:
        """What kernels read."""
        return self._leaves, self.total, self.spared

    @property
    def bytes(self) -> int:
        """What the table takes."""
        return 4 * dr.width(self._leaves)

    @cached_property
    def concentration(self) -> float:
        """Mean square of the luminance over the square of its mean: light comes from so small a part of the sphere."""
        leaf = dr.arange(mi.UInt32, self.count)
        pdf = self.sample(leaf, mi.Point2f(0.5)).pdf
        return float(4 * np.pi * dr.mean(mi.Float64(pdf))[0])

    def sample(self, leaf: mi.UInt32, u: mi.Point2f, active: mi.Bool | bool = True) -> DirectionSample:
        """A direction inside ``leaf``, number of one of ``count``; ``u`` chooses the point.

        If both are uniform, the direction has the stated pdf; it is positive everywhere but at the poles themselves.
        """
        x, y, width, height = dr.gather(mi.Vector4f, self._leaves, leaf, active)
        uv = mi.Point2f(dr.fma(u.x, width, x), dr.fma(u.y, height, y))
        sin_θ, cos_θ = dr.sincos(dr.pi * uv.y)
        sin_φ, cos_φ = dr.sincos(dr.two_pi * uv.x)
        # Equation (2): dω = 2π² sin θ du dv
        solid_angle = 2 * np.pi**2 * (1 << self.depth) * width * height * sin_θ
        return DirectionSample(
            uv=uv,
            d=mi.Vector3f(sin_φ * sin_θ, cos_θ, -cos_φ * sin_θ),
            pdf=dr.select(solid_angle > 0, dr.rcp(solid_angle), 0),
        )


class BrightLeafSampler(LeafSampler):
    """The same with the density of what is brighter than a share of the mean of the map, for who takes as many samples
    of the BSDF: these find what is dim and large.

    Source: Karlík, Šik, Vévoda, Skřivan and Křivánek 2019, "MIS Compensation: Optimizing Sampling Techniques in
    Multiple Importance Sampling", where it is the mean itself. As everywhere, a hundredth of the mean of what is left
    is added.

    ``glossy``: for surfaces some of which have gloss alone.
    """

    def __init__(self, environment: EnvironmentMap, glossy: bool = False) -> None:
        mean = environment.energy_table.total / (4 * np.pi)
        gathered, brightest = _seen(environment.texels, mean)
        self.sunny = gathered > _SUN
        """Whether nearly all light beyond the mean comes from one direction."""
        share = (_SPARED_BY_GLOSS if glossy else _SPARED_IN_THE_SUN) if self.sunny else _SPARED
        # One that is nowhere brighter than its mean is left to them altogether: they find it without noise.
        spared = mean * (share if brightest > mean * (1 + _EVEN) else 1 + _EVEN)
        super().__init__(environment, table=EnergyTable.build(environment.texels, spared))
        self.spared = dr.opaque(mi.Float, spared)
        self.mean = dr.opaque(mi.Float, mean)
        """Luminance of the map as it is, over all directions."""

    def arrays(self) -> tuple[mi.Float, ...]:
        return *super().arrays(), self.mean


def _seen(texels: NDArray[Any], mean: float) -> tuple[float, float]:
    """Of what is brighter than the ``mean`` in a map (H, W, 3), the length of its mean direction: 1 if all of it comes
    from one, 0 if from everywhere; and the luminance of the brightest texel."""
    height, width = texels.shape[:2]
    φ, θ = 2 * np.pi * (np.arange(width) + 0.5) / width, np.pi * np.arange(height) / (height - 1)
    around = np.stack([np.ones(width), np.sin(φ), np.cos(φ)], axis=1).astype(np.float32)
    sums, brightest = np.zeros(4), 0.0
    for row, angle in zip(texels, θ, strict=True):
        luminance = single(row) @ LUMINANCE
        brightest = max(brightest, float(luminance.max()))
        light, x, z = np.sin(angle) * (np.maximum(luminance - np.float32(mean), 0) @ around)
        sums += light, x * np.sin(angle), light * np.cos(angle), z * np.sin(angle)
    return (float(np.linalg.norm(sums[1:]) / sums[0]) if sums[0] > 0 else 0.0), brightest


class RegionLeafSampler(LeafSampler):
    """The same for each of N regions by itself: region i has 2^depth leaves, from number i 2^depth on.

    ``depth``: by default so that there are 2^16 leaves in all (2^15 for many regions) or a few less, or one in each
    region. The pdf is that of the region: with a uniform leaf of it.
    """

    def __init__(self, environment: EnvironmentMap, regions: Regions, depth: int | None = None) -> None:
        super().__init__(environment, depth, regions)
        self.regions = regions
        energy = regions.energy + added_luminance(environment.energy_table) * regions.solid_angle
        self.region_energy = mi.Float(energy.astype(np.float32))
        """∫ luminance dω over each region, with the floor of :mod:`stratalux.sampling.leaves`, hence positive."""

    def region(self, d: mi.Vector3f, active: mi.Bool | bool = True) -> mi.UInt32:
        """Index of the region that contains the unit direction ``d`` (map's frame)."""
        height, width = self.regions.shape
        _, x, y = lattice_position(d, height, width)
        return dr.gather(mi.UInt32, self._index_map, y * width + x, active)

    @cached_property
    def _index_map(self) -> mi.UInt32:
        return mi.UInt32(self.regions.index_map().astype(np.uint32).ravel())
