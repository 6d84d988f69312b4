"""Light samples and samples of the glossy lobes account for the whole BSDF together, in all directions drawn."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import MATERIALS, scene_dict

LANES = 4096
BSDFS: dict[str, dict[str, Any]] = {
    "diffuse": MATERIALS["diffuse"],
    "roughplastic": MATERIALS["roughplastic"],
    "roughconductor": MATERIALS["roughconductor"],
    "polished": {"type": "roughconductor", "alpha": 0.03},
    "principled": {"type": "principled", "roughness": 0.3, "metallic": 0.3, "clearcoat": 0.5},
}


@pytest.mark.parametrize("rays", [None, (3, 1, 2)], ids=["its own", "a single one for lobes"])
@pytest.mark.parametrize("name", BSDFS)
def test_parts_add_up(name: str, rays: tuple[int, int, int] | None) -> None:
    from stratalux.integrators.automatic.balance import Balance  # of the active variant
    from stratalux.integrators.automatic.lobes import _surface
    from stratalux.integrators.common import draw, only, target
    from stratalux.integrators.light_samples import FreshLight

    description = scene_dict("diffuse")
    description["ball"]["bsdf"] = BSDFS[name]
    scene = mi.load_dict(description)
    light = mi.load_dict({"type": "direct_stratified"}).prepare(scene)
    assert float(light.scale[0]) == 0.5  # has to count in both parts
    ball = next(shape for shape in scene.shapes() if shape.class_name() == "Sphere")
    bsdf = dr.gather(mi.BSDFPtr, mi.BSDFPtr(ball.bsdf()), dr.zeros(mi.UInt32, LANES))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, LANES)
    si = _surface(sampler)
    shares = light.allocation.of(mi.ShapePtr(ball), bsdf, mi.UInt32(0), mi.Bool(True))
    if rays is not None and name != "diffuse":
        shares = *map(mi.UInt32, rays), shares[3]
    balance = Balance(light.allocation, light, si, bsdf, shares, mi.Bool(True))

    smooth, glossy = only(mi.BSDFFlags.Smooth), only(mi.BSDFFlags.Glossy)
    leaf = mi.UInt32(sampler.next_1d() * light.tables.count)
    of_light, *_ = FreshLight(light, mi.UInt32(1)).draw(leaf, leaf, si, mi.Bool(True))
    bs, _, found = draw(bsdf, glossy, si, sampler.next_1d(), sampler.next_2d())
    assert found.numpy().any() == (name != "diffuse")
    for d in (of_light, dr.select(found, si.to_world(bs.wo), of_light)):
        wo = si.to_local(d)
        L = light.radiance_towards(d, si, mi.Bool(True))
        f = bsdf.eval(smooth, si, wo)
        f_g, p_g = bsdf.eval_pdf(glossy, si, wo, balance.lobes > 0)
        by_light = balance.light_part(wo, target(L)) * L
        by_lobes = dr.select(p_g > 0, balance.lobe_part(L, p_g) * balance.lobes * p_g * f_g, 0)
        total, whole = (value.numpy() for value in (by_light + by_lobes, f * L))
        np.testing.assert_allclose(total, whole, rtol=1e-4, atol=1e-5 * whole.max())
        share = by_lobes.numpy().sum() / whole.sum()
        assert share == 0 if name == "diffuse" else 0.05 < share < 0.99  # both have a part in it
