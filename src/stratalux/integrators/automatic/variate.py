"""A control variate: the unshadowed light of the map on a matte surface, whose integral is known (Dr.Jit)."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ...maps.irradiance import DEGREES, clamped_cosine, irradiance_coefficients

_POWERS = [float(power) for power in clamped_cosine()]


class MatteVariate:
    """h(ω) = L(ω) P(n·ω), with the polynomial P that spherical harmonics make of the clamped cosine.

    See :mod:`.maps.irradiance`. Its integral less any unbiased estimate of it is 0 on average, so a multiple of
    that can be added to a pixel, if the factor does not depend on the pixel's own samples.
    """

    def __init__(self, texels: NDArray[np.float32]) -> None:
        channels = dr.size_v(mi.Spectrum)
        coefficients = irradiance_coefficients(texels)
        self._coefficients = {k: mi.Spectrum(value[:channels].tolist()) for k, value in coefficients.items()}
        dr.make_opaque(self._coefficients)

    def arrays(self) -> tuple[mi.Spectrum, ...]:
        """What kernels read."""
        return tuple(self._coefficients.values())

    @staticmethod
    def cosine(t: mi.Float) -> mi.Float:
        """P(t): about max(0, t)."""
        even = mi.Float(0)
        for power in _POWERS[::-2]:
            even = dr.fma(even, t * t, power)
        return dr.fma(_POWERS[1], t, even)

    def integral(self, n: mi.Vector3f) -> mi.Spectrum:
        """∫ h dω with the unscaled map, in whose frame ``n`` is."""
        harmonics = dr.sh_eval(mi.Vector3f(-n.z, n.x, n.y), max(DEGREES))
        H = mi.Spectrum(0)
        for k, value in self._coefficients.items():
            H += value * harmonics[k]
        return H
