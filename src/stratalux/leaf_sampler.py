"""Directions from the density of the whole map by one look-up: a leaf, and a uniform point inside (Dr.Jit)."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from .envmap import EnvironmentMap
from .leaves import equal_energy_leaves
from .sampling import DirectionSample

CELLS_PER_LEAF = 2
MIN_DEPTH, MAX_DEPTH = 16, 20


class LeafSampler:
    """Draws directions with a density that is constant, per du dv, in each of 2^depth leaves of equal energy.

    ``depth``: by default about one leaf for every two cells of the map, within 2^16 to 2^20 leaves of 16 bytes. The
    table is uploaded once, to the variant that is active at construction.
    """

    def __init__(self, environment: EnvironmentMap, depth: int | None = None) -> None:
        cells = (environment.height - 1) * environment.width
        if depth is None:
            depth = min(max((cells // CELLS_PER_LEAF).bit_length() - 1, MIN_DEPTH), MAX_DEPTH)
        self.depth, self.count = depth, 1 << depth
        self.energy = float(environment.cell_energy.sum())
        """∫ luminance dω over the sphere."""
        leaves = equal_energy_leaves(environment, depth)
        leaves[:, 0] += 0.5  # u of texel j is (j + ½) / W
        leaves /= np.array([environment.width, environment.height - 1] * 2)
        self._leaves = mi.Float(leaves.astype(np.float32).ravel())

    def arrays(self) -> tuple[mi.Float, ...]:
        """What kernels read."""
        return (self._leaves,)

    def sample(self, where: mi.UInt32, u: mi.Point2f, active: mi.Bool | bool = True) -> DirectionSample:
        """The direction at ``where``, in units of 2⁻³² along the leaves in the order of the tree.

        ``u`` chooses the point inside the leaf. If ``where`` and ``u`` are uniform, the direction has the stated pdf;
        it is positive everywhere but at the poles themselves.
        """
        x, y, width, height = dr.gather(mi.Vector4f, self._leaves, where >> (32 - self.depth), active)
        uv = mi.Point2f(dr.fma(u.x, width, x), dr.fma(u.y, height, y))
        sin_θ, cos_θ = dr.sincos(dr.pi * uv.y)
        sin_φ, cos_φ = dr.sincos(dr.two_pi * uv.x)
        # Equation (2): dω = 2π² sin θ du dv
        solid_angle = 2 * dr.pi**2 * self.count * width * height * sin_θ
        return DirectionSample(
            uv=uv,
            d=mi.Vector3f(sin_φ * sin_θ, cos_θ, -cos_φ * sin_θ),
            pdf=dr.select(solid_angle > 0, dr.rcp(solid_angle), 0),
        )
