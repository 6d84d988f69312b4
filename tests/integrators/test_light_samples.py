"""Samples of the map from leaves: what a lane draws for itself, and what all share."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy import stats

from stratalux.maps.geometry import map_coordinates
from tests.helpers import ALPHA, scene_dict
from tests.variants import BACKEND, MONO, RGB

LANES = 1 << 14
LOOKUP = 2e-2 if BACKEND == "cuda" else 5e-3
"""Relative error of a lookup in a map: GPUs round the place between two texels to 1/256."""


@pytest.mark.parametrize("variant", [RGB, MONO])
def test_what_is_shared_is_what_one_would_draw(variant: str) -> None:
    mi.set_variant(variant)
    from stratalux.integrators.light_samples import FreshLight, SharedLight  # of the active variant
    from stratalux.sampling.points import mix

    light = mi.load_dict({"type": "direct_stratified"}).prepare(mi.load_dict(scene_dict()))
    count, seed, si = light.tables.count, mi.UInt32(7), dr.zeros(mi.SurfaceInteraction3f)
    records = SharedLight.drawn(light, seed)
    assert 4 * dr.width(records) == SharedLight.BYTES * count
    leaf = mi.UInt32(np.random.default_rng(1).integers(0, count, LANES))
    shared = SharedLight(records).draw(leaf, mi.UInt32(0), si, mi.Bool(True))
    fresh = FreshLight(light, mix(seed)).draw(leaf, leaf, si, mi.Bool(True))
    for a, b in zip(shared, fresh, strict=True):
        np.testing.assert_allclose(a.numpy(), b.numpy(), rtol=1e-5, atol=1e-6)
    other = FreshLight(light, mix(seed)).draw(leaf, leaf + 1, si, mi.Bool(True))[0]
    assert (np.abs(other.numpy() - fresh[0].numpy()).max(axis=0) > 0).mean() > 0.99


def test_samples_are_in_their_leaves_and_bring_light_over_density() -> None:
    from stratalux.integrators.light_samples import FreshLight

    scene = mi.load_dict(scene_dict())
    light = mi.load_dict({"type": "direct_stratified"}).prepare(scene)
    leaf, si = dr.arange(mi.UInt32, light.tables.count), dr.zeros(mi.SurfaceInteraction3f)
    d, luminance, L_p, inverse = FreshLight(light, mi.UInt32(3)).draw(leaf, leaf, si, mi.Bool(True))
    x = light.tables.sample(leaf, mi.Point2f(0.5))
    box = light.tables._leaves.numpy().reshape(-1, 4).T.astype(np.float64)
    u, v = map_coordinates(light.from_world(d).numpy().T.astype(np.float64))
    inside = np.mod(u - box[0] + 0.5 * (1 - box[2]), 1) - 0.5 * (1 - box[2]), v - box[1]
    inside = np.stack(inside) / box[2:]
    assert (np.abs(inside - 0.5) < 0.5 + 1e-2).mean() > 0.999
    for part in np.clip(inside, 0, 1):
        assert stats.kstest(part, "uniform").pvalue > ALPHA
    L = light.radiance_towards(d, si, mi.Bool(True)).numpy()
    np.testing.assert_allclose(luminance.numpy(), mi.luminance(mi.Color3f(L)).numpy(), rtol=LOOKUP, atol=1e-4)
    # The pdf of a leaf changes with sin θ alone.
    sin = [np.hypot(w.numpy()[0], w.numpy()[2]) for w in (light.from_world(d), x.d)]
    pdf = x.pdf.numpy() * sin[1] / sin[0]
    np.testing.assert_allclose(L_p.numpy() * pdf, L, rtol=2e-2, atol=1e-3)
    np.testing.assert_allclose(inverse.numpy() * pdf, 1, rtol=2e-2)


def test_a_launch_has_one_seed_that_follows_the_sampler() -> None:
    from stratalux.integrators.light_samples import launch_seed

    found = set()
    for seed in range(64):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, 5)
        one = launch_seed(sampler)
        assert dr.width(one) == 1
        found.add(int(one[0]))
        found.add(int(launch_seed(sampler)[0]))
    assert len(found) == 128
