"""Light that goes straight on: pictures that are known, with masks in front of what is known."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import InputError
from stratalux.integrators.straight import LAYERS, Arrival, lets_through
from tests.helpers import hall_map, scene_dict

AUTOMATIC = {"type": "direct_stratified"}
PINNED = {"type": "direct_stratified", "strata": 4, "bsdf_samples": 1}
ALL = {
    "automatic": AUTOMATIC,
    "pinned": PINNED,
    "importance": {"type": "direct_importance", "samples": 4},
    "wavelet": {"type": "direct_wavelet", "samples": 4, "resolution": 8},
    "lights": {"type": "direct_lights", "lights": 4},
}
every = pytest.mark.parametrize("ours", ALL.values(), ids=ALL.keys())
both = pytest.mark.parametrize("ours", [AUTOMATIC, PINNED], ids=["automatic", "pinned"])
BLACK = {"type": "diffuse", "reflectance": 0.0}
WHITE = np.ones((8, 16, 3), dtype=np.float32)


def mask(opacity: Any, covers: dict[str, Any] = BLACK) -> dict[str, Any]:
    return {"type": "mask", "opacity": opacity, "covers": covers}


def wall(bsdf: dict[str, Any], z: float = 0) -> dict[str, Any]:
    """A big one that faces the camera."""
    T = mi.ScalarTransform4f
    return {"type": "rectangle", "to_world": T().translate([0, 0, z]).rotate([0, 1, 0], 180).scale(4), "bsdf": bsdf}


def scene(texels: NDArray[np.float32] = WHITE, size: tuple[int, int] = (4, 4), **things: dict[str, Any]) -> mi.Scene:
    T = mi.ScalarTransform4f
    return mi.load_dict(
        {
            "type": "scene",
            "sky": {"type": "envmap", "bitmap": mi.Bitmap(texels)},
            "sensor": {
                "type": "perspective",
                "fov": 20,
                "to_world": T().look_at([0, 0, -5], [0, 0, 0], [0, 1, 0]),
                "film": {
                    "type": "hdrfilm",
                    "width": size[0],
                    "height": size[1],
                    "rfilter": {"type": "box"},
                    "pixel_format": "rgba",
                    "component_format": "float32",
                },
            },
            **things,
        }
    )


def mean(of: mi.Scene, ours: dict[str, Any], spp: int = 1024, **properties: Any) -> NDArray[Any]:
    """Of all pixels: colour and alpha."""
    image = mi.render(of, integrator=mi.load_dict({**ours, **properties}), spp=spp, seed=5).numpy()
    assert np.isfinite(image).all()
    return np.asarray(image.astype(np.float64).mean(axis=(0, 1)))


@both
def test_a_stack_of_masks_shows_its_part_of_what_is_behind(ours: dict[str, Any]) -> None:
    """0.5ⁿ of a map of 1: of 16384 camera rays, four standard deviations off at most. Hidden, the map has no alpha."""
    for layers, part in ((1, 0.5), (3, 0.125)):
        of = scene(**{f"wall{k}": wall(mask(0.5), k / 10) for k in range(layers)})
        close = pytest.approx(part, abs=4 * np.sqrt(part * (1 - part) / 16384))
        assert list(mean(of, ours)) == [close, close, close, 1]
        r, g, b, alpha = mean(of, ours, hide_emitters=True)
        assert r == g == b == 0 and 1 - alpha == close


@pytest.mark.parametrize("lights", [False, True])
@pytest.mark.parametrize("closed", [False, True], ids=["open", "closed"])
def test_what_each_ray_brings_from_behind_coloured_layers(closed: bool, lights: bool) -> None:
    """Ray by ray: it passes as many layers as its random number is below products of their luminances."""
    from stratalux.integrators.straight import first_surface  # of the active variant

    lit = [{**wall(mask(0.5), z), "emitter": {"type": "area", "radiance": z + 1.0}} for z in (0, 1)]
    end = {"end": wall(BLACK, 2)} if closed else {}
    of = scene(near=lit[0], far=lit[1], **end)
    T = np.array([0.9, 0.6, 0.3])

    def coloured(si: mi.SurfaceInteraction3f, none: mi.Spectrum) -> mi.Spectrum:
        return dr.select(none > 0, mi.Spectrum(*T.tolist()), 0)

    u = (np.arange(1000) + 0.5) / 1000
    ray = dr.zeros(mi.Ray3f, len(u))
    ray.o, ray.d, ray.maxt = mi.Point3f(0.1, 0.2, -5), mi.Vector3f(0, 0, 1), dr.inf
    active = np.arange(len(u)) % 4 > 0
    found = first_surface(of, ray, mi.Float(u.astype(np.float32)), coloured, lights, mi.Bool(active))
    p = float(mi.luminance(mi.Color3f(*T.tolist()))[0])
    passed = np.where(active, (u < p) * 1 + (u < p * p), 0)
    through = (T[:, None] / p) ** passed
    stays = np.where(passed < 2, 1 - p, 1)
    shone = lights * (np.where(passed > 0, 1.0, 0) + np.where(passed > 1, 2 * T[:, None] / p, 0))
    np.testing.assert_allclose(found.behind(mi.Spectrum(1, 2, 3)).numpy().T, (through * [[1], [2], [3]]).T, rtol=1e-5)
    np.testing.assert_allclose(found.emitted(mi.Spectrum(0)).numpy(), np.broadcast_to(shone, (3, 1000)), rtol=1e-5)
    reflected = found.reflected(mi.Spectrum(1)).numpy()
    np.testing.assert_allclose(reflected[:, active], (through / stays)[:, active], rtol=1e-5)
    t = np.where(found.si.is_valid().numpy(), found.si.p.z.numpy(), np.inf)[active]
    np.testing.assert_allclose(t, np.where(passed < 2, passed, 2 if closed else np.inf)[active], atol=1e-3)
    # On average, that is the product of all: of what is behind them.
    np.testing.assert_allclose(np.where(passed == 2, through, 0)[:, active].mean(axis=1), T * T, rtol=5e-3)


@pytest.mark.parametrize("masks", [False, True])
def test_what_is_in_the_way_of_light(masks: bool) -> None:
    """Ray by ray, up to where each ends; where shadows are what counts, it is what does not arrive."""
    from stratalux.integrators.straight import Obstacles, arriving

    of = scene(near=wall(mask(0.4)), far=wall(mask(0.25), 1), **({} if masks else {"end": wall(BLACK, 2)}))
    ray = dr.zeros(mi.Ray3f, 4)
    ray.o, ray.d = mi.Point3f(0, 0, mi.Float(-1, -1, -1, 3)), mi.Vector3f(0, 0, 1)
    ray.maxt = mi.Float(0.5, 1.5, dr.inf, dr.inf)
    expected = np.array([1, 0.6, 0.6 * 0.75, 1] if masks else [1, 0, 0, 1])
    caught = mi.Bool([True, False, True, True])
    for obstacles, counted in (
        (Obstacles(of, masks), expected),
        (Obstacles(of, masks, caught), np.where(caught.numpy(), 1 - expected, expected)),
    ):
        V = obstacles.visible(ray, mi.Bool(True))
        np.testing.assert_allclose(V.numpy(), np.tile(expected, (3, 1)), rtol=1e-5, atol=1e-7)
        si = dr.zeros(mi.SurfaceInteraction3f, 4)
        si.p, si.n = ray.o, mi.Normal3f(0, 0, 1)
        active = mi.Bool([True, True, False, True])
        brought = arriving(obstacles, si, ray.d, mi.Spectrum(2), active).numpy()[0]
        whole = 1 - expected[2] if obstacles.caught is not None else expected[2]
        np.testing.assert_allclose(brought, 2 * np.array([whole, expected[2], 0, counted[3]]), rtol=1e-5, atol=1e-6)
    plain = arriving(of, si, ray.d, mi.Spectrum(2), mi.Bool([True, True, False, True])).numpy()[0]
    assert plain.tolist() == [0, 0, 0, 2]


def test_a_half_transparent_ball_has_two_walls() -> None:
    """Evenly shared random numbers: with 64 samples, a quarter of a pixel's go on through both, but for one or two."""
    of = scene(size=(1, 1), ball={"type": "sphere", "radius": 4, "center": [0, 0, 8], "bsdf": mask(0.5)})
    assert mean(of, AUTOMATIC, spp=64)[0] == pytest.approx(0.25, abs=2 / 64)


