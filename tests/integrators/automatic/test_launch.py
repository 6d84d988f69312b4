"""A launch is traced once and replayed; what has changed in between is followed."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import stratalux
from tests.helpers import scene_dict
from tests.variants import BACKEND

OURS = {"type": "direct_stratified"}


def map_of(height: int, width: int, seed: int) -> mi.TensorXf:
    """The texels of an ``envmap`` as it stores them, with its first column repeated at both ends."""
    texels = np.random.default_rng(seed).uniform(0.2, 2, (height, width, 3)).astype(np.float32)
    return mi.TensorXf(np.concatenate([texels[:, -1:], texels, texels[:, :1]], axis=1))


CHANGES: dict[str, dict[str, Any]] = {
    "values": {"sky.data": lambda: map_of(24, 48, 1)},
    "shape, not size": {"sky.data": lambda: map_of(50, 22, 1)},
    "size": {"sky.data": lambda: map_of(12, 20, 1)},
    "scale": {"sky.scale": lambda: 2.5},
    "rotation": {"sky.to_world": lambda: mi.Transform4f().rotate([0, 1, 0], 70)},
    "camera": {"sensor.to_world": lambda: mi.Transform4f().look_at([2, 3, 5], [0, 0, 0], [0, 1, 0])},
    "near clip": {"sensor.near_clip": lambda: 6.0},
    "film": {"sensor.film.size": lambda: [20, 12]},
    "material": {"ball.bsdf.reflectance.value": lambda: mi.Color3f(0.9, 0.1, 0.3)},
    "geometry": {"ball.to_world": lambda: mi.Transform4f().translate([0.4, 0.3, 0])},
}


@pytest.mark.parametrize("change", CHANGES)
def test_changes_between_renders(change: str) -> None:
    scene = mi.load_dict(scene_dict("diffuse"))
    params = mi.traverse(scene)
    params["sky.data"] = map_of(24, 48, 0)
    params.update()
    integrator = mi.load_dict(OURS)
    before = mi.render(scene, integrator=integrator, spp=4, seed=1).numpy()
    for name, value in CHANGES[change].items():
        params[name] = value()
    params.update()
    after = mi.render(scene, integrator=integrator, spp=4, seed=1).numpy()
    anew = mi.render(scene, integrator=mi.load_dict(OURS), spp=4, seed=1).numpy()
    np.testing.assert_allclose(after, anew, rtol=1e-4, atol=1e-5)
    assert before.shape != after.shape or np.abs(before - after).max() > 1e-2


def test_scenes_and_sensors_take_turns() -> None:
    integrator = mi.load_dict(OURS)
    scenes = [mi.load_dict(scene_dict(material)) for material in ("diffuse", "roughconductor")]
    first = [mi.render(scene, integrator=integrator, spp=4, seed=1).numpy() for scene in scenes]
    again = [mi.render(scene, integrator=integrator, spp=4, seed=1).numpy() for scene in scenes]
    np.testing.assert_allclose(first, again, rtol=1e-4, atol=1e-5)
    assert np.abs(first[0] - first[1]).max() > 1e-2


def test_what_others_leave_in_a_sampler_is_not_handed_on() -> None:
    """It would be copied at every replay: here 13,824 lanes of state."""
    scene = mi.load_dict(scene_dict("diffuse"))
    sampler = scene.sensors()[0].sampler()
    mi.load_dict({"type": "direct"}).render(scene, spp=64)
    assert sampler.wavefront_size() == 64 * 18 * 12
    mi.render(scene, integrator=mi.load_dict(OURS), spp=4)
    assert sampler.wavefront_size() == 1
    stratalux.render(scene, technique="direct", spp=4)
    assert sampler.wavefront_size() == 1


@pytest.mark.parametrize("room", [18 * 12 * 16, 18 * 12 * 4])
def test_a_pilot_shares_samples_of_the_map_only_if_all_launches_do(
    room: int, launches: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else what neighbours have in common would tell of the pixel's own error, and choose its samples by it."""
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", room)
    mi.render(mi.load_dict(scene_dict("diffuse")), integrator=mi.load_dict(OURS), spp=16)
    pilot, *later = (None if launch.shared is None else launch.shared.index for launch in launches)
    if len(later) == 1:
        assert later == [pilot] != [None]
    else:
        assert pilot is None
        assert None not in later
        assert len(set(later)) == len(later) > 1


