"""Samples of the environment map from leaves: drawn where they are needed, or once for all pixels."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..sampling.leaf_sampler import LeafSampler
from ..sampling.points import mix
from .common import target
from .environment import MapLight


def launch_seed(sampler: mi.Sampler) -> mi.UInt32:
    """One seed for all lanes, from the sampler's points: it does not tell its own."""
    u = sampler.next_2d() * 65536
    return mix(dr.gather(mi.UInt32, mi.UInt32(u.x) << 16 | mi.UInt32(u.y), 0))


class FreshLight:
    """Samples of the map, each drawn inside its leaf anew."""

    def __init__(self, light: MapLight[LeafSampler], seed: mi.UInt32) -> None:
        self._light, self._seed = light, seed

    def draw(
        self, leaf: mi.UInt32, random: mi.UInt32, si: mi.SurfaceInteraction3f, active: mi.Bool
    ) -> tuple[mi.Vector3f, mi.Float, mi.Spectrum, mi.Float]:
        """A direction of the world, luminance(L), L / p, 1 / p; the point inside the leaf is a hash of ``random``."""
        inside = mix(self._seed + random)
        u = mi.Point2f(mi.Float(inside & 0xFFFF) * 2.0**-16, mi.Float(inside >> 16) * 2.0**-16)
        x = self._light.tables.sample(leaf, u, active)
        d = self._light.to_world @ x.d
        L = self._light.radiance(si, x.uv, d, active)
        inverse = dr.select(x.pdf > 0, dr.rcp(x.pdf), 0)
        return d, target(L), L * inverse, inverse


class SharedLight:
    """One sample in every leaf, drawn once for all pixels that are rendered together: a look-up instead of arithmetic.

    A pixel uses few of them, so it hardly matters that others use the same. For RGB and mono variants. ``records``: of
    the samples, as :meth:`drawn` makes them.
    """

    BYTES = 32
    """Of each sample."""

    def __init__(self, records: mi.Float) -> None:
        self._records = records

    @staticmethod
    def drawn(light: MapLight[LeafSampler], seed: mi.UInt32) -> mi.Float:
        """The records of a sample in each leaf."""
        leaf = dr.arange(mi.UInt32, light.tables.count)
        si = dr.zeros(mi.SurfaceInteraction3f)
        d, luminance, L_p, inverse = FreshLight(light, mix(seed)).draw(leaf, leaf, si, mi.Bool(True))
        channels = [*L_p, *[0] * (3 - dr.size_v(mi.Spectrum))]
        records = dr.ravel(mi.ArrayXf([*d, luminance, *channels, inverse]))
        dr.eval(records)
        return records

    def draw(
        self, leaf: mi.UInt32, random: mi.UInt32, si: mi.SurfaceInteraction3f, active: mi.Bool
    ) -> tuple[mi.Vector3f, mi.Float, mi.Spectrum, mi.Float]:
        """As :meth:`FreshLight.draw`; there is no need for a ``random`` number."""
        first = dr.gather(mi.Vector4f, self._records, 2 * leaf, active)
        second = dr.gather(mi.Vector4f, self._records, 2 * leaf + 1, active)
        channels = [second[k] for k in range(dr.size_v(mi.Spectrum))]
        return mi.Vector3f(first.x, first.y, first.z), first.w, mi.Spectrum(*channels), second.w
