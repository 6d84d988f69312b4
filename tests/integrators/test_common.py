"""What all integrators of ours share."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import MATERIALS, PATIENCE, lamp, scene_dict
from tests.variants import RGB, SPECTRAL

LANES = 1 << 14

RENDER = """
import gc
import sys
import mitsuba as mi
import numpy as np
import stratalux

mi.set_variant(sys.argv[1])


def scene():
    return mi.load_dict({
        "type": "scene",
        "ball": {"type": "sphere", "bsdf": {"type": "conductor"}},
        "sky": {"type": "envmap", "bitmap": mi.Bitmap(np.ones((8, 16, 3), dtype=np.float32))},
        "sensor": {"type": "perspective", "to_world": mi.ScalarTransform4f().look_at([0, 0, -4], [0, 0, 0], [0, 1, 0]),
                   "film": {"type": "hdrfilm", "width": 8, "height": 8}},
    })


lit, integrator = scene(), mi.load_dict({"type": "direct_stratified", "strata": 4})
mi.render(lit, integrator=integrator, spp=1)
gc.disable()
past = [scene()]
past.append(past)
del past
# The next collection comes while a kernel is traced that asks for emitters twice: before and after.
traced = type(integrator).environment_light
type(integrator).environment_light = lambda *arguments: [gc.isenabled() and gc.collect(), traced(*arguments)][1]
gc.enable()
assert mi.render(lit, integrator=integrator, spp=1, seed=1).numpy().mean() > 0.9
"""


def test_no_scene_of_the_past_is_freed_while_a_kernel_is_traced() -> None:
    """Dr.Jit would end the process."""
    command = [sys.executable, "-c", RENDER, RGB]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr


def test_the_power_heuristic() -> None:
    from stratalux.integrators.other_emitters import power_heuristic  # of the active variant

    a, b = np.array([0, 0, 1, 2, 3, 1e-20, 1e20]), np.array([0, 1, 0, 1, 3, 1e20, 1e-20])
    expected = np.where(a > 0, a**2 / np.maximum(a**2 + b**2, 1e-300), 0)
    np.testing.assert_allclose(power_heuristic(mi.Float(a), mi.Float(b)).numpy(), expected, rtol=1e-6, atol=1e-30)


def test_what_resampling_follows() -> None:
    from stratalux.integrators.common import target

    assert target(mi.Spectrum(1, 2, 4)).numpy() == pytest.approx(0.212671 + 2 * 0.715160 + 4 * 0.072169)
    mi.set_variant(SPECTRAL)
    assert target(mi.Spectrum(1, 2, 4, 9)).numpy() == pytest.approx(4)


def test_a_table_by_identity() -> None:
    from stratalux.integrators.identities import by_identity

    kept = [mi.load_dict({"type": "diffuse"}) for _ in range(5)]
    pointers = mi.BSDFPtr([kept[3], kept[1], kept[4]])
    table = by_identity(pointers, mi.UInt32([7, 8, 9]), 6).numpy()
    identity = dr.reinterpret_array(mi.UInt32, pointers).numpy()
    assert table[identity].tolist() == [7, 8, 9] and len(table) == identity.max() + 1
    others = dr.reinterpret_array(mi.UInt32, mi.BSDFPtr([kept[0], kept[2]])).numpy()
    assert set(table[others[others < len(table)]].tolist()) <= {6}
    assert table[0] == 6


def surface(count: int = LANES) -> tuple[mi.SurfaceInteraction3f, mi.Sampler]:
    """Seen from anywhere in front of it, and random numbers."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, count)
    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.sh_frame = mi.Frame3f(mi.Normal3f(0, 0, 1))
    si.wi = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
    return si, sampler


