"""Tables follow the scene: what ``params.update()`` changes is right in the next render."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import stratalux
from stratalux import EnvironmentMap, EnvironmentMapWarning, InputError
from stratalux.integrators.environment import MapCache
from stratalux.maps.geometry import map_coordinates
from tests.helpers import assert_same_mean, hall_map, runs, scene_dict, sun_map
from tests.variants import RGB, SPECTRAL

OURS = {"type": "direct_stratified", "strata": 16}


@pytest.mark.parametrize("variant", [RGB, pytest.param(SPECTRAL, marks=pytest.mark.slow)])
def test_updates_are_followed(variant: str) -> None:
    mi.set_variant(variant)
    scene = mi.load_dict(scene_dict("diffuse"))
    ours = mi.load_dict(OURS)
    mi.render(scene, integrator=ours, spp=1)
    params = mi.traverse(scene)
    other = mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(hall_map(31, 40)[::-1].copy())})
    changes: dict[str, Any] = {
        "sky.data": mi.traverse(other)["data"],
        "sky.scale": 2.5,
        "sky.to_world": mi.Transform4f().rotate([1, 0, 0], 140).rotate([0, 0, 1], 20),
    }
    for key, value in changes.items():
        params[key] = value
        params.update()
        assert_same_mean(runs(scene, ours, 64, 24, 0), runs(scene, {"type": "direct"}, 512, 24, 10_000))


def test_an_edited_texel_is_followed() -> None:
    """A light appears where there was nothing: tables of the old map would never find it."""
    texels = hall_map()
    texels[3:6, 20:24] = 0
    scene = mi.load_dict(scene_dict("diffuse", texels))
    ours = mi.load_dict(OURS)
    before = np.array(mi.render(scene, integrator=ours, spp=64))
    params = mi.traverse(scene)
    data = params["sky.data"].numpy().copy()
    data[4, 22] = 5000
    params["sky.data"] = mi.TensorXf(data)
    params.update()
    after = runs(scene, ours, 64, 24, 0)
    assert after.mean() > 2 * before.mean()
    assert_same_mean(after, runs(scene, {"type": "direct"}, 1024, 24, 10_000))


def test_radiance_towards_a_direction_is_the_lookup_there() -> None:
    light = MapCache(lambda environment: 1).get(mi.load_dict(scene_dict("diffuse")))
    d = np.random.default_rng(0).normal(size=(500, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    towards, si = mi.Vector3f(d.T), dr.zeros(mi.SurfaceInteraction3f)
    uv = mi.Point2f(*map_coordinates(light.from_world(towards).numpy().T))
    found, expected = light.radiance_towards(towards, si, True).numpy(), light.radiance(si, uv, towards, True).numpy()
    np.testing.assert_allclose(found, expected, rtol=1e-2, atol=1e-3)
    assert not np.allclose(light.radiance_towards(-towards, si, True).numpy(), expected, rtol=1e-2, atol=1e-3)


def test_tables_are_built_once_for_a_map() -> None:
    scene = mi.load_dict(scene_dict("diffuse"))
    built = []
    cache = MapCache(lambda environment: built.append(environment.texels) or len(built))
    assert cache.get(scene).tables == 1
    params = mi.traverse(scene)
    params["sky.scale"] = 7.0
    params["sky.to_world"] = mi.Transform4f().rotate([0, 1, 0], 90)
    params.update()
    assert cache.get(scene).tables == 1
    params["sky.data"] = params["sky.data"] * 2
    params.update()
    assert cache.get(scene).tables == 2
    np.testing.assert_allclose(built[1], 2 * built[0])
    assert cache.get(mi.load_dict({"type": "scene"})) is None


def test_one_integrator_renders_many_scenes() -> None:
    ours = mi.load_dict(OURS)
    for texels in (hall_map(), sun_map(), hall_map(9, 30)):
        scene = mi.load_dict(scene_dict("diffuse", texels))
        fresh = np.array(mi.render(scene, integrator=mi.load_dict(OURS), spp=8))
        np.testing.assert_allclose(np.array(mi.render(scene, integrator=ours, spp=8)), fresh, rtol=1e-4, atol=1e-6)


def test_bad_texels_of_a_scene_are_repaired() -> None:
    texels = hall_map()
    texels[4, 4], texels[5, 5] = np.nan, -1
    scene = mi.load_dict(scene_dict("diffuse", texels))
    with pytest.warns(EnvironmentMapWarning, match="1 NaN, 1 negative"):
        image = np.array(mi.render(scene, integrator=mi.load_dict(OURS), spp=16))
    assert np.isfinite(image).all() and (image >= 0).all()


@pytest.mark.parametrize(
    "integrator",
    [
        {"type": "direct_stratified"},
        {"type": "direct_stratified", "strata": 4, "proposals": 2, "bsdf_samples": 1},
        {"type": "direct_importance", "samples": 4, "proposals": 8, "bsdf_samples": 1},
        {"type": "direct_wavelet", "samples": 4},
    ],
)
def test_one_texel_brighter_than_any_light_is_right(integrator: dict[str, Any]) -> None:
    """The picture of a map is that of the map over a power of two, times it: no sum or square is beyond float32."""
    bright = sun_map()
    bright[bright > 1e4] *= 1e25
    factor = 2.0**90
    images = []
    for texels in (bright, bright / np.float32(factor)):
        scene = mi.load_dict(scene_dict("roughplastic", texels))
        images.append(np.array(mi.render(scene, integrator=mi.load_dict(integrator), spp=16)).astype(np.float64))
    assert np.isfinite(images[0]).all() and images[0].max() > 1e20
    np.testing.assert_allclose(images[0], images[1] * factor, rtol=1e-4, atol=1e-6 * images[0].max())


def test_the_density_of_a_spectral_map_is_its_mean_over_wavelengths() -> None:
    mi.set_variant(SPECTRAL)
    grey = np.linspace(0, 8, 5 * 8, dtype=np.float32).reshape(5, 8)
    scene = mi.load_dict({"type": "scene", "sky": {"type": "envmap", "bitmap": mi.Bitmap(np.dstack([grey] * 3))}})
    built: list[EnvironmentMap] = []
    MapCache(built.append).get(scene)
    assert built[0].texels.shape == (5, 8, 3)
    np.testing.assert_allclose(built[0].texels, np.dstack([grey] * 3), rtol=1e-3, atol=1e-6)
    params = mi.traverse(scene)
    params["sky.data"] = params["sky.data"] * float("nan")
    params.update()
    with pytest.raises(InputError, match="NaN or infinite texels"):
        MapCache(built.append).get(scene)


def test_a_negative_spectral_map_has_a_density_of_0_there() -> None:
    mi.set_variant(SPECTRAL)
    from stratalux.integrators.environment import _rgb_texels

    emitter = mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(np.full((4, 8, 3), 0.5, dtype=np.float32))})
    params = mi.traverse(emitter)
    data = params["data"].numpy()
    data[1, 3, 3] = -2
    params["data"] = mi.TensorXf(data)
    params.update()
    texels = _rgb_texels(emitter)
    assert texels.min() == texels[1, 2].max() == 0 and np.count_nonzero(texels == 0) == 3


def test_infinite_texels_of_a_scene_outshine_the_others() -> None:
    texels = hall_map()
    texels[4, 4] = np.inf
    scene = mi.load_dict(scene_dict("diffuse", texels))
    with pytest.warns(EnvironmentMapWarning, match="1 infinite texel.*to 900, 10 times the largest other"):
        mi.load_dict(OURS).prepare(scene)
    assert mi.traverse(scene)["sky.data"].numpy().max() == 900


def test_a_black_map_renders_black() -> None:
    scene = mi.load_dict(scene_dict("roughplastic", np.zeros((16, 32, 3), dtype=np.float32)))
    image = np.array(mi.render(scene, integrator=mi.load_dict({**OURS, "proposals": 4}), spp=4))
    assert (image == 0).all()


@pytest.mark.parametrize("diagonal", [(1, 2, 1), (1, 1.01, 1), (1, float("nan"), 1)])
def test_a_transform_that_shears_or_scales_unevenly_is_refused(diagonal: tuple[float, float, float]) -> None:
    description = scene_dict("diffuse")
    description["sky"]["to_world"] = mi.ScalarTransform4f(np.diag([*diagonal, 1]))
    with pytest.raises(InputError, match="to_world shears or scales unevenly"):
        stratalux.render(mi.load_dict(description), strata=4)


def test_a_mirrored_map_is_right() -> None:
    description = scene_dict("diffuse")
    description["sky"]["to_world"] = mi.ScalarTransform4f().rotate([1, 0, 0], 30).scale([1, -1, 1])
    scene = mi.load_dict(description)
    assert_same_mean(runs(scene, OURS, 64, 24, 0), runs(scene, {"type": "direct"}, 512, 24, 10_000))


@pytest.mark.parametrize("ours", [OURS, {"type": "direct_stratified"}], ids=["pinned", "automatic"])
@pytest.mark.parametrize("scale", [2.5, 0.01, -3])
def test_a_scale_of_the_transform_means_nothing(scale: float, ours: dict[str, Any]) -> None:
    description = scene_dict("diffuse")
    turned = mi.ScalarTransform4f().rotate([1, 0, 0], 30)
    description["sky"]["to_world"] = turned.scale(float(np.sign(scale)))
    plain = np.array(mi.render(mi.load_dict(description), integrator=mi.load_dict(ours), spp=4))
    description["sky"]["to_world"] = turned.scale(scale)
    scene = mi.load_dict(description)
    with pytest.warns(EnvironmentMapWarning, match=f"to_world scales by {abs(scale)}, which means nothing"):
        image = np.array(mi.render(scene, integrator=mi.load_dict(ours), spp=4))
    np.testing.assert_allclose(image, plain, rtol=1e-3, atol=1e-4)