@both
def test_a_furnace_stays_even_whatever_the_mask_covers(ours: dict[str, Any]) -> None:
    """A white wall under a map of 1 is invisible, and so is one with holes of any kind."""
    white = {"type": "diffuse", "reflectance": 1.0}
    holes = {"type": "checkerboard", "color0": 0.0, "color1": 1.0, "to_uv": mi.ScalarTransform4f().scale(16)}
    for opacity in (0.3, holes):
        of = scene(front=wall(mask(opacity, white)))
        image = mi.render(of, integrator=mi.load_dict(ours), spp=256, seed=1).numpy()
        assert image[..., :3].mean() == pytest.approx(1, abs=0.02)


def test_thin_glass_is_invisible_in_a_furnace() -> None:
    """What it does not let through, it reflects: its own lobe has the chance of the rays that stay."""
    assert mean(scene(front=wall({"type": "thindielectric"})), PINNED)[0] == pytest.approx(1, abs=0.03)


def test_a_variate_has_the_weight_of_what_is_reflected() -> None:
    from stratalux.integrators.automatic.nested_strata import PixelPoints

    points = PixelPoints(mi.UInt32(0), mi.UInt32(0))
    points.difference, points.varied = mi.Spectrum(1, 2, 3), True
    shaded = Arrival(dr.zeros(mi.SurfaceInteraction3f), mi.Spectrum(1), mi.Spectrum(2, 2, 4), mi.Spectrum(0))
    mi.load_dict(AUTOMATIC).weigh(points, shaded)
    assert points.difference.numpy().ravel().tolist() == [2, 4, 12]


