"""``path_stratified`` as a plugin: what it refuses, and that it renders what all of ours do."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import InputError, render
from stratalux.integrators.straight import LAYERS
from stratalux.integrators.techniques import parse_technique
from stratalux.rendering.ready import technique_of
from stratalux.rendering.settings import SamplingSettings
from tests.helpers import scene_dict
from tests.variants import MONO, RGB


def picture(description: dict[str, Any], spp: int = 4, seed: int = 0, **properties: Any) -> NDArray[np.float32]:
    integrator = mi.load_dict({"type": "path_stratified", **properties})
    return render(mi.load_dict(description), integrator=integrator, spp=spp, seed=seed).image


def test_the_same_seed_gives_the_same_image() -> None:
    first, again, other = (picture(scene_dict("roughplastic"), seed=seed) for seed in (7, 7, 8))
    np.testing.assert_allclose(first, again, rtol=1e-5, atol=1e-6)  # threads add to the film in any order
    assert np.abs(first - other).max() > 1e-3


@pytest.mark.parametrize("spp", [1, 2, 3, 16])
def test_as_many_samples_as_asked_for(spp: int) -> None:
    integrator = mi.load_dict({"type": "path_stratified", "max_depth": 4})
    result = render(mi.load_dict(scene_dict()), integrator=integrator, spp=spp)
    assert abs(result.spp - spp) <= max(1, spp // 8)
    assert np.isfinite(result.image).all()


@pytest.mark.parametrize("room", [1 << 21, 24 * 18 * 12])
def test_progress_goes_up_to_what_was_asked_for(room: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", room)
    scene = mi.load_dict(scene_dict())
    integrator = mi.load_dict({"type": "path_stratified", "max_depth": 3})
    numbers = [spp for _, spp, _ in integrator.passes(scene, scene.sensors()[0], 0, 32)]
    assert numbers == sorted(set(numbers)) and numbers[0] > 0
    assert numbers[-1] == pytest.approx(32, rel=0.125)


def test_variants_may_change() -> None:
    for variant in (RGB, MONO):
        mi.set_variant(variant)
        assert picture(scene_dict(), spp=2, max_depth=3).mean() > 0.01


def test_a_scene_of_nothing_is_its_map() -> None:
    description = {key: part for key, part in scene_dict().items() if key not in ("ball", "box", "floor")}
    integrator = mi.load_dict({"type": "direct_stratified"})
    direct = render(mi.load_dict(description), integrator=integrator, spp=4).image
    np.testing.assert_allclose(picture(description, max_depth=2), direct, rtol=1e-4)
    np.testing.assert_allclose(picture(description, spp=8), direct, rtol=1e-4)


def test_no_derivatives() -> None:
    scene = mi.load_dict(scene_dict())
    params = mi.traverse(scene)
    key = next(name for name in params.keys() if name.endswith("reflectance.value"))  # noqa: SIM118
    dr.enable_grad(params[key])
    params.update()
    image = mi.render(scene, params, integrator=mi.load_dict({"type": "path_stratified"}), spp=1)
    with pytest.raises((InputError, RuntimeError), match="path_stratified: has no derivatives"):
        dr.backward(dr.mean(image.array))


def test_a_catcher_and_a_background() -> None:
    """They reflect nothing towards the camera: as in direct light, of which it takes half as many samples."""
    description = {key: part for key, part in scene_dict().items() if key != "box"}
    seen = {"catcher": "floor", "background": mi.ScalarColor3f(0.25, 0.5, 0.75)}
    whole = picture(description, spp=8, max_depth=4, **seen)
    direct = render(
        mi.load_dict(description), integrator=mi.load_dict({"type": "direct_stratified", **seen}), spp=4
    ).image
    same = np.isclose(whole, direct, rtol=1e-4, atol=1e-5).all(axis=-1)
    assert same[0].all() and same[-1, 0] and same[-1, -1] and same[:, 0].all()
    assert not same.all()


@pytest.mark.parametrize("depth", [0, 1])
def test_no_light_on_surfaces(depth: int) -> None:
    message = f"max_depth: {depth} leaves no light on surfaces; give 2 or more, or -1"
    with pytest.raises(InputError, match=message):
        technique_of(SamplingSettings(max_depth=depth))
    with pytest.raises(InputError, match=message):
        parse_technique(f"path-stratified:max_depth={depth}")


PATH = {"type": "path", "max_depth": 5, "rr_depth": 2, "hide_emitters": True}


@pytest.mark.parametrize(
    ("settings", "own", "name", "given"),
    [
        ({}, None, "path-stratified", {"max_depth": 8}),
        ({}, PATH, "path-stratified", {"max_depth": 5, "rr_depth": 2}),
        ({"max_depth": 3}, PATH, "path-stratified", {"max_depth": 3, "rr_depth": 2}),
        ({"max_depth": 3}, {"type": "direct"}, "path-stratified", {"max_depth": 3}),
        ({}, {"type": "direct"}, "stratified", {}),
        ({"direct": True}, PATH, "stratified", {}),
        ({"direct": True, "max_depth": 2}, PATH, "stratified", {}),
        ({"strata": 16}, PATH, "stratified", {"strata": 16}),
        ({"technique": "importance"}, PATH, "importance", {}),
        ({"technique": "path-stratified:rr_depth=7"}, PATH, "path-stratified", {"rr_depth": 7}),
    ],
)
def test_what_is_chosen(settings: dict[str, Any], own: Any, name: str, given: dict[str, Any]) -> None:
    technique, properties = technique_of(SamplingSettings(**settings), own)
    assert (technique.name, properties) == (name, given)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"direct": True, "max_depth": 4}, "max_depth: stratified is direct light"),
        ({"technique": "importance", "max_depth": 4}, "max_depth: importance is direct light"),
        ({"technique": "path-stratified", "direct": True}, "direct: path-stratified is the whole light"),
        ({"technique": "path-stratified", "strata": 3}, "technique path-stratified: no property 'strata'"),
    ],
)
def test_contradictions_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        technique_of(SamplingSettings(**settings))


@pytest.mark.parametrize("layers", [LAYERS - 1, LAYERS])
def test_light_ends_where_layers_have_no_end(layers: int) -> None:
    """Two white walls that light each other, within so many balls that let all light through."""
    T = mi.ScalarTransform4f
    white = {"type": "twosided", "of": {"type": "diffuse", "reflectance": 1.0}}
    walls = {"floor": T().rotate([1, 0, 0], -90), "wall": T().translate([0, 1, -1])}
    around = {f"b{k}": {"type": "sphere", "radius": 8 + k / 16, "bsdf": {"type": "null"}} for k in range(layers)}
    description = {
        **scene_dict("diffuse", np.ones((8, 16, 3), dtype=np.float32), size=(4, 4)),
        **{name: {"type": "rectangle", "to_world": place, "bsdf": white} for name, place in walls.items()},
        **around,
    }
    description["sensor"] |= {"to_world": T().look_at([0, 0.6, 1.5], [0, 0.2, -1], [0, 1, 0]), "fov": 20}
    del description["ball"], description["box"]
    direct, whole = (picture(description, 16, max_depth=depth).mean() for depth in (2, 4))
    if layers < LAYERS:
        assert 0 < 1.1 * direct < whole
    else:
        assert [direct, whole] == pytest.approx([0, 0], abs=1e-3)  # but for the rounding of a variate


def test_what_is_added_to_direct_light() -> None:
    """Channel by channel, wherever there are samples of it at all; alpha and weights stay."""
    from stratalux.integrators.indirect.image import added  # of the active variant

    direct = np.array([[[1, 0, 2, 0.5, 1], [0, 0, 0, 0, 1], [0, 0, 0, 0, 0]]], dtype=np.float32)
    rest = np.tile(np.float32([3, 4, 5, 0, 1]), (1, 3, 1))
    expected = [[[4, 4, 7, 0.5, 1], [3, 4, 5, 0, 1], [0, 0, 0, 0, 0]]]
    np.testing.assert_array_equal(added(direct, rest), expected)
    assert direct[0, 0, 0] == 1


def test_masks_in_samples_that_others_ask_for() -> None:
    """A ball of leaves in a world of 1 is as bright as one knows."""
    a, opacity = 0.8, 0.6
    matte = {"type": "twosided", "of": {"type": "diffuse", "reflectance": a}}
    leaf = {"type": "mask", "opacity": opacity, "inside": matte}
    description = {
        **scene_dict("diffuse", np.ones((8, 16, 3), dtype=np.float32), size=(6, 4)),
        "ball": {"type": "sphere", "flip_normals": True, "bsdf": leaf},
    }
    del description["box"], description["floor"]
    description["sky"]["scale"] = 1.0
    of, lanes = mi.load_dict(description), 1 << 17
    sampler = mi.load_dict({"type": "independent", "sample_count": 1})
    sampler.seed(3, lanes)
    ray = dr.zeros(mi.RayDifferential3f, lanes)
    ray.o, ray.d, ray.maxt = mi.Point3f(0.2, 0.1, 0), mi.warp.square_to_uniform_sphere(sampler.next_2d()), dr.inf
    L, _, _ = mi.load_dict({"type": "path_stratified", "max_depth": 5}).sample(of, sampler, ray)
    expected = (1 - opacity) * ((opacity * a) ** np.arange(5)).sum()
    assert L.numpy().mean() == pytest.approx(expected, rel=0.01)