@pytest.mark.parametrize("name", ["roughplastic", "plastic", "mask", "mirror"])
def test_draws_are_those_of_smooth_lobes(name: str) -> None:
    """With derivatives or without, a sample stands for the same: f cos / p, and 0 where it is not found."""
    from stratalux.integrators.common import draw, only

    half = {"type": "mask", "opacity": 0.5, "inside": {"type": "roughconductor", "alpha": 0.3}}
    bsdf = mi.load_dict({**MATERIALS, "mask": half}[name])
    bsdfs = dr.gather(mi.BSDFPtr, mi.BSDFPtr(bsdf), dr.zeros(mi.UInt32, LANES))
    si, sampler = surface()
    u = sampler.next_1d(), sampler.next_2d()
    ctx = only(mi.BSDFFlags.Smooth)
    bs, weight, found = draw(bsdfs, ctx, si, *u)
    again, again_weight, again_found = draw(bsdfs, ctx, si, *u, True, True)
    share = found.numpy().mean()
    assert {"mirror": share == 0, "mask": 0.3 < share < 0.6}.get(name, 0.9 < share <= 1)
    assert not (found & mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)).numpy().any()
    lit, found = found.numpy(), again_found.numpy()
    assert (found >= lit).all()
    np.testing.assert_allclose(again.pdf.numpy()[lit], bs.pdf.numpy()[lit], rtol=1e-3)
    np.testing.assert_allclose(again_weight.numpy()[:, lit], weight.numpy()[:, lit], rtol=2e-3, atol=1e-5)
    _, _, none = draw(bsdfs, ctx, si, *u, mi.Bool(False))
    assert not none.numpy().any()


@pytest.mark.parametrize("differentiated", [False, True])
def test_black_counts_only_where_it_may_change(differentiated: bool) -> None:
    from stratalux.integrators.common import draw, only

    bsdf = mi.load_dict({"type": "diffuse", "reflectance": 0.0})
    bsdfs = dr.gather(mi.BSDFPtr, mi.BSDFPtr(bsdf), dr.zeros(mi.UInt32, LANES))
    si, sampler = surface()
    u = sampler.next_1d(), sampler.next_2d()
    _, _, found = draw(bsdfs, only(mi.BSDFFlags.Smooth), si, *u, True, differentiated)
    assert found.numpy().mean() == pytest.approx(float(differentiated), abs=1e-2)


def test_without_bsdf_samples_map_samples_count_in_full() -> None:
    from stratalux.integrators.common import MisWithBsdf

    bsdf = mi.load_dict(MATERIALS["roughplastic"])
    bsdfs = dr.gather(mi.BSDFPtr, mi.BSDFPtr(bsdf), dr.zeros(mi.UInt32, LANES))
    si, sampler = surface()
    wo = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
    density = mi.Float(np.arange(LANES) % 3)
    alone = MisWithBsdf(0).eval(si, bsdfs, wo, density, mi.Bool(True)).numpy()
    full, pdf = bsdfs.eval_pdf(mi.BSDFContext(), si, wo)
    np.testing.assert_allclose(alone, full.numpy(), rtol=1e-5)
    for count in (1, 4):
        weighted = MisWithBsdf(count).eval(si, bsdfs, wo, density, mi.Bool(True)).numpy()
        total = density.numpy() + count * pdf.numpy()
        np.testing.assert_allclose(weighted, full.numpy() * density.numpy() / total, rtol=1e-3, atol=1e-6)
    below = MisWithBsdf(1).eval(si, bsdfs, -wo, mi.Float(0), mi.Bool(True)).numpy()
    assert (below == 0).all()  # and no 0 / 0


def test_delta_lobes_are_seen_wherever_they_are() -> None:
    from stratalux.integrators.other_emitters import has_delta

    def scene(**more: Any) -> mi.Scene:
        return mi.load_dict({**scene_dict("diffuse"), **more})

    assert not has_delta(scene())
    assert has_delta(scene(more={"type": "sphere", "bsdf": {"type": "plastic"}}))
    group = {"type": "shapegroup", "ball": {"type": "sphere", "bsdf": {"type": "diffuse"}}}
    assert has_delta(scene(group=group, instance={"type": "instance", "group": {"type": "ref", "id": "group"}}))


POINT = {"type": "point", "position": [0, 3, 0], "intensity": 5.0}


