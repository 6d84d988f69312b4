"""Derivatives of pictures against finite differences of Mitsuba's ``direct``, and a map learned from a picture."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from stratalux import InputError
from tests.helpers import assert_same_mean, scene_dict

GREY = {"type": "rgb", "value": [0.7, 0.5, 0.3]}
MATERIALS: dict[str, dict[str, Any]] = {
    "diffuse": {"type": "diffuse", "reflectance": GREY},
    "conductor": {"type": "roughconductor", "alpha": 0.3, "specular_reflectance": GREY},
    "plastic": {"type": "roughplastic", "alpha": 0.2, "diffuse_reflectance": GREY},
    "principled": {"type": "principled", "base_color": GREY, "roughness": 0.4, "metallic": 0.5},
}
CASES = {
    "reflectance": ("diffuse", "ball.bsdf.reflectance.value"),
    "texture": ("texture", "ball.bsdf.reflectance.data"),
    "map": ("diffuse", "sky.data"),
    "map's scale": ("diffuse", "sky.scale"),
    "conductor": ("conductor", "ball.bsdf.specular_reflectance.value"),
    "roughness of a conductor": ("conductor", "ball.bsdf.alpha.value"),
    "plastic": ("plastic", "ball.bsdf.diffuse_reflectance.value"),
    "roughness of principled": ("principled", "ball.bsdf.roughness.value"),
}
QUICK: list[Any] = ["reflectance", "map", "roughness of principled"]
SLOW = [pytest.param(case, marks=pytest.mark.slow) for case in CASES if case not in QUICK]
STEP = 0.02


def scene(material: str) -> mi.Scene:
    description = scene_dict(size=(12, 8))
    if material == "texture":
        texels = np.random.default_rng(0).uniform(0.2, 0.8, (4, 4, 3)).astype(np.float32)
        bsdf = {"type": "diffuse", "reflectance": {"type": "bitmap", "raw": True, "bitmap": mi.Bitmap(texels)}}
    else:
        bsdf = MATERIALS[material]
    description["ball"]["bsdf"] = bsdf
    return mi.load_dict(description)


def moved(value: Any, key: str, t: mi.Float) -> Any:
    """The parameter after a step of ``t``; of maps and textures, every other column goes the other way."""
    if not key.endswith("data"):
        return value + t
    way = np.ones(value.shape, dtype=np.float32)
    way[:, ::2] = -0.5
    if key == "sky.data":  # whose columns at both ends are copies
        way[:, 0], way[:, -1] = way[:, -2], way[:, 1]
    return value * (1 + t * mi.TensorXf(way))


def derivatives(of: mi.Scene, key: str, integrator: mi.Integrator, forward: bool) -> np.ndarray:
    """Of independent images (N, H, W, 3), or backward, of the sum of each (N, 1, 1, 1)."""
    params = mi.traverse(of)
    before = type(params[key])(params[key])
    found = []
    for k in range(12):
        t = mi.Float(0)
        dr.enable_grad(t)
        params[key] = moved(before, key, t)
        params.update()
        image = mi.render(of, params, integrator=integrator, spp=64, seed=k, seed_grad=10_000 + k)
        if forward:
            dr.forward(t)
            found.append(np.array(dr.grad(image)))
        else:
            dr.backward(dr.sum(image, axis=None))
            found.append(np.array(dr.grad(t)).reshape(1, 1, 1))
        params[key] = before
        params.update()
    return np.stack(found).astype(np.float64)


def differences(of: mi.Scene, key: str) -> np.ndarray:
    """The same by Mitsuba's ``direct``, with the same random numbers on both sides."""
    direct = mi.load_dict({"type": "direct", "emitter_samples": 2, "bsdf_samples": 2})
    params = mi.traverse(of)
    before = type(params[key])(params[key])
    found = []
    for k in range(12):
        sides = []
        for step in (STEP, -STEP):
            params[key] = moved(before, key, mi.Float(step))
            params.update()
            sides.append(np.array(mi.render(of, integrator=direct, spp=512, seed=50_000 + k)))
        found.append((sides[0] - sides[1]) / (2 * STEP))
    params[key] = before
    params.update()
    return np.stack(found).astype(np.float64)


