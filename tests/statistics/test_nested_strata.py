"""The estimator that ``direct_stratified`` is by itself: no bias, no fireflies, the same image for the same seed."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import render
from tests.helpers import (
    MATERIALS,
    assert_same_mean,
    asset,
    direct,
    hall_map,
    lamp,
    reference,
    runs,
    scene_dict,
    sun_map,
)
from tests.variants import MONO, SPECTRAL

RUNS = 32
SLOW = pytest.mark.slow
MAPS = ("venice", "studio", "forest", "night", "sky", "apartment", "warehouse")
OURS = {"type": "direct_stratified"}
SMOOTH = ["diffuse", "roughplastic", "roughconductor"]


def scene(material: str = "diffuse", sampler: str = "independent", **more: Any) -> mi.Scene:
    description = scene_dict(material, **more)
    description["sensor"]["sampler"] = {"type": sampler, "sample_count": 16}
    return mi.load_dict(description)


@pytest.mark.parametrize(
    ("material", "sampler"),
    [
        *(
            pytest.param(material, "multijitter", marks=() if material == "roughplastic" else SLOW)
            for material in SMOOTH
        ),
        pytest.param("plastic", "multijitter", marks=SLOW),
        ("diffuse", "independent"),
    ],
)
def test_same_mean_as_direct(material: str, sampler: str) -> None:
    spp = 128 if material == "roughconductor" else 64  # its dark pixels get their light from rare events
    assert_same_mean(runs(scene(material, sampler), OURS, spp, RUNS, seed=0), reference(material))


@pytest.mark.parametrize("spp", [1, pytest.param(3, marks=SLOW)])
def test_few_samples(spp: int) -> None:
    images = runs(scene("roughplastic", "multijitter"), OURS, spp, 16 * RUNS, seed=0)
    assert_same_mean(images.reshape(RUNS, -1, *images.shape[1:]).mean(axis=1), reference("roughplastic"))


@pytest.mark.parametrize("material", [pytest.param(m, marks=SLOW) for m in ("diffuse", "roughplastic")])
def test_a_sun(material: str) -> None:
    ours = runs(scene(material, texels=sun_map()), OURS, 128, RUNS, 0)
    assert_same_mean(ours, direct(scene_dict(material, sun_map())))


@pytest.mark.parametrize("material", [pytest.param(m, marks=SLOW) for m in ("diffuse", "roughconductor", "plastic")])
def test_with_an_area_light(material: str) -> None:
    ours = runs(scene(material, lamp=lamp()), OURS, 128, RUNS, 0)
    assert_same_mean(ours, reference(material, lit_by_lamp=True))


@pytest.mark.parametrize("variant", [pytest.param(variant, marks=SLOW) for variant in (MONO, SPECTRAL)])
def test_other_variants(variant: str) -> None:
    mi.set_variant(variant)
    # Dark pixels get their light from rare events: many runs, so that some have them.
    assert_same_mean(runs(scene("roughconductor"), OURS, 16, 2 * RUNS, 0), reference("roughconductor"))


def test_instances() -> None:
    T = mi.ScalarTransform4f
    group = {"type": "shapegroup", "thing": {"type": "sphere", "bsdf": MATERIALS["roughconductor"]}}
    more = {
        "group": group,
        "copy": {
            "type": "instance",
            "to_world": T().translate([1.5, 1, 0]).scale(0.6),
            "of": {"type": "ref", "id": "group"},
        },
    }
    ours = runs(scene("diffuse", **more), OURS, 128, RUNS, 0)
    assert_same_mean(ours, direct(scene_dict("diffuse", **more)))


def close_up() -> dict[str, Any]:
    """A spot of the floor beside the ball: no noise but that of the light."""
    description = scene_dict("diffuse")
    description["sensor"]["to_world"] = mi.ScalarTransform4f().look_at([1, 2, 5], [0.2, -1, 1.2], [0, 1, 0])
    description["sensor"]["fov"] = 0.01
    return description


def test_launches_go_on_with_the_strata(monkeypatch: pytest.MonkeyPatch) -> None:
    """Several launches of one render are unbiased and, together, as well stratified as a single one."""
    whole = mi.load_dict(close_up())
    at_once = runs(whole, OURS, 64, RUNS, 0)
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", 24 * 16 * 16)
    in_parts = runs(whole, OURS, 64, RUNS, 50_000)
    assert_same_mean(in_parts, direct(close_up(), emitter_samples=4))
    assert in_parts.var(axis=0).mean() < 1.2 * at_once.var(axis=0).mean()


@pytest.mark.parametrize("rfilter", ["gaussian", pytest.param("mitchell", marks=pytest.mark.slow)])
def test_filters_wider_than_a_pixel(rfilter: str) -> None:
    """Samples count in several pixels, which have unequal numbers of them."""
    description = scene_dict("roughplastic")
    description["sensor"]["film"]["rfilter"] = {"type": rfilter}
    assert_same_mean(runs(mi.load_dict(description), OURS, 64, RUNS, 0), direct(description))


def test_strata_beat_the_same_number_of_samples_of_the_paper_scheme() -> None:
    lit = mi.load_dict(close_up())
    variance = {
        name: runs(lit, {"type": "direct_stratified", **pinned}, 16, 32, 0).var(axis=0).mean()
        for name, pinned in (("ours", {}), ("paper", {"strata": 8}))
    }
    assert variance["ours"] < 0.3 * variance["paper"]


def test_no_fireflies() -> None:
    """The largest value of a channel in any of many noisy images, against the largest one of the reference."""
    for material in ("diffuse", "roughconductor"):
        images = runs(scene(material, texels=hall_map()), OURS, 4, 64, 0)
        assert images.max() < 6 * reference(material).mean(axis=0).max()


def test_the_same_seed_gives_the_same_image() -> None:
    lit = scene("roughplastic")
    first, again, other = (render(lit, spp=4, seed=seed).image for seed in (7, 7, 8))
    np.testing.assert_allclose(first, again, rtol=1e-5, atol=1e-6)  # threads add to the film in any order
    assert np.abs(first - other).max() > 1e-3


def test_new_seeds_compile_nothing() -> None:
    """No seed is a literal of a kernel. (Dr.Jit itself may order the inputs of one in two ways.)"""
    lit = scene("roughplastic")
    integrator = mi.load_dict(OURS)
    for seed in (0, 1):
        mi.render(lit, integrator=integrator, spp=4, seed=seed).numpy()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for seed in range(2, 12):
            mi.render(lit, integrator=integrator, spp=4, seed=seed).numpy()
        kernels = [kernel for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]
    assert len(kernels) > 20 and sum(not kernel["cache_hit"] for kernel in kernels) <= 2


def allocated(lit: mi.Scene, shape: mi.ShapePtr, detailed: int = 0) -> list[int]:
    """Rays for light and BSDF samples, and proposals for each of them."""
    from stratalux.integrators.automatic.lobes import Allocation  # of the active variant

    allocation = Allocation(lit, mi.load_dict(OURS).prepare(lit))
    *numbers, _ = allocation.of(shape, shape.bsdf(), mi.UInt32(detailed), mi.Bool(True))
    return [int(number[0]) for number in numbers]


def test_shares_follow_the_lobes() -> None:
    def shares(bsdf: dict[str, Any]) -> list[int]:
        description = scene_dict("diffuse")
        description["ball"]["bsdf"] = bsdf
        loaded = mi.load_dict(description)
        found = [shape for shape in loaded.shapes() if shape.class_name() == "Sphere"]
        return allocated(loaded, mi.ShapePtr(found[0]))

    diffuse, plastic, rough, shiny = (
        shares(bsdf)
        for bsdf in (
            {"type": "diffuse"},
            {"type": "roughplastic", "alpha": 0.2},
            {"type": "roughconductor", "alpha": 0.2},
            {"type": "twosided", "bsdf": {"type": "roughconductor", "alpha": 0.03}},
        )
    )
    assert diffuse[1] == 0 < rough[1] <= rough[0] and shiny[1] > shiny[0]
    assert diffuse[0] > plastic[0] > plastic[1] > 0 and plastic[0] > rough[0] >= shiny[0]


def test_rays_go_to_other_pixels_where_some_are_glossy() -> None:
    """A matte box takes fewer beside metal, and fewer again at a rim; metal that shows detail does so, too."""

    def box_and_ball(material: str, detailed: int) -> list[list[int]]:
        lit = scene(material, texels=np.full((32, 64, 3), 0.7, dtype=np.float32))
        shapes = {shape.class_name(): mi.ShapePtr(shape) for shape in lit.shapes()}
        return [allocated(lit, shapes[name], detailed) for name in ("Cube", "Sphere")]

    assert box_and_ball("diffuse", 0) == box_and_ball("diffuse", 1)
    (plain, metal), (rim, detail) = box_and_ball("roughconductor", 0), box_and_ball("roughconductor", 1)
    assert box_and_ball("diffuse", 0)[0][0] > plain[0] > rim[0] >= metal[0]
    assert metal[1] > detail[1] >= 1 and metal[0] == detail[0]


def test_proposals_follow_the_map() -> None:
    """None more under an even sky; some where the map is full of detail, and more for narrower lobes."""

    def proposals(alpha: float, texels: NDArray[Any]) -> int:
        lit = scene("diffuse", texels=texels.astype(np.float32))
        description = {"type": "roughconductor", "alpha": alpha}
        for shape in lit.shapes():
            shape.set_bsdf(mi.load_dict(description))
        return allocated(lit, mi.ShapePtr(lit.shapes()[0]))[2]

    even = np.full((32, 64, 3), 0.7)
    detailed = even * np.random.default_rng(3).lognormal(0, 3, (32, 64, 1))
    assert proposals(0.14, even) == proposals(0.03, even) == 1
    assert 1 < proposals(0.14, detailed) <= proposals(0.03, detailed)


@pytest.mark.parametrize("material", ["roughplastic", pytest.param("roughconductor", marks=SLOW)])
def test_same_mean_with_many_proposals(material: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stratalux.integrators.automatic.lobes._power_of_two", lambda *_: 4)
    spp = 128 if material == "roughconductor" else 64
    assert_same_mean(runs(scene(material, "multijitter"), OURS, spp, RUNS, seed=0), reference(material))


@pytest.mark.parametrize("wrong", [0.03, pytest.param(0.9, marks=SLOW)])
def test_same_mean_whatever_is_thought_of_visibility(wrong: float, monkeypatch: pytest.MonkeyPatch) -> None:
    def learned(counts: tuple[mi.UInt32, mi.UInt32]) -> mi.Float:
        place = dr.arange(mi.UInt32, dr.width(counts[0]))
        values = dr.select(place % 3 == 0, mi.Float(1 - wrong), wrong)
        dr.eval(values)
        return values

    monkeypatch.setattr("stratalux.integrators.automatic.visibility.Visibility.learn", learned)
    assert_same_mean(runs(scene("roughplastic", "multijitter"), OURS, 64, RUNS, seed=0), reference("roughplastic"))


@pytest.mark.slow
@pytest.mark.parametrize("material", ["diffuse", "plastic", "metal", "polished"])
@pytest.mark.parametrize("name", ["grace_latlong.exr", *(f"{n}.hdr" for n in MAPS)])
def test_real_maps(name: str, material: str) -> None:
    from stratalux.scenes.materials import material as named

    texels = np.array(
        mi.Bitmap(str(asset(f"envmaps/{name}"))).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    )
    description = scene_dict("diffuse", texels)
    description["ball"]["bsdf"] = named(material)
    assert_same_mean(runs(mi.load_dict(description), OURS, 256, RUNS, 0), direct(description, bsdf_samples=2))