def test_a_scene_that_cannot_be_recorded() -> None:
    """One without shapes; the renders that follow are as good as any."""
    description = scene_dict("diffuse")
    empty = {name: part for name, part in description.items() if name not in ("ball", "box", "floor")}
    integrator = mi.load_dict(OURS)
    bare, scene = mi.load_dict(empty), mi.load_dict(description)
    direct = mi.render(bare, integrator=mi.load_dict({"type": "direct"}), spp=64).numpy()
    for seed in (1, 2):
        assert mi.render(bare, integrator=integrator, spp=16, seed=seed).numpy().mean() == pytest.approx(
            direct.mean(), rel=0.02
        )
    image = mi.render(scene, integrator=integrator, spp=4, seed=1).numpy()
    anew = mi.render(scene, integrator=mi.load_dict(OURS), spp=4, seed=1).numpy()
    np.testing.assert_allclose(image, anew, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("spp", [1, 8])
def test_alpha_knows_nothing_of_the_variate(spp: int) -> None:
    description = scene_dict("diffuse")
    description["sensor"]["film"]["pixel_format"] = "rgba"
    alpha = mi.render(mi.load_dict(description), integrator=mi.load_dict(OURS), spp=spp).numpy()[..., 3]
    assert alpha.min() >= 0 and alpha.max() == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("kind", ["perspective", "thinlens"])
def test_camera_samples_are_spread_over_pixels_lens_and_shutter(kind: str) -> None:
    from stratalux.integrators.automatic.launch import Launch, camera_samples  # of the active variant

    moving = {"type": kind, "shutter_open": 2.0, "shutter_close": 6.0}
    lens = {"aperture_radius": 0.5, "focus_distance": 3.0} if kind == "thinlens" else {}
    film = {"type": "hdrfilm", "width": 3, "height": 2}
    sensor = mi.load_dict({**moving, **lens, "film": film})
    pixel = np.repeat(np.arange(6, dtype=np.uint32), 256)
    index = np.tile(np.arange(256, dtype=np.uint32), 6)
    launch = Launch(mi.UInt32(pixel), mi.UInt32(index), mi.UInt32(1), mi.Float(0), None, None, None, None)
    _, ray, importance, place = camera_samples(sensor, mi.UInt32(3), mi.Vector2f(3, 2), launch)
    x, y = place.numpy() - [pixel % 3, pixel // 3]
    time = (np.broadcast_to(ray.time.numpy(), pixel.shape) - 2) / 4
    parts = [x, y, time]
    if lens:
        o = sensor.world_transform().inverse() @ ray.o
        r, φ = np.hypot(o.x.numpy(), o.y.numpy()) / 0.5, np.arctan2(o.y.numpy(), o.x.numpy())
        parts += [r**2, np.mod(φ / (2 * np.pi), 1)]
        np.testing.assert_allclose(importance.numpy(), 1)
    for part in parts:
        for k in range(6):  # evenly in each pixel, but for what 256 points cannot tell
            even = (np.arange(256) + 0.5) / 256
            np.testing.assert_allclose(np.sort(part[pixel == k]), even, atol=0.05)


@pytest.mark.parametrize("found", [True, False])
def test_a_bsdf_that_belongs_to_no_scene(found: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """It makes no difference: it is found, so launches are recorded, or what was counted until then is counted anew."""
    launch = "stratalux.integrators.automatic.launch"
    if not found:
        monkeypatch.setattr(f"{launch}.living_bsdfs", list)
    scene = mi.load_dict(scene_dict("diffuse"))
    alone = mi.render(scene, integrator=mi.load_dict(OURS), spp=16, seed=1).numpy()
    stray, integrator = mi.load_dict({"type": "roughplastic"}), mi.load_dict(OURS)
    beside = mi.render(scene, integrator=integrator, spp=16, seed=1).numpy()
    del stray
    # With one more kind of BSDF, a GPU's compiler may round elsewhere.
    np.testing.assert_allclose(beside, alone, rtol=0 if BACKEND == "llvm" else 1e-5)
    (launcher,) = integrator._launchers.values()
    assert (launcher._recorded[launcher._samples] != launcher._samples) == found