def same(a: np.ndarray, b: np.ndarray) -> None:
    """Derivatives have both signs and are 0 in many pixels: as positive as :func:`assert_same_mean` wants them."""
    lift = 4 * max(np.abs(a).max(), np.abs(b).max())
    assert np.abs(b.mean()) > 0
    assert_same_mean(a + lift, b + lift)


@pytest.mark.parametrize("case", QUICK + SLOW)
def test_forward(case: str) -> None:
    material, key = CASES[case]
    of = scene(material)
    same(derivatives(of, key, mi.load_dict({"type": "direct_stratified"}), True), differences(of, key))


@pytest.mark.parametrize("case", QUICK[:2] + [pytest.param(case, marks=pytest.mark.slow) for case in QUICK[2:]] + SLOW)
def test_backward(case: str) -> None:
    material, key = CASES[case]
    of = scene(material)
    expected = differences(of, key).sum(axis=(1, 2, 3), keepdims=True)
    same(derivatives(of, key, mi.load_dict({"type": "direct_stratified"}), False), expected)


@pytest.mark.parametrize("strata", [0, 8])
def test_motion_is_refused_in_one_line(strata: int) -> None:
    of = scene("diffuse")
    params = mi.traverse(of)
    dr.enable_grad(params["box.vertex_positions"])
    params.update()
    integrator = mi.load_dict({"type": "direct_stratified", **({"strata": strata} if strata else {})})
    image = mi.render(of, params, integrator=integrator, spp=4)
    with pytest.raises((InputError, RuntimeError), match="direct_projective"):
        dr.backward(dr.mean(image, axis=None))


def test_a_map_is_learned_from_a_picture() -> None:
    """64 x 32 texels, from what a matte ball shows of them: the error falls to less than a fiftieth."""
    v, u = np.meshgrid(np.linspace(0, np.pi, 32), 2 * np.pi * np.arange(64) / 64, indexing="ij")
    truth = np.stack([1 + 0.8 * np.sin(v) * np.sin(u), 1 + 0.8 * np.cos(v), np.ones_like(u)], axis=2).astype(np.float32)
    description = {
        "type": "scene",
        "ball": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.8}}},
        "sky": {"type": "envmap", "bitmap": mi.Bitmap(truth)},
        "sensor": {
            "type": "perspective",
            "fov": 24,
            "to_world": mi.ScalarTransform4f().look_at([0, 1, 5], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 24, "height": 24, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
        },
    }
    hide = {"hide_emitters": True}
    target = mi.render(mi.load_dict(description), integrator=mi.load_dict({"type": "direct", **hide}), spp=512)
    learned = mi.load_dict({**description, "sky": {"type": "envmap", "bitmap": mi.Bitmap(np.ones_like(truth))}})
    integrator = mi.load_dict({"type": "direct_stratified", **hide})
    params = mi.traverse(learned)
    optimizer = mi.ad.Adam(lr=0.1)
    optimizer["sky.data"] = params["sky.data"]

    def error() -> float:
        seen = mi.render(learned, integrator=integrator, spp=512, seed=999)
        return float(np.mean((np.array(seen) - np.array(target)) ** 2))

    before = error()
    for k in range(40):
        params.update(optimizer)
        optimizer.set_learning_rate(0.1 * (1 - k / 40))
        image = mi.render(learned, params, integrator=integrator, spp=16, seed=k)
        dr.backward(dr.mean(dr.square(image - target), axis=None))
        optimizer.step()
        optimizer["sky.data"] = dr.maximum(optimizer["sky.data"], 0)
    params.update(optimizer)
    assert error() < before / 50
