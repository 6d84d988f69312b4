"""Derivatives of pictures that are known exactly, or to follow from each other."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.helpers import hall_map, scene_dict

AUTOMATIC = {"type": "direct_stratified"}
PINNED = {"type": "direct_stratified", "strata": 16}
both = pytest.mark.parametrize("ours", [AUTOMATIC, PINNED], ids=["automatic", "pinned"])
PARAMETERS: dict[str, tuple[dict[str, Any] | None, str]] = {
    "map": (None, "sky.data"),
    "principled": ({"type": "principled", "roughness": 0.4, "metallic": 0.5}, "ball.bsdf.roughness.value"),
    "plastic": ({"type": "plastic"}, "ball.bsdf.diffuse_reflectance.value"),
}


def scene(name: str) -> mi.Scene:
    description = scene_dict("diffuse", size=(12, 8))
    if bsdf := PARAMETERS[name][0]:
        description["ball"]["bsdf"] = bsdf
    return mi.load_dict(description)


def forget(params: mi.SceneParameters, key: str, value: Any) -> None:
    """No derivatives of this any more: Dr.Jit looks at all scenes that live, those of other tests too."""
    params[key] = dr.detach(value)
    params.update()


def forward(of: mi.Scene, ours: dict[str, Any], key: str, direction: Any, spp: int, seed: int) -> NDArray[Any]:
    """The derivative of the picture where ``key`` goes along ``direction``."""
    params = mi.traverse(of)
    before = type(params[key])(params[key])
    t = mi.Float(0)
    dr.enable_grad(t)
    params[key] = before + t * direction
    params.update()
    image = mi.render(of, params, integrator=mi.load_dict(ours), spp=spp, seed=seed + 1, seed_grad=seed)
    dr.forward(t)
    forget(params, key, before)
    return dr.grad(image).numpy().astype(np.float64)


@both
def test_same_samples_same_derivative(ours: dict[str, Any]) -> None:
    """A matte picture is linear in its reflectance, and the samples do not depend on that: a difference is exact."""
    of, key = scene("map"), "ball.bsdf.reflectance.value"
    params, ends = mi.traverse(of), []
    integrator = mi.load_dict(ours)
    integrator = getattr(integrator, "_plain", integrator)  # in the order of samples that derivatives have
    before = mi.Color3f(params[key])
    for step in (-0.05, 0.05):
        params[key] = before + step
        params.update()
        ends.append(mi.render(of, integrator=integrator, spp=8, seed=3).numpy())
    params[key] = before
    params.update()
    found = forward(of, ours, key, mi.Color3f(1), 8, 3)
    np.testing.assert_allclose(found, (ends[1] - ends[0]) / 0.1, rtol=2e-3, atol=1e-4)
    assert np.abs(found).max() > 0.1


@pytest.mark.parametrize("ours", [AUTOMATIC, pytest.param(PINNED, marks=pytest.mark.slow)], ids=["automatic", "pinned"])
@pytest.mark.parametrize("name", ["map", *(pytest.param(n, marks=pytest.mark.slow) for n in ("principled", "plastic"))])
def test_forward_and_backward_agree(name: str, ours: dict[str, Any]) -> None:
    """Along one direction, for one seed, weighted over the picture by random numbers."""
    of, key = scene(name), PARAMETERS[name][1]
    params = mi.traverse(of)
    value = type(params[key])(params[key])
    direction = type(value)(1) if name != "map" else mi.TensorXf(np.ones(value.shape, dtype=np.float32))
    along = forward(of, ours, key, direction, 4, 5)
    weights = np.random.default_rng(2).uniform(-1, 1, along.shape).astype(np.float32)
    dr.enable_grad(value)
    params[key] = value
    params.update()
    image = mi.render(of, params, integrator=mi.load_dict(ours), spp=4, seed=6, seed_grad=5)
    dr.backward(dr.sum(image * mi.TensorXf(weights)))
    expected, found = (along * weights).sum(), dr.grad(value).numpy().sum()
    forget(params, key, value)
    assert abs(expected) > 1e-3
    assert found == pytest.approx(expected, rel=2e-3, abs=1e-4)


@both
@pytest.mark.parametrize("key", ["sky.data", pytest.param("sky.scale", marks=pytest.mark.slow)])
def test_light_can_be_learned_from_none(key: str, ours: dict[str, Any]) -> None:
    """At 0, the derivative of a map times t is the picture that it makes."""
    lit = mi.load_dict(scene_dict("roughplastic", np.ones((8, 16, 3), dtype=np.float32), size=(12, 8)))
    picture = mi.render(lit, integrator=mi.load_dict({"type": "direct"}), spp=512).numpy()
    params = mi.traverse(lit)
    t = mi.Float(0)
    dr.enable_grad(t)
    before = type(params[key])(params[key])
    params[key] = before * t
    params.update()
    image = mi.render(lit, params, integrator=mi.load_dict(ours), spp=64)
    dr.forward(t)
    forget(params, key, before)
    assert (image.numpy() == 0).all()
    np.testing.assert_allclose(dr.grad(image).numpy().mean(axis=(0, 1)), picture.mean(axis=(0, 1)), rtol=0.02)


def test_a_map_that_is_being_learned_is_left_as_it_is() -> None:
    """Texels that a step has made negative are no light to sample, but they are not replaced in the scene."""
    lit = mi.load_dict(scene_dict("diffuse", hall_map()))
    params = mi.traverse(lit)
    data = params["sky.data"].numpy().copy()
    data[3:6] = -0.1
    learned = mi.TensorXf(data)
    dr.enable_grad(learned)
    params["sky.data"] = learned
    params.update()
    image = mi.render(lit, params, integrator=mi.load_dict(AUTOMATIC), spp=4)
    dr.backward(dr.mean(image))
    assert mi.traverse(lit)["sky.data"].numpy()[4, 4, 0] == pytest.approx(-0.1)
    gradient = dr.grad(learned).numpy()
    forget(params, "sky.data", learned)
    assert np.isfinite(gradient).all()
    assert np.abs(gradient).max() > 0


@both
def test_other_scenes_that_live_make_no_difference(ours: dict[str, Any]) -> None:
    of, key = scene("plastic"), PARAMETERS["plastic"][1]
    alone = forward(of, ours, key, mi.Float(1), 4, 5)
    others = [scene(name) for name in ("map", "principled")]
    np.testing.assert_allclose(forward(of, ours, key, mi.Float(1), 4, 5), alone, rtol=1e-4, atol=1e-5)
    assert len(others) == 2


@both
def test_what_moves_in_another_scene_leaves_no_trace(ours: dict[str, Any]) -> None:
    """Vertices of a scene that is alive beside the one that is rendered, a ball of metal."""
    description = scene_dict("roughconductor", size=(12, 8))
    of = mi.load_dict({name: part for name, part in description.items() if name not in ("box", "floor")})
    params = mi.traverse(of)

    def backward() -> NDArray[Any]:
        value = mi.TensorXf(params["sky.data"])
        dr.enable_grad(value)
        params["sky.data"] = value
        params.update()
        image = mi.render(of, params, integrator=mi.load_dict(ours), spp=4, seed=6, seed_grad=5)
        dr.backward(dr.sum(dr.square(image)))
        forget(params, "sky.data", value)
        return dr.grad(value).numpy()

    alone = backward()
    moving = mi.traverse(mi.load_dict(scene_dict("diffuse", size=(12, 8))))
    t = mi.Float(0)
    dr.enable_grad(t)
    moving["box.vertex_positions"] = moving["box.vertex_positions"] + t
    moving.update()
    np.testing.assert_allclose(backward(), alone, rtol=1e-4, atol=1e-5)
    assert dr.grad(t)[0] == 0
    forget(moving, "box.vertex_positions", moving["box.vertex_positions"])


def test_the_indices_of_metals_have_derivatives() -> None:
    """They have the name of what decides which rays pass glass."""
    from stratalux.integrators.derivatives import refuse_transmission  # of the active variant

    description = scene_dict("roughconductor")
    description["box"]["bsdf"] = {"type": "mask", "opacity": 0.5, "inside": {"type": "diffuse"}}
    of = mi.load_dict(description)
    params = mi.traverse(of)
    key = "ball.bsdf.eta.value"
    value = mi.Color3f(params[key])
    dr.enable_grad(params[key])
    try:
        refuse_transmission(of)
    finally:
        forget(params, key, value)


def test_parameters_that_are_not_set_are_passed_over() -> None:
    from stratalux.integrators.derivatives import parameters

    hair = mi.load_dict({"type": "hair"})
    params, known = mi.traverse(hair), []
    for name in params.keys():  # noqa: SIM118
        try:
            params[name]
        except TypeError:
            continue
        known.append(name)
    assert [name for name, _ in parameters(hair)] == known and len(known) < len(list(params.keys()))
