"""How a camera sample's rays are shared between the map and the BSDF, by how concentrated the BSDF's lobes are."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

_DIRECTIONS = 256
"""Test directions for each surface."""

_SHARES = ((0.22, 16, 0, True), (0.32, 4, 2, True), (3.0, 4, 4, False), (float("inf"), 2, 3, False))
"""Concentration in sr⁻¹ up to which a row holds, light samples, BSDF samples, and whether it has a matte part that is
worth a control variate. A diffuse surface has 0.2 sr⁻¹, a plastic with a gloss of 0.14 has 0.26, a GGX conductor of
roughness 0.14 has 1.3 and of roughness 0.05 has 9."""
MOST_RAYS = max(N + K for _, N, K, _ in _SHARES)
_UNKNOWN = 2
"""The row of BSDFs that are not seen in the list of shapes, as those of instances."""


class Allocation:
    """The numbers of light samples N and BSDF samples K of every BSDF of a scene.

    The concentration of a BSDF is the geometric mean of its pdf over directions drawn from it, for light from all
    sides: the reciprocal of about the solid angle that its lobes fill. It is measured, so any BSDF has one.
    """

    def __init__(self, scene: mi.Scene) -> None:
        self._rows, used = _rows(scene)
        self._table = mi.UInt32([N | K << 16 | matte << 31 for _, N, K, matte in _SHARES])
        used |= {_UNKNOWN} if _has_instances(scene) else set()
        self.any_bsdf_samples = any(_SHARES[row][2] for row in used)
        self.any_matte = any(_SHARES[row][3] for row in used)

    def arrays(self) -> tuple[mi.UInt32, ...]:
        """What kernels read."""
        return self._rows, self._table

    def of(self, bsdf: mi.BSDFPtr, active: mi.Bool) -> tuple[mi.UInt32, mi.UInt32, mi.Bool]:
        """N, K, and whether to use the variate, at each lane."""
        identity = dr.reinterpret_array(mi.UInt32, bsdf)
        known = active & (identity < dr.width(self._rows))
        row = dr.select(known, dr.gather(mi.UInt32, self._rows, identity, known), _UNKNOWN)
        shares = dr.gather(mi.UInt32, self._table, row, active)
        return shares & 0xFFFF, shares >> 16 & 0x7FFF, shares >> 31 != 0


def concentration(bsdf: mi.BSDFPtr, sampler: mi.Sampler) -> mi.Float:
    """Logarithm of the pdf of one direction drawn from the smooth lobes; NaN where none could be drawn."""
    ctx = mi.BSDFContext()
    ctx.type_mask = int(mi.BSDFFlags.Smooth)
    si = dr.zeros(mi.SurfaceInteraction3f, sampler.wavefront_size())
    si.t = 1
    si.sh_frame = mi.Frame3f(mi.Normal3f(0, 0, 1))
    si.n = mi.Normal3f(0, 0, 1)
    si.wi = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
    si.uv = sampler.next_2d()
    if mi.is_spectral:
        si.wavelengths = mi.Spectrum(550)
    bs, weight = bsdf.sample(ctx, si, sampler.next_1d(), sampler.next_2d())
    drawn = (bs.pdf > 0) & dr.isfinite(bs.pdf) & dr.any(weight > 0)
    return dr.select(drawn, dr.log(bs.pdf), dr.nan)


def _rows(scene: mi.Scene) -> tuple[mi.UInt32, set[int]]:
    """Row of :data:`_SHARES` for each BSDF, by the identity that Dr.Jit gives it, and the rows that shapes use."""
    count = len(scene.shapes())
    if count == 0:
        return mi.UInt32(_UNKNOWN), set()
    lane = dr.arange(mi.UInt32, count * _DIRECTIONS)
    shape = lane // _DIRECTIONS
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, count * _DIRECTIONS)
    bsdf = dr.gather(mi.ShapePtr, scene.shapes_dr(), shape).bsdf()
    log_pdf = concentration(bsdf, sampler)
    drawn = ~dr.isnan(log_pdf)
    total, weight = dr.zeros(mi.Float, count), dr.zeros(mi.Float, count)
    dr.scatter_add(total, dr.select(drawn, log_pdf, 0), shape)
    dr.scatter_add(weight, mi.Float(drawn), shape)
    value = dr.select(weight > 0, dr.exp(total / weight), 0)
    row = mi.UInt32(0)
    for limit, *_ in _SHARES[:-1]:
        row += mi.UInt32(dr.select(value > limit, 1, 0))
    identity = dr.reinterpret_array(
        mi.UInt32, dr.gather(mi.ShapePtr, scene.shapes_dr(), dr.arange(mi.UInt32, count)).bsdf()
    )
    rows = dr.full(mi.UInt32, _UNKNOWN, int(dr.max(identity)[0]) + 1)
    dr.scatter(rows, row, identity)
    dr.eval(rows)
    return rows, set(row.numpy().tolist())


def _has_instances(scene: mi.Scene) -> bool:
    return any(shape.class_name() == "Instance" for shape in scene.shapes())