def test_textured_opacity_is_looked_up_where_the_ray_is() -> None:
    """A board of two fields by two: through the holes there is the map of 1, and elsewhere nothing."""
    board = {"type": "checkerboard", "color0": 0.0, "color1": 1.0}
    of = scene(size=(2, 2), wall=wall(mask(board)))
    for ours in (AUTOMATIC, PINNED):
        image = mi.render(of, integrator=mi.load_dict(ours), spp=16, seed=2).numpy()[..., 0]
        assert sorted(image.ravel().tolist()) == [0, 0, 1, 1] and image[0, 0] == image[1, 1]


@every
def test_the_shadow_of_a_mask(ours: dict[str, Any]) -> None:
    """Opacity 0.3 before a sun of one texel takes 0.3 of its light on the floor, and 0.3 of what is left again."""
    T = mi.ScalarTransform4f
    sun = np.zeros((33, 64, 3), dtype=np.float32)
    sun[6, 20] = 100
    floor = {
        "type": "rectangle",
        "to_world": T().translate([0, -1, 0]).rotate([1, 0, 0], -90).scale(2),
        "bsdf": {"type": "diffuse", "reflectance": 0.8},
    }
    roof = {"type": "rectangle", "to_world": T().translate([0, 3, 0]).rotate([1, 0, 0], 90).scale(30)}
    view = {"sensor": {**_overhead(T)}}
    images = [
        mi.render(
            mi.load_dict(_lit(sun, floor, view, [{**roof, "bsdf": bsdf} for bsdf in roofs])),
            integrator=mi.load_dict(ours),
            spp=64,
            seed=4,
        ).numpy()
        for roofs in ([], [mask(0.3)], [mask(0.3), mask(0.3)], [mask(0.3, mask(0.0))])
    ]
    open_, once, twice, nested = (image.astype(np.float64).mean(axis=(0, 1)) for image in images)
    assert open_.min() > 0.01
    # The same samples, of which some are skipped for being dark: the ratio is exact, but for those.
    np.testing.assert_allclose(once / open_, 0.7, rtol=2e-2)
    np.testing.assert_allclose(twice / open_, 0.49, rtol=2e-2)
    np.testing.assert_allclose(nested / open_, 1, rtol=2e-2)


def _overhead(T: Any) -> dict[str, Any]:
    """Below the roofs, above the floor."""
    return {
        "type": "perspective",
        "fov": 20,
        "to_world": T().look_at([0, 1, 0.01], [0, -1, 0], [0, 0, 1]),
        "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
    }


def _lit(sun: NDArray[np.float32], floor: Any, view: Any, roofs: list[Any]) -> dict[str, Any]:
    things = {f"roof{k}": {**roof, "to_world": _lifted(roof["to_world"], k)} for k, roof in enumerate(roofs)}
    return {"type": "scene", "sky": {"type": "envmap", "bitmap": mi.Bitmap(sun)}, "floor": floor, **things, **view}


def _lifted(to_world: Any, k: int) -> Any:
    return mi.ScalarTransform4f().translate([0, 0.1 * k, 0]) @ to_world


@both
def test_masks_within_instances_are_found(ours: dict[str, Any]) -> None:
    """They do not tell what they are made of; a group does."""
    group = {"type": "shapegroup", "wall": {**wall(mask(0.5)), "to_world": mi.ScalarTransform4f().scale(4)}}
    back = mi.ScalarTransform4f().rotate([0, 1, 0], 180)
    instance = {"type": "instance", "shapegroup": {"type": "ref", "id": "group"}, "to_world": back}
    of = scene(group=group, instance=instance)
    assert lets_through(of)
    assert mean(of, ours)[0] == pytest.approx(0.5, abs=0.02)
    opaque = {**group, "wall": {**group["wall"], "bsdf": BLACK}}
    assert not lets_through(scene(group=opaque, instance=instance))


