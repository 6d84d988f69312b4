"""Who accounts for which part of a BSDF: samples of the map, or samples of its glossy lobes (Dr.Jit)."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ...sampling.leaf_sampler import LeafSampler
from ..common import LEAST, only, target
from ..environment import MapLight
from .lobes import Allocation


class Balance:
    """The weights of :class:`~.nested_strata.NestedStrata`. The parts of light and lobes add up to f in any direction.

    ``n``: light samples, N M; ``lobes``: samples of the glossy lobes, K M; ``matte``: whether there is something
    besides gloss. Weights have no derivatives.
    """

    def __init__(
        self,
        allocation: Allocation,
        light: MapLight[LeafSampler],
        si: mi.SurfaceInteraction3f,
        bsdf: mi.BSDFPtr,
        shares: tuple[mi.UInt32, mi.UInt32, mi.UInt32, mi.Bool],
        active: mi.Bool,
    ) -> None:
        N, K, M, matte = shares
        self.n, self.lobes, self.matte = mi.Float(N * M), mi.Float(K * M), matte & active
        self._allocation, self._si, self._bsdf = allocation, si, bsdf
        # N M p̃ is this times the luminance, which is 0 where the scale is.
        self._density = self.n / dr.maximum(light.tables.total * light.scale, LEAST)
        self._glossy = active & (K > 0)

    def light_part(self, wo: mi.Vector3f, luminance: mi.Float) -> mi.Spectrum:
        """f − (1 − w) f_g, times the cosine, towards the local direction ``wo``, from where light is so bright."""
        f = mi.Spectrum(0)
        if self._allocation.any_matte:
            f = self._bsdf.eval(only(mi.BSDFFlags.Smooth), self._si, wo, self.matte)
        if self._allocation.any_bsdf_samples:
            f_g, p_g = self._bsdf.eval_pdf(only(mi.BSDFFlags.Glossy), self._si, wo, self._glossy)
            p = self._density * luminance
            w = dr.detach(dr.select(p_g > 0, p / (p + self.lobes * p_g), 1))
            f = dr.select(self.matte, f - (1 - w) * f_g, w * f_g)
        return f

    def lobe_part(self, L: mi.Spectrum, pdf: mi.Float) -> mi.Spectrum:
        """(1 − w) L / (K M p_g): what a sample of the lobes with that ``pdf`` brings, but for f_g and the cosine."""
        return L / dr.detach(self._density * dr.maximum(target(L), 0) + self.lobes * pdf)
