"""What is seen behind everything: pictures that are known exactly."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import InputError
from stratalux.integrators.backdrop import film_position
from tests.helpers import hall_map, lamp, scene_dict

AUTOMATIC = {"type": "direct_stratified"}
PINNED = {"type": "direct_stratified", "strata": 4}
both = pytest.mark.parametrize("ours", [AUTOMATIC, PINNED], ids=["automatic", "pinned"])
COLOUR = {"type": "constant", "radiance": {"type": "rgb", "value": [0.25, 0.5, 2.0]}}


def scene(sensor: dict[str, Any] | None = None, **more: Any) -> mi.Scene:
    """A ball and a box, beside which much of nothing is seen, in pixels of 8 camera samples."""
    described = scene_dict(**more)
    del described["floor"]
    described["sensor"]["film"]["pixel_format"] = "rgba"
    described["sensor"] |= sensor or {}
    return mi.load_dict(described)


def picture(of: mi.Scene, ours: dict[str, Any], **properties: Any) -> NDArray[Any]:
    return mi.render(of, integrator=mi.load_dict({**ours, **properties}), spp=16, seed=1).numpy()


@both
def test_only_what_is_behind_changes(ours: dict[str, Any]) -> None:
    """With nothing behind, colours are premultiplied, and the other pictures follow: B = N + (1 − alpha) background."""
    of = scene(lamp=lamp())
    none = picture(of, ours, background="none")
    alpha = none[..., 3:]
    assert alpha[0, 0] == 0 and np.all(none[alpha[..., 0] == 0] == 0) and (alpha > 0.99).any()
    seen = (alpha > 0) & (alpha < 0.99)
    assert seen.any()
    colour = picture(of, ours, background=COLOUR)
    # The automatic estimator's samples of a pixel follow from its picture, but not where all of a pixel is alike.
    tolerance = {"rtol": 1e-4, "atol": 1e-5} if ours is PINNED else {"rtol": 0.3, "atol": 0.3}
    np.testing.assert_allclose(colour[..., :3], none[..., :3] + (1 - alpha) * [0.25, 0.5, 2], **tolerance)
    np.testing.assert_allclose(colour[0, 0], [0.25, 0.5, 2, 1], rtol=1e-5)
    assert np.all(colour[..., 3] > 0.999)
    given = picture(of, ours, background={"type": "rgb", "value": [0.25, 0.5, 2.0]})
    np.testing.assert_allclose(given, colour, rtol=1e-4, atol=1e-5)


@both
def test_another_map(ours: dict[str, Any]) -> None:
    """The scene's own map, given once more, is what it is without; hidden emitters are those of the scene."""
    T = mi.ScalarTransform4f
    again = {
        "type": "envmap",
        "bitmap": mi.Bitmap(hall_map()),
        "scale": 0.5,
        "to_world": T().rotate([0, 1, 0], 37).rotate([1, 0, 0], -28),
    }
    of = scene()
    expected = picture(of, ours)
    np.testing.assert_allclose(picture(of, ours, background=again), expected, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(picture(of, ours, background=again, hide_emitters=True), expected, rtol=1e-4, atol=1e-5)


def test_a_number_is_a_grey() -> None:
    integrator = mi.load_dict({**PINNED, "background": 0.25})
    assert mi.traverse(integrator.background)["radiance.value"].numpy().ravel() == pytest.approx(0.25)


def test_lamps_stay_in_front() -> None:
    of = scene(lamp=lamp(), size=(24, 16), sensor={"to_world": _towards_the_lamp()})
    seen, hidden = (picture(of, PINNED, background="none", hide_emitters=hide) for hide in (False, True))
    assert seen[8, 12, 3] == pytest.approx(1) and seen[8, 12, :3] == pytest.approx([6, 4, 2])
    assert hidden[8, 12].tolist() == [0, 0, 0, 0]


def _towards_the_lamp() -> Any:
    return mi.ScalarTransform4f().look_at([-1.5, 0.5, 1.5], [-1.5, 2, 1.5], [0, 0, 1])


SENSORS: dict[str, dict[str, Any]] = {
    "perspective": {"principal_point_offset_x": 0.1},
    "thinlens": {"type": "thinlens", "aperture_radius": 0.3, "focus_distance": 4.0},
    "orthographic": {"type": "orthographic", "to_world": None},
}


@pytest.mark.parametrize("name", SENSORS)
def test_a_ray_knows_its_place(name: str) -> None:
    """Of a window of the film; rays of a lens go through any place of it."""
    window = {"crop_offset_x": 3, "crop_offset_y": 2, "crop_width": 8, "crop_height": 6}
    T = mi.ScalarTransform4f
    described = {"type": "perspective", **SENSORS[name], "to_world": T().look_at([1, 2, 5], [0, 0, 0], [0, 1, 0])}
    if name == "orthographic":
        described["to_world"] = described["to_world"] @ T().scale([3, 3, 1])
    sensor = mi.load_dict({**described, "film": {"type": "hdrfilm", "width": 18, "height": 12, **window}})
    u = np.random.default_rng(0).random((4, 100)).astype(np.float32)
    ray, _ = sensor.sample_ray(0.0, 0.0, mi.Point2f(u[0], u[1]), mi.Point2f(u[2], u[3]))
    found = film_position(sensor, ray).numpy()
    np.testing.assert_allclose(found, [(3 + 8 * u[0]) / 18, (2 + 6 * u[1]) / 12], atol=1e-4)


@both
def test_a_plate_lies_over_the_film(ours: dict[str, Any]) -> None:
    """Each pixel shows its own texel, row by row, wherever the camera is."""
    texels = np.random.default_rng(5).random((12, 18, 3)).astype(np.float32) * 3
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(texels), "raw": True, "filter_type": "nearest"}
    sensors = mi.load_dict({"type": "scene", **scene_dict()}).sensors()
    empty = mi.load_dict({k: v for k, v in scene_dict().items() if k in ("type", "sky", "sensor")} | {"far": far()})
    assert len(sensors) == 1
    np.testing.assert_allclose(picture(empty, ours, background=texture), texels, rtol=1e-3, atol=1e-4)
    of = scene()
    none, plate = picture(of, ours, background="none"), picture(of, ours, background=texture)
    clear = none[..., 3] == 0
    assert clear.any() and not clear.all()
    np.testing.assert_allclose(plate[clear][:, :3], texels[clear], rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(plate[..., 3], 1, rtol=1e-5)


def far() -> dict[str, Any]:
    """Something that no ray of the camera meets."""
    return {"type": "sphere", "center": [0, 100, 100]}


def test_a_plate_is_seen_through_a_mask() -> None:
    white = {"type": "bitmap", "bitmap": mi.Bitmap(np.full((4, 4, 3), 0.8, np.float32)), "raw": True}
    front = {
        "type": "sphere",
        "center": [1, 2, 5],
        "radius": 0.5,
        "bsdf": {"type": "mask", "opacity": 0.5, "covers": {"type": "diffuse", "reflectance": 0.0}},
    }
    of = mi.load_dict({k: v for k, v in scene_dict().items() if k in ("type", "sky", "sensor")} | {"front": front})
    assert picture(of, PINNED, background=white)[..., :3].mean() == pytest.approx(0.4, abs=0.03)


def test_the_next_background_is_not_the_last_one() -> None:
    """One integrator keeps what it has recorded, and its background may be changed in between."""
    of = scene()
    integrator = mi.load_dict({**AUTOMATIC, "background": COLOUR})
    corner = mi.render(of, integrator=integrator, spp=4).numpy()[0, 0, :3]
    np.testing.assert_allclose(corner, [0.25, 0.5, 2.0], rtol=1e-5)
    params = mi.traverse(integrator.background)
    params["radiance.value"] = mi.Color3f(1, 2, 3)
    params.update()
    np.testing.assert_allclose(mi.render(of, integrator=integrator, spp=4).numpy()[0, 0, :3], [1, 2, 3], rtol=1e-5)


@pytest.mark.parametrize(
    ("background", "told"),
    [
        ("sky", "background: 'sky' is unknown; use map, none"),
        ({"type": "point", "intensity": 1.0}, "background: a PointLight is not all around"),
        ({"type": "area", "radiance": 1.0}, "background: a AreaLight is not all around"),
        (True, "background: True is none"),
    ],
)
def test_what_cannot_be_a_background(background: Any, told: str) -> None:
    with pytest.raises((InputError, RuntimeError), match=told):
        mi.load_dict({**AUTOMATIC, "background": background})


def test_pictures_need_a_camera_that_they_fit() -> None:
    sensor = {"type": "radiancemeter", "film": {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}}}
    of = mi.load_dict({**{k: v for k, v in scene_dict().items() if k != "sensor"}, "sensor": sensor})
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(np.ones((2, 2, 3), np.float32))}
    with pytest.raises((InputError, RuntimeError)) as stop:
        mi.render(of, integrator=mi.load_dict({**PINNED, "background": texture}), spp=1)
    told, cause = str(stop.value), stop.value.__cause__
    assert "a picture needs a camera that it fits" in told + str(cause)