@both
def test_lights_are_seen_and_shine_through_masks(ours: dict[str, Any]) -> None:
    """A lamp of 2 behind opacity 0.5 shows as 1, and lights a mirror as that. Hidden, it is a hole to the map of 1."""
    lamp = {**wall(BLACK, 2), "emitter": {"type": "area", "radiance": 2.0}}
    of = scene(front=wall(mask(0.5)), lamp=lamp)
    assert mean(of, ours)[0] == pytest.approx(1, abs=0.04)
    r, _, _, alpha = mean(of, ours, hide_emitters=True)
    assert r == 0 and alpha == pytest.approx(0.5, abs=0.02)
    T = mi.ScalarTransform4f
    up = [{"type": "rectangle", "to_world": T().translate([0, 0, -z]).scale(40)} for z in (7, 6)]
    behind = {"lamp": {**up[0], "emitter": lamp["emitter"]}, "cover": {**up[1], "bsdf": mask(0.5)}}
    for bsdf in ({"type": "conductor"}, {"type": "diffuse", "reflectance": 1.0}):
        picture = mi.render(scene(mirror=wall(bsdf), **behind), integrator=mi.load_dict(ours), spp=256, seed=1).numpy()[
            ..., :3
        ]
        assert picture.mean() == pytest.approx(1.0, abs=0.06)


@both
def test_a_ray_ends_black_where_layers_have_no_end(ours: dict[str, Any]) -> None:
    clear = {"type": "null"}
    for layers, seen in ((LAYERS - 1, 1), (LAYERS, 0)):
        of = scene(**{f"wall{k}": wall(clear, k / 100) for k in range(layers)})
        assert list(mean(of, ours, spp=1)) == [seen, seen, seen, 1]


@both
def test_what_is_learned_of_transmission_is_refused(ours: dict[str, Any]) -> None:
    """Which samples there are depends on it. Other parameters of the same scene have derivatives."""
    of = scene(hall_map(), front=wall(mask(0.5, {"type": "diffuse", "reflectance": 0.5})))
    params = mi.traverse(of)
    with pytest.raises((InputError, RuntimeError)) as stop:
        _gradient(of, params, ours, "front.bsdf.opacity.value")
    told = stop.value if isinstance(stop.value, InputError) else stop.value.__cause__
    assert "no derivatives for 'front.bsdf.opacity.value'" in str(told)
    found = _gradient(of, params, ours, "front.bsdf.nested_bsdf.reflectance.value")
    # Linear in the reflectance: half the pixel is what the wall reflects, of which the derivative is known from it.
    reflected = mi.render(of, integrator=mi.load_dict(ours), spp=4096, seed=1).numpy()[..., :3].sum()
    through = mi.render(scene(hall_map(), front=wall(mask(0.5))), integrator=mi.load_dict(ours), spp=4096).numpy()
    expected = (reflected - through[..., :3].sum()) / 0.5
    assert float(dr.sum(found)[0]) == pytest.approx(expected, rel=0.1)


def _gradient(of: mi.Scene, params: Any, ours: dict[str, Any], key: str) -> Any:
    """Of the sum of the picture's colours."""
    value = type(params[key])(params[key])
    dr.enable_grad(params[key])
    params.update()
    try:
        image = mi.render(of, params, integrator=mi.load_dict(ours), spp=1024, seed=1)
        dr.backward(dr.sum(image[..., :3]))
        return dr.grad(params[key])
    finally:
        params[key] = dr.detach(value)
        params.update()


@pytest.mark.parametrize("lamp", [False, True])
def test_a_pane_in_an_even_world_shows_it_without_noise(lamp: bool) -> None:
    """What it does not let through it mirrors: each sample is 1, whichever it does."""
    T = mi.ScalarTransform4f
    described = scene_dict("diffuse", np.ones((16, 32, 3), dtype=np.float32), size=(6, 4))
    pane = {"type": "rectangle", "bsdf": {"type": "thindielectric"}, "to_world": T().rotate([1, 1, 0], 20).scale(9)}
    sky = {**described["sky"], "scale": 1.0}
    parts = {"type": "scene", "pane": pane, "sky": sky, "sensor": described["sensor"]}
    if lamp:  # far away and black: there is one more emitter that a sample of a BSDF could find
        black = {"type": "area", "radiance": {"type": "rgb", "value": 0.0}}
        parts["lamp"] = {"type": "sphere", "center": [0, 900, 0], "emitter": black}
    image = mi.render(mi.load_dict(parts), integrator=mi.load_dict({"type": "direct_stratified"}), spp=4).numpy()
    np.testing.assert_allclose(image, 1, rtol=2e-3)
