"""A ground that shows nothing but shadows: pictures that are known, and the noise that it saves."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import InputError
from stratalux.integrators.catcher import CatcherCache
from tests.helpers import hall_map, runs, scene_dict
from tests.variants import SPECTRAL

AUTOMATIC = {"type": "direct_stratified"}
PINNED = {"type": "direct_stratified", "strata": 16}
both = pytest.mark.parametrize("ours", [AUTOMATIC, PINNED], ids=["automatic", "pinned"])
WHITE = {"type": "constant", "radiance": 1.0}


def described(texels: NDArray[np.float32] | None = None, only: tuple[str, ...] = (), **more: Any) -> dict[str, Any]:
    """The ground of the scene, with ``only`` some of what stands on it, if any are named; alpha as well."""
    result = scene_dict(texels=texels, **more)
    for name in ("ball", "box"):
        if only and name not in only:
            del result[name]
    result["sensor"]["film"]["pixel_format"] = "rgba"
    return result


def picture(of: dict[str, Any], ours: dict[str, Any], spp: int = 16, **properties: Any) -> NDArray[Any]:
    integrator = mi.load_dict({**ours, "catcher": "floor", **properties})
    return mi.render(mi.load_dict(of), integrator=integrator, spp=spp, seed=1).numpy()


@both
@pytest.mark.parametrize("texels", [None, "blue is dark"])
def test_an_empty_ground_shows_the_background_alone(ours: dict[str, Any], texels: Any) -> None:
    """Without noise, whatever the light; its own look is of no account, nor are lamps."""
    light = hall_map() * np.float32([1, 1, 0]) if texels else None
    of = described(light, ("none",), lamp={"type": "point", "position": [0, 3, 0], "intensity": 9.0})
    image = picture(of, ours, background=WHITE)
    np.testing.assert_allclose(image, 1, rtol=1e-5)
    assert np.all(picture(of, ours, background="none")[6:, :, :] == pytest.approx(0, abs=1e-5))


def test_channels_without_light_have_no_shadow() -> None:
    image = picture(described(hall_map() * np.float32([1, 1, 0]), ("ball",)), PINNED, 64, background=WHITE)
    ground = only_ground()
    assert image[ground][:, 0].min() < 0.9
    np.testing.assert_allclose(image[ground][:, 2], 1, rtol=1e-5)


@both
def test_over_another_picture_alpha_gives_the_shadow(ours: dict[str, Any]) -> None:
    """Under grey light, whose share is one for all channels."""
    of = described(hall_map().mean(axis=2, keepdims=True).repeat(3, axis=2))
    none, white = (picture(of, ours, 256, background=background) for background in ("none", WHITE))
    rough = {"atol": 0.05} if ours is PINNED else {"atol": 0.15}
    np.testing.assert_allclose(none[..., :3] + 1 - none[..., 3:], white[..., :3], **rough)
    both = none[..., :3] + 1 - none[..., 3:], white[..., :3]
    assert both[0].mean() == pytest.approx(both[1].mean(), abs=3e-3)
    assert ((none[..., 3] > 0.05) & (none[..., 3] < 0.95)).any()
    assert np.all(white[..., 3] == pytest.approx(1))
    hidden = picture(of, ours, 256, hide_emitters=True)
    np.testing.assert_allclose(hidden, none, rtol=1e-4, atol=1e-5)


@both
def test_behind_the_ground_is_the_map_where_nothing_else_is_given(ours: dict[str, Any]) -> None:
    of = described(only=("none",))
    bare = {name: part for name, part in of.items() if name != "floor"}
    bare["far"] = {"type": "sphere", "center": [0, 1000, 0]}
    expected = mi.render(mi.load_dict(bare), integrator=mi.load_dict(ours), spp=16, seed=1).numpy()
    np.testing.assert_allclose(picture(of, ours), expected, rtol=0.1, atol=1e-3)


def test_from_below_there_is_no_ground() -> None:
    of = described(only=("ball",))
    of["sensor"]["to_world"] = mi.ScalarTransform4f().look_at([0.3, -6, 4], [0, 0, 0], [0, 1, 0])
    bare = {name: part for name, part in of.items() if name != "floor"}
    expected = mi.render(
        mi.load_dict(bare), integrator=mi.load_dict({**PINNED, "background": "none"}), spp=64, seed=1
    ).numpy()
    found = picture(of, PINNED, 64, background="none")
    np.testing.assert_allclose(found[..., 3], expected[..., 3], atol=0.1)
    assert 0.05 < found[..., 3].mean() == pytest.approx(expected[..., 3].mean(), abs=0.01)
    # It still keeps light off what stands on it.
    assert found[..., :3].mean() < 0.9 * expected[..., :3].mean()


@pytest.mark.parametrize(
    "ours",
    [AUTOMATIC, PINNED, {"type": "direct_importance"}, {"type": "direct_wavelet"}, {"type": "direct_lights"}],
    ids=lambda ours: str(ours["type"]),
)
def test_the_shadow_of_a_mask(ours: dict[str, Any]) -> None:
    """Opacity 0.3 below a sun of one texel leaves 0.7 of its light."""
    T = mi.ScalarTransform4f
    sun = np.zeros((33, 64, 3), dtype=np.float32)
    sun[3, 20] = 100
    of = described(sun, ("none",))
    of["sky"]["to_world"] = T()
    of["roof"] = {
        "type": "rectangle",
        "to_world": T().translate([0, 9, 0]).rotate([1, 0, 0], 90).scale(90),
        "bsdf": {"type": "mask", "opacity": 0.3, "covers": {"type": "diffuse", "reflectance": 0.0}},
    }
    image = picture(of, ours, 64, background=WHITE)[8:, :, :3]
    assert image.mean() == pytest.approx(0.7, abs=0.02)


@pytest.mark.parametrize(
    ("ours", "everywhere", "open_"),
    [(PINNED, 0.5, 0.1), pytest.param(AUTOMATIC, 1.0, 0.8, marks=pytest.mark.slow)],
    ids=["pinned", "automatic"],
)
def test_what_is_blocked_has_less_noise_than_what_gets_through(
    ours: dict[str, Any], everywhere: float, open_: float
) -> None:
    """Against the same share from a white ground, and where hardly anything is in the way.

    The variance is 0.40 and 0.05 of that with the paper's scheme. The automatic estimator has little noise there at
    all, and most of its samples are where shadows end: 0.88 and 0.67.
    """
    catcher, plain = described(), described()
    plain["floor"]["bsdf"] = {"type": "diffuse", "reflectance": 1.0}
    share = runs(mi.load_dict(catcher), {**ours, "catcher": "floor", "background": WHITE}, 16, 16, 0)[..., :3]
    light = runs(mi.load_dict(plain), ours, 16, 16, 0)[..., :3]
    clear = runs(mi.load_dict({**plain, "ball": _away(), "box": _away()}), ours, 256, 4, 0)[..., :3]
    light /= clear.mean(axis=0)
    ground = only_ground()
    known, usual = (x.var(axis=0, ddof=1).mean(axis=2) for x in (share, light))
    assert known[ground].mean() < everywhere * usual[ground].mean()
    free = ground & (share.mean(axis=(0, 3)) > 0.95)
    assert 0 < known[free].mean() < open_ * usual[free].mean()
    assert share.mean(axis=0)[ground].mean() == pytest.approx(light.mean(axis=0)[ground].mean(), abs=0.01)


def _away() -> dict[str, Any]:
    return {"type": "sphere", "center": [0, -1000, 0]}


def only_ground() -> NDArray[np.bool_]:
    """Pixels that show the ground and nothing that stands on it."""
    of = described()
    del of["floor"]
    alone = mi.render(mi.load_dict(of), integrator=mi.load_dict({**PINNED, "background": "none"}), spp=64).numpy()
    ground: NDArray[np.bool_] = alone[..., 3] == 0
    ground[:5] = False  # the horizon is above
    return ground


def test_shadows_get_samples_where_they_are_alpha_alone(launches: list[Any]) -> None:
    of = described(only=("ball",))
    image = picture(of, AUTOMATIC, 64, background="none")
    pixels = np.concatenate([launch.pixel.numpy() for launch in launches])
    counts = np.bincount(pixels, minlength=18 * 12).reshape(12, 18)
    ground = image[..., :3].max(axis=2) == 0
    shadow, clear = ground & (image[..., 3] > 0.2), ground & (image[..., 3] < 0.01)
    assert counts[shadow].mean() > 1.5 * counts[clear].mean()


def test_another_map_is_another_light() -> None:
    """What is known of a map is not kept for the next one."""
    of = described(only=("ball",))
    scene, integrator = mi.load_dict(of), mi.load_dict({**AUTOMATIC, "catcher": "floor", "background": WHITE})
    first = mi.render(scene, integrator=integrator, spp=16, seed=1).numpy()
    params = mi.traverse(scene)
    params["sky.data"] = params["sky.data"] * 3
    params.update()
    second, ground = mi.render(scene, integrator=integrator, spp=16, seed=1).numpy(), only_ground()
    np.testing.assert_allclose(second[ground], first[ground], atol=0.1)
    params["sky.scale"] = 0.0
    params.update()
    np.testing.assert_allclose(mi.render(scene, integrator=integrator, spp=16, seed=1).numpy()[8:, :4], 1, rtol=1e-5)


def test_what_it_is_lit_by_is_the_sum_over_its_side() -> None:
    """π over ∫ L cos dω, wherever the map and the ground are turned to; one cache finds it each time."""
    from stratalux.integrators.catcher import CatcherCache  # of the active variant

    cache, T = CatcherCache("floor"), mi.ScalarTransform4f
    steps = 512
    k = np.arange(2 * steps * steps)
    cosine, φ = (k // (2 * steps) + 0.5) / steps, np.pi / steps * (k % (2 * steps) + 0.5)
    sine = np.sqrt(1 - cosine**2)
    local = mi.Vector3f(np.stack([np.cos(φ) * sine, np.sin(φ) * sine, cosine]))
    for texels, scale, angle, turned in (
        (hall_map(), 0.5, 0, 37),
        (hall_map(), 0.5, 80, 37),
        (hall_map(), 2.0, 80, -100),
        (hall_map() * np.float32([1, 1, 0]), 0.5, 0, 37),
    ):
        of = described(texels)
        of["floor"]["to_world"] = T().rotate([1, 0, 0], -90 + angle).rotate([0, 1, 0], 20).scale(6)
        of["sky"] |= {"scale": scale, "to_world": T().rotate([0, 1, 0], turned).rotate([1, 0, 0], -28)}
        lit = mi.load_dict(of)
        light = mi.load_dict(PINNED).prepare(lit)
        catcher = cache.get(lit, light)
        floor = next(shape for shape in lit.shapes() if shape.id() == "floor")
        n = floor.sample_position(0.0, mi.Point2f(0.5)).n
        d = mi.Frame3f(n).to_world(local)
        L = light.radiance_towards(d, dr.zeros(mi.SurfaceInteraction3f), mi.Bool(True)).numpy().astype(np.float64)
        E = 2 * np.pi * (L * cosine).mean(axis=1)
        expected = np.divide(np.pi, E, out=np.zeros(3), where=E > 0)
        np.testing.assert_allclose(catcher.weight.numpy().ravel(), expected, rtol=2e-3)


@pytest.mark.parametrize("count", [8, 9])
def test_a_few_names_are_told(count: int) -> None:
    of = described()
    del of["ball"], of["box"]
    of |= {f"thing{k}": {"type": "sphere", "bsdf": {"type": "diffuse"}} for k in range(count - 1)}
    with pytest.raises((InputError, RuntimeError)) as stop:
        picture(of, PINNED, catcher="ground")
    assert ("…" in str(stop.value) + str(stop.value.__cause__)) == (count > 8)


def test_what_cannot_be_a_catcher() -> None:
    of = described()
    for name, told in (("ground", "no shape of that name; it has"), ("ball", "is not flat")):
        with pytest.raises((InputError, RuntimeError)) as stop:
            picture(of, PINNED, catcher=name)
        assert told in str(stop.value) + str(stop.value.__cause__)
    del of["sky"]
    with pytest.raises((InputError, RuntimeError)) as stop:
        picture(of, PINNED)
    assert "no environment map" in str(stop.value) + str(stop.value.__cause__)
    mi.set_variant(SPECTRAL)
    with pytest.raises(InputError, match="RGB"):
        CatcherCache("floor")
    with pytest.raises(RuntimeError, match="a picture has RGB colours"):
        mi.load_dict({**PINNED, "background": {"type": "bitmap", "bitmap": mi.Bitmap(np.ones((2, 2, 3), np.float32))}})


def test_no_derivatives() -> None:
    of = mi.load_dict(described())
    params = mi.traverse(of)
    integrator = mi.load_dict({**AUTOMATIC, "catcher": "floor"})
    with pytest.raises(InputError, match="no derivatives with a catcher"):
        integrator.render_backward(of, params, dr.ones(mi.TensorXf, (12, 18, 4)), 0, 0, 1)