@pytest.mark.parametrize(
    ("more", "lights", "found_by_bsdf"),
    [
        ({}, False, False),
        ({"point": POINT}, True, False),
        ({"lamp": "lamp"}, True, True),
        ({"lamp": "weightless"}, False, True),
        ({"point": POINT, "lamp": "weightless"}, True, True),
    ],
)
@pytest.mark.parametrize("apart", [True, False])
def test_other_emitters_are_sampled_where_there_are_any(
    more: dict[str, Any], lights: bool, found_by_bsdf: bool, apart: bool
) -> None:
    from stratalux.integrators.other_emitters import OtherEmitters

    if isinstance(more.get("lamp"), str):
        made = lamp()
        made["emitter"]["sampling_weight"] = 0.0 if more["lamp"] == "weightless" else 1.0
        more = {**more, "lamp": made}
    scene = mi.load_dict({**scene_dict("diffuse"), **more})
    others = OtherEmitters(scene, apart)
    assert (others.lights, others.found_by_bsdf) == ((lights, found_by_bsdf) if apart else (True, True))
    assert len(others.arrays()) == 2 * others.lights
    if others.lights:
        counted = [not apart or emitter is not scene.environment() for emitter in scene.emitters()]
        weights = [e.sampling_weight() * here for e, here in zip(scene.emitters(), counted, strict=True)]
        pmf = others._distribution.eval_pmf_normalized(dr.arange(mi.UInt32, len(weights))).numpy()
        np.testing.assert_allclose(pmf, np.array(weights) / sum(weights))


@pytest.mark.parametrize("differentiated", [False, True])
@pytest.mark.parametrize("material", ["diffuse", "roughplastic"])
def test_emitter_and_bsdf_samples_share_an_area_light(material: str, differentiated: bool) -> None:
    """Wherever a BSDF sample finds the only lamp, its weight and that of a sample of the lamp add up to 1."""
    from stratalux.integrators.other_emitters import OtherEmitters, power_heuristic

    # An even lamp all around: every sample of either kind reaches it.
    ball = {"type": "sphere", "radius": 5.0, "flip_normals": True, "emitter": {"type": "area", "radiance": 2.0}}
    description = {"type": "scene", "ball": ball, "sky": scene_dict()["sky"]}
    scene = mi.load_dict(description)
    others = OtherEmitters(scene, True, differentiated)
    bsdf = mi.load_dict(MATERIALS[material])
    bsdfs = dr.gather(mi.BSDFPtr, mi.BSDFPtr(bsdf), dr.zeros(mi.UInt32, LANES))

    def drawn(method: Any) -> Any:
        si, _ = surface()
        si.t = 1
        si.n = mi.Normal3f(0, 0, 1)
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(5, LANES)
        return si, sampler, method(scene, sampler, si, bsdfs, mi.Bool(True)).numpy()

    si, sampler, found = drawn(others.bsdf_sampling)
    sampler.seed(5, LANES)
    bs, weight = bsdfs.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
    hit = scene.ray_intersect(si.spawn_ray(si.to_world(bs.wo)))
    ds = mi.DirectionSample3f(scene, hit, si)
    pdf = hit.emitter(scene).pdf_direction(si, ds)
    ok = (dr.any(weight != 0) & (bs.pdf > 0)).numpy()
    expected = (weight * 2 * power_heuristic(bs.pdf, pdf)).numpy()
    np.testing.assert_allclose(found[:, ok], expected[:, ok], rtol=5e-3, atol=1e-4)

    for method in (others.bsdf_sampling, others.emitter_sampling):
        active = mi.Bool(np.arange(LANES) % 2 == 0)
        sampler.seed(5, LANES)
        half = method(scene, sampler, si, bsdfs, active).numpy()
        assert (half[:, 1::2] == 0).all() and (half[:, ::2] > 0).any()

    si, sampler, found = drawn(others.emitter_sampling)
    sampler.seed(5, LANES)
    sampler.next_1d()
    lamp_only = scene.shapes()[0].emitter()
    ds, _ = lamp_only.sample_direction(si, sampler.next_2d())
    f, of_bsdf = bsdfs.eval_pdf(mi.BSDFContext(), si, si.to_local(ds.d))
    expected = dr.select(ds.pdf > 0, f * 2 / ds.pdf * power_heuristic(ds.pdf, of_bsdf), 0).numpy()
    np.testing.assert_allclose(found, expected, rtol=5e-3, atol=1e-4)


