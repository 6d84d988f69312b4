"""The weights of map and BSDF samples add up to 1 in every direction that is drawn."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import MATERIALS, scene_dict

LANES, K = 4096, 2


@pytest.mark.parametrize("material", ["roughplastic", "roughconductor"])
def test_weights_add_up(material: str) -> None:
    """That of a proposal is what combining makes of it; that of a BSDF sample follows from the density towards it."""
    from stratalux.integrators.common import MisWithBsdf, only  # of the active variant
    from stratalux.integrators.direct_stratified import Proposals

    scene = mi.load_dict(scene_dict(material))
    light = mi.load_dict({"type": "direct_stratified", "strata": 16}).prepare(scene)
    assert float(light.scale[0]) == 0.5  # has to count in both weights
    bsdf = mi.load_dict(MATERIALS[material])
    bsdfs = dr.gather(mi.BSDFPtr, mi.BSDFPtr(bsdf), dr.zeros(mi.UInt32, LANES))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, LANES)
    si = dr.zeros(mi.SurfaceInteraction3f, LANES)
    si.sh_frame = mi.Frame3f(mi.warp.square_to_uniform_sphere(sampler.next_2d()))
    si.wi = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
    region, u = mi.UInt32(sampler.next_1d() * 16), sampler.next_1d()

    drawn = []
    for count in (0, K):
        sampler.seed(1, LANES)  # the same points inside of leaves
        mis = MisWithBsdf(count)
        proposals = Proposals(light, mis, sampler, si, bsdfs)
        drawn.append(proposals.draw(region, u, mi.Bool(True)))
    (d, plain), (again, weighted) = drawn
    np.testing.assert_array_equal(d.numpy(), again.numpy())
    L = light.radiance_towards(d, si, mi.Bool(True))
    pdf = bsdfs.pdf(only(mi.BSDFFlags.Smooth), si, si.to_local(d))
    of_bsdf = K * pdf / mis.total(proposals.density_towards(light.from_world(d), L, mi.Bool(True)), pdf)
    lit = (plain.numpy() > 0).all(axis=0)
    of_map = (weighted.numpy() / np.where(lit, plain.numpy(), 1))[:, lit]
    np.testing.assert_allclose(of_map + of_bsdf.numpy()[lit], 1, atol=2e-3)
    assert 0.05 < of_map.mean() < 0.95