@pytest.mark.parametrize("blocked", [False, True])
@pytest.mark.parametrize("count", [1, 3])
def test_bsdf_samples_bring_light_over_all_densities(count: int, blocked: bool) -> None:
    from stratalux.integrators.common import MisWithBsdf, draw, only

    description = {"type": "scene", "sky": scene_dict()["sky"]}
    if blocked:
        description["around"] = {"type": "sphere", "radius": 5.0}
    scene = mi.load_dict(description)
    light = mi.load_dict({"type": "direct_stratified", "strata": 4}).prepare(scene)
    bsdf = mi.load_dict(MATERIALS["roughconductor"])
    bsdfs = dr.gather(mi.BSDFPtr, mi.BSDFPtr(bsdf), dr.zeros(mi.UInt32, LANES))
    si, _ = surface()
    si.t, si.n = 1, mi.Normal3f(0, 0, 1)

    def density(d: mi.Vector3f, L: mi.Spectrum, active: mi.Bool) -> mi.Float:
        return dr.select(d.y > 0, mi.Float(0.3), 0)  # of the map's frame

    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(2, LANES)
    active = mi.Bool(np.arange(LANES) % 4 > 0)
    found = MisWithBsdf(count).bsdf_samples(scene, light, density, sampler, si, bsdfs, active).numpy()
    sampler.seed(2, LANES)
    expected = np.zeros_like(found)
    for _ in range(count):
        bs, weight, drawn = draw(bsdfs, only(mi.BSDFFlags.Smooth), si, sampler.next_1d(), sampler.next_2d(), active)
        d = si.to_world(bs.wo)
        L = light.radiance_towards(d, si, drawn)
        total = density(light.from_world(d), L, drawn) + count * bs.pdf
        expected += dr.select(drawn, L * weight * bs.pdf / total, 0).numpy()
    if blocked:
        expected *= 0
    assert blocked or expected.any()
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("sky", [True, False])
@pytest.mark.parametrize("hide", [True, False])
def test_alpha_is_that_of_what_is_seen(hide: bool, sky: bool) -> None:
    """A map that can be seen covers all; without one, or where it is hidden, there are only the shapes."""
    description = {**scene_dict("diffuse"), "lamp": lamp()}
    del description["floor"]
    description["sensor"]["film"]["pixel_format"] = "rgba"
    if not sky:
        del description["sky"]
    integrator = mi.load_dict({"type": "direct_stratified", "hide_emitters": hide, "strata": 4})
    scene = mi.load_dict(description)
    image = np.array(mi.render(scene, integrator=integrator, spp=4))
    ray, _ = scene.sensors()[0].sample_ray(0, 0.5, mi.Point2f([0.5, 0.02], [0.6, 0.98]), mi.Point2f(0.5))
    assert scene.ray_test(ray).numpy().tolist() == [True, False]
    at_ball, beside = image[7, 9], image[-1, 0]
    assert at_ball[3] == pytest.approx(1)
    assert beside[3] == pytest.approx(float(sky and not hide)) and (beside[:3] > 0).all() == (sky and not hide)


@pytest.mark.parametrize("properties", [{}, {"strata": 4}])
def test_what_is_not_given_is_as_mitsuba_has_it(properties: dict[str, int]) -> None:
    """The first sensor, seed 0, and as many samples as its sampler has."""
    description = scene_dict("diffuse", size=(6, 4))
    other = {**description["sensor"], "fov": 10, "sampler": {"type": "independent", "sample_count": 9}}
    scene = mi.load_dict({**description, "second": other})
    integrator = mi.load_dict({"type": "direct_stratified", **properties})
    image = np.array(integrator.render(scene))
    same = np.array(mi.render(scene, integrator=integrator, sensor=0, seed=0, spp=4))
    np.testing.assert_allclose(image, same, rtol=1e-4, atol=1e-6)
    if not properties:
        found, asked = ([spp for _, spp, _ in passes] for passes in (
            integrator.passes(scene, scene.sensors()[0]), integrator.passes(scene, scene.sensors()[0], 0, 4)
        ))  # fmt: skip
        assert found == asked and found[-1] == pytest.approx(4, abs=1)
    for change in ({"seed": 1}, {"sensor": 1}, {"spp": 8}):
        assert np.abs(np.array(integrator.render(scene, **change)) - same).max() > 1e-4
