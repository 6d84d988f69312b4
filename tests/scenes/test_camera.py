"""Cameras: where a point is in the picture, known by hand; framing from all sides; what cannot be, in one line."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stratalux.errors import InputError, SceneWarning
from stratalux.scenes.camera import LEAST_DISTANCE, MARGIN, camera_frame, own_camera, sensor
from stratalux.scenes.model import Camera
from stratalux.scenes.settings import CameraSettings
from tests.variants import RGB

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (0, 2) for z in (-1, 1)], dtype=float)
SIDEWAYS = np.array([[0, 0, 1, 1], [0, 1, 0, 2], [-1, 0, 0, 3], [0, 0, 0, 1.0]])
"""At (1, 2, 3), looking along -x, with -z to the right."""
POINT = np.array([-3.0, 3.0, 1.0])
"""4 before that camera, 2 to the right and 1 up."""
CAMERA = Camera(SIDEWAYS, "side", fov=np.pi / 2)
WIDE = replace(CAMERA, aspect=2.0)


@pytest.fixture(autouse=True)
def variant() -> Iterator[None]:
    before = mi.variant()
    mi.set_variant(RGB)
    yield
    if before is not None:
        mi.set_variant(before)


def through(one: dict[str, Any], x: float, y: float, lens: tuple[float, float] = (0.5, 0.5)) -> tuple[Any, Any]:
    """Origin and direction of the ray through the point (x, y) of the film, in pixels from its upper left corner."""
    film = one["film"]
    ray, _ = mi.load_dict(one).sample_ray(0, 0.5, mi.Point2f(x / film["width"], y / film["height"]), mi.Point2f(*lens))
    return np.array(ray.o).ravel(), np.array(ray.d).ravel()


def misses(one: dict[str, Any], x: float, y: float, point: Any, lens: tuple[float, float] = (0.5, 0.5)) -> float:
    """How far the ray through (x, y) passes by ``point``."""
    origin, direction = through(one, x, y, lens)
    return float(np.linalg.norm(np.cross(np.asarray(point) - origin, direction)))


def in_picture(one: dict[str, Any], points: Any) -> np.ndarray:
    """Points (N, 3) on the film of a perspective camera: (N, 2) from -1 to 1, right and up."""
    matrix = np.array(one["to_world"].matrix)
    seen = (np.asarray(points) - matrix[:3, 3]) @ matrix[:3, :3]
    assert (seen[:, 2] > 0).all()
    aspect = one["film"]["width"] / one["film"]["height"]
    assert one["fov_axis"] == "smaller"
    half = np.tan(np.radians(one["fov"]) / 2) * np.array([max(1, aspect), max(1, 1 / aspect)])
    return np.array(seen[:, :2] / seen[:, 2:] * [-1, 1] / half)


# ------------------------------- Cameras of a file -------------------------------


@pytest.mark.parametrize(
    ("camera", "size", "pixel"),
    [
        # Of half a height of 4 it is 1 up, and of half a width of 8, 2 to the right.
        (CAMERA, (200, 100), (125, 37.5)),
        (CAMERA, (100, 100), (75, 37.5)),
        (WIDE, (200, 100), (125, 37.5)),
        (WIDE, (300, 100), (175, 37.5)),
        # The width of 16 is kept, and the height is 16, too.
        (WIDE, (100, 100), (62.5, 43.75)),
        (replace(CAMERA, height=6.0), (200, 100), (100 + 100 * 2 / 6, 50 - 50 / 3)),
        (replace(WIDE, height=6.0), (300, 100), (150 + 150 * 2 / 9, 50 - 50 / 3)),
        (replace(WIDE, height=6.0), (100, 100), (50 + 50 * 2 / 6, 50 - 50 / 6)),
    ],
)
def test_a_point_is_where_it_is_by_hand(camera: Camera, size: tuple[int, int], pixel: tuple[float, float]) -> None:
    one = sensor(CameraSettings(), CUBE, [camera], size)
    assert misses(one, *pixel, POINT) < 1e-5
    assert misses(one, pixel[0] + 1, pixel[1], POINT) > 0.02
    if camera.height is not None:  # however far it is
        assert misses(one, *pixel, POINT - [7, 0, 0]) < 1e-5


def test_a_parallel_view_begins_above_the_ground_unless_that_shows_more() -> None:
    down = np.array([[1, 0, 0, 0], [0, 0.8, 0.6, 3], [0, -0.6, 0.8, 4], [0, 0, 0, 1.0]])
    flat = Camera(down, height=20.0)
    origin, direction = through(sensor(CameraSettings(), CUBE, [flat], (20, 20)), 10, 19)
    assert origin[1] > 1 and direction[1] < 0
    # Something is behind it, and is not in the picture of the file either.
    origin, _ = through(sensor(CameraSettings(), [*CUBE, [0, 9, 9]], [flat], (20, 20)), 10, 10)
    np.testing.assert_allclose(origin, [0, 3, 4], atol=0.02)


def test_the_picture_is_not_mirrored_either() -> None:
    one = sensor(CameraSettings(), CUBE, [CAMERA], (40, 20), 16)
    ball = {"type": "sphere", "center": POINT.tolist(), "radius": 0.2, "e": {"type": "area", "radiance": 1.0}}
    image = np.array(mi.render(mi.load_dict({"type": "scene", "ball": ball, "sensor": one, "i": {"type": "direct"}})))
    row, column = np.unravel_index(image[..., 0].argmax(), image.shape[:2])
    assert abs(row + 0.5 - 7.5) <= 1 and abs(column + 0.5 - 25) <= 1


def test_size_samples_and_sampler_are_those_asked_for() -> None:
    one = mi.load_dict(sensor(CameraSettings(), CUBE, (), (30, 20), 9, "stratified"))
    assert tuple(one.film().size()) == (30, 20)
    assert one.sampler().sample_count() == 9 and "Stratified" in one.sampler().class_name()


@pytest.mark.parametrize(
    ("wanted", "index"),
    [("auto", 0), (0, 0), (1, 1), ("2", 2), ("left", 0), ("right", 1), ("3", 3), ("0x", 4)],
)
def test_a_camera_is_chosen_by_name_or_index(wanted: Any, index: int) -> None:
    cameras = [Camera(np.diag([1, 1, 1, 1.0]), name) for name in ("left", "right", "3", "", "0x")]
    for k, camera in enumerate(cameras):
        camera.matrix[2, 3] = 10 + k
    one = sensor(CameraSettings(camera=wanted), CUBE, cameras)
    assert np.array(one["to_world"].matrix)[2, 3] == 10 + index


def test_without_a_camera_of_the_file_the_object_is_framed() -> None:
    framed = sensor(CameraSettings(), CUBE)
    for asked in (CameraSettings(camera="none"), CameraSettings(orbit=(30, 17)), CameraSettings(fov=30)):
        other = sensor(asked, CUBE, [CAMERA])
        np.testing.assert_array_equal(np.array(other["to_world"].matrix), np.array(framed["to_world"].matrix))
        assert other["fov"] == 30 and other["type"] == "perspective"


@pytest.mark.parametrize(
    ("wanted", "names", "message"),
    [
        ("up", ["left", "", "right"], r"camera 'up': there is none; give one of 0 \('left'\), 1, 2 \('right'\)$"),
        ("3", ["left", "", "right"], "camera '3': there is none; give one of 0"),
        ("9" * 5000, ["left"], "there is none"),
        ("a", ["a", "b", "a"], "camera 'a': several are called so; give an index: 0, 2"),
        ("a", [], "camera 'a': the file has none; leave it out, and the object is framed"),
        ("a", ["b"] * 30, r"19 \('b'\) and 10 more$"),
    ],
)
def test_a_camera_that_is_not_there_is_told_with_those_that_are(wanted: str, names: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        sensor(CameraSettings(camera=wanted), CUBE, [Camera(np.eye(4), name) for name in names])
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("row", "column", "value"),
    [(0, 0, -1.0), (1, 1, 2.0), (0, 1, 0.4), (2, 1, 0.4)],
    ids=["mirrored", "scaled", "sheared to the side", "sheared backwards"],
)
def test_a_camera_that_is_not_rigid_is_told_and_looks_the_same_way(row: int, column: int, value: float) -> None:
    change = np.eye(4)
    change[row, column] = value
    with pytest.warns(SceneWarning, match=r"camera 0 \('side'\): its matrix scales, shears or mirrors"):
        one = sensor(CameraSettings(), CUBE, [replace(CAMERA, matrix=SIDEWAYS @ change)], (200, 100))
    matrix = np.array(one["to_world"].matrix)[:3, :3]
    np.testing.assert_allclose(matrix.T @ matrix, np.eye(3), atol=1e-6)
    assert np.linalg.det(matrix) == pytest.approx(1, abs=1e-6)
    assert misses(one, 100, 50, [-5, 2, 3]) < 1e-5
    if change[0, 1] == 0:
        assert misses(one, 125, 37.5, POINT) < 1e-5


def test_a_uniform_scale_is_told_only_where_it_means_something() -> None:
    scaled = replace(CAMERA, matrix=SIDEWAYS @ np.diag([0.01, 0.01, 0.01, 1]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        one = sensor(CameraSettings(), CUBE, [scaled], (200, 100))
    assert misses(one, 125, 37.5, POINT) < 1e-5
    for camera in (replace(scaled, height=6.0), replace(scaled, aperture=0.1)):
        with pytest.warns(SceneWarning, match="scales, shears or mirrors"):
            sensor(CameraSettings(), CUBE, [camera])


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        (replace(CAMERA, matrix=np.zeros((4, 4))), "matrix is not finite or flat"),
        (replace(CAMERA, matrix=np.full((4, 4), np.nan)), "matrix is not finite or flat"),
        (replace(CAMERA, matrix=SIDEWAYS[:, [0, 2, 2, 3]]), "looks along its own up axis"),
        (replace(CAMERA, fov=np.pi), "a field of view of 180 degrees is none"),
        (replace(CAMERA, fov=float("nan")), "a field of view of nan degrees is none"),
        (replace(CAMERA, height=0.0), "sees a height of 0"),
        (replace(CAMERA, aspect=0.0), "an aspect of 0 is none"),
    ],
)
def test_a_camera_that_sees_nothing_is_refused(camera: Camera, message: str) -> None:
    with pytest.raises(InputError, match=r"camera 0 \('side'\): .*" + message):
        sensor(CameraSettings(), CUBE, [camera])


# ------------------------------- Lenses -------------------------------


@pytest.mark.parametrize("camera", [(), (CAMERA,)])
def test_what_is_in_focus_is_sharp_and_the_lens_is_as_large_as_asked_for(camera: Any) -> None:
    one = sensor(CameraSettings(aperture=0.25, focus=3.0), CUBE, camera, (200, 100))
    matrix = np.array(one["to_world"].matrix)
    sharp = matrix[:3, 3] + 3 * matrix[:3, 2]
    lenses = [(0.0, 0.5), (1.0, 0.5), (0.5, 0.0), (0.5, 1.0), (0.2, 0.9)]
    assert max(misses(one, 100, 50, sharp, lens) for lens in lenses) < 1e-4
    assert max(misses(one, 100, 50, sharp + matrix[:3, 2], lens) for lens in lenses) > 0.05
    radii = []
    for lens in lenses:
        origin, direction = through(one, 100, 50, lens)
        origin = origin - direction * ((origin - matrix[:3, 3]) @ matrix[:3, 2]) / (direction @ matrix[:3, 2])
        radii.append(np.linalg.norm(origin - matrix[:3, 3]))
    assert max(radii) == pytest.approx(0.25, abs=1e-3)


def test_the_nearest_point_in_the_picture_is_sharp_by_default() -> None:
    def at(right: float, up: float, depth: float) -> np.ndarray:
        return np.array([1 - depth, 2 + up, 3 - right])

    points = [at(0, 0, 9), at(-3, 0, 7.5), at(0.2, 0.1, 6), at(3.9, 0, 2), at(0, 1.6, 1.5), at(0, 0, -1)]
    lens = CameraSettings(aperture=0.1)
    # Half the width is the depth, at an aspect of 1; twice that, at 2.
    assert sensor(lens, points, [CAMERA], (100, 100))["focus_distance"] == pytest.approx(6)
    assert sensor(lens, points, [CAMERA], (200, 100))["focus_distance"] == pytest.approx(2)
    assert sensor(lens, points[3:4], [CAMERA], (100, 100))["focus_distance"] == pytest.approx(2)
    framed = sensor(lens, CUBE)
    matrix = np.array(framed["to_world"].matrix)
    depths = (CUBE - matrix[:3, 3]) @ matrix[:3, 2]
    assert framed["focus_distance"] == pytest.approx(depths.min(), rel=1e-5)
    # A width of 2 at a distance of 1, in a field of view of 90 degrees along the shorter side.
    from_front = CameraSettings(orbit=(0, 0, 3), look_at=(0, 0, 0), fov=90, aperture=0.1)
    some = [[0, 0, 0], [1.5, 0, 2], [0, 0, 1]]
    for size, distance in (((200, 100), 1), ((100, 200), 2), ((100, 100), 2)):
        assert sensor(from_front, some, (), size)["focus_distance"] == pytest.approx(distance)
    with pytest.raises(InputError, match="focus: nothing of the object is before the camera"):
        sensor(lens, points[-1:], [CAMERA])


def test_a_lens_of_the_file_is_taken_and_may_be_changed() -> None:
    camera = replace(CAMERA, aperture=0.1, focus=2.5)

    def lens(**asked: float) -> tuple[Any, ...]:
        one = sensor(CameraSettings(**asked), CUBE, [camera])
        return one["type"], one.get("aperture_radius"), one.get("focus_distance")

    assert lens() == ("thinlens", 0.1, 2.5)
    assert lens(focus=7.0) == ("thinlens", 0.1, 7.0)
    assert lens(aperture=0.3) == ("thinlens", 0.3, 2.5)
    assert lens(aperture=0.0) == ("perspective", None, None)


def test_lenses_that_cannot_be() -> None:
    flat = replace(CAMERA, height=2.0)
    with pytest.raises(InputError, match=r"aperture: camera 0 \('side'\) is orthographic"):
        sensor(CameraSettings(aperture=0.1), CUBE, [flat])
    with pytest.warns(SceneWarning, match="is orthographic, for which all is sharp; its aperture is left out"):
        assert sensor(CameraSettings(), CUBE, [replace(flat, aperture=0.1)])["type"] == "orthographic"
    with pytest.raises(InputError, match="focus: all is sharp without a lens; give its aperture, too"):
        sensor(CameraSettings(focus=2.0), CUBE, [CAMERA])


# ------------------------------- Around the object -------------------------------


@settings(max_examples=60, deadline=None)
@given(
    azimuth=st.floats(-720, 720),
    elevation=st.floats(-90, 90) | st.sampled_from([-90.0, 90.0, 0.0]),
    fov=st.floats(1, 120),
    aspect=st.floats(0.2, 5),
    seed=st.integers(0, 99),
)
def test_all_is_framed_from_everywhere(azimuth: float, elevation: float, fov: float, aspect: float, seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(20, 3)) * [1, 3, 0.2] + [5, 0, -2]
    frame = camera_frame(points, aspect, azimuth, elevation, fov)
    np.testing.assert_allclose(frame[:3, :3].T @ frame[:3, :3], np.eye(3), atol=1e-12)
    turn, rise = np.radians([azimuth, elevation])
    back = [np.sin(turn) * np.cos(rise), np.sin(rise), np.cos(turn) * np.cos(rise)]
    np.testing.assert_allclose(-frame[:3, 2], back, atol=1e-9)
    assert frame[1, 0] == 0 and frame[1, 1] >= -1e-12  # level, and not upside down
    seen = (points - frame[:3, 3]) @ frame[:3, :3]
    assert (seen[:, 2] > 0).all()
    half = np.tan(np.radians(fov) / 2) * np.array([max(1, aspect), max(1, 1 / aspect)])
    place = seen[:, :2] / seen[:, 2:] / half
    reach = np.abs(place).max(axis=0)
    nearest = LEAST_DISTANCE * np.linalg.norm(np.ptp(points, axis=0))
    if seen[:, 2].min() > nearest * (1 + 1e-9):
        assert reach.max() == pytest.approx(1 - 2 * MARGIN, abs=1e-4)
    assert reach.max() < 1 - 2 * MARGIN + 1e-4 and seen[:, 2].min() > nearest * (1 - 1e-9)
    np.testing.assert_allclose(place.max(axis=0), -place.min(axis=0), atol=1e-4)


@pytest.mark.parametrize("look_at", [None, (0.0, 4.5, 0.0)])
def test_a_needle_that_points_at_the_camera_does_not_touch_it(look_at: Any) -> None:
    needle = np.array([[0, 9, 0], [0.1, 0, 0], [-0.1, 0, 0.1]])
    matrix = np.array(sensor(CameraSettings(orbit=(0, 90), look_at=look_at), needle)["to_world"].matrix)
    assert matrix[1, 3] == pytest.approx(9 + LEAST_DISTANCE * np.linalg.norm(np.ptp(needle, axis=0)), rel=1e-5)


@pytest.mark.parametrize(
    ("orbit", "back", "up"),
    [
        ((0, 0), (0, 0, 1), (0, 1, 0)),
        ((90, 0), (1, 0, 0), (0, 1, 0)),
        ((-90, 0), (-1, 0, 0), (0, 1, 0)),
        ((0, 90), (0, 1, 0), (0, 0, -1)),
        ((90, 90), (0, 1, 0), (-1, 0, 0)),
        ((0, -90), (0, -1, 0), (0, 0, 1)),
    ],
)
def test_where_the_angles_are(orbit: tuple[float, float], back: Any, up: Any) -> None:
    matrix = np.array(sensor(CameraSettings(orbit=orbit), CUBE)["to_world"].matrix)
    np.testing.assert_allclose(matrix[:3, 2], -np.array(back), atol=1e-6)
    np.testing.assert_allclose(matrix[:3, 1], up, atol=1e-6)


@pytest.mark.parametrize("size", [(60, 40), (40, 60)])
def test_a_distance_is_that_from_the_middle(size: tuple[int, int]) -> None:
    framed = np.array(sensor(CameraSettings(orbit=(20, 40)), CUBE, (), size)["to_world"].matrix)
    matrix = np.array(sensor(CameraSettings(orbit=(20, 40, 0.5)), CUBE, (), size)["to_world"].matrix)
    np.testing.assert_allclose(matrix[:3, :3], framed[:3, :3], atol=1e-6)
    assert ([0, 1, 0] - matrix[:3, 3]) @ matrix[:3, 2] == pytest.approx(0.5, abs=1e-5)
    moved = matrix[:3, 3] - framed[:3, 3]
    np.testing.assert_allclose(moved, moved @ framed[:3, 2] * framed[:3, 2], atol=1e-5)


@settings(max_examples=50, deadline=None)
@given(
    target=st.tuples(*[st.floats(-3, 3)] * 3),
    orbit=st.tuples(st.floats(-180, 180), st.floats(-90, 90)),
    wide=st.booleans(),
    fov=st.floats(5, 100),
)
def test_a_point_that_is_looked_at_is_in_the_middle(target: Any, orbit: Any, wide: bool, fov: float) -> None:
    size = (90, 60) if wide else (60, 90)
    asked = CameraSettings(look_at=target, orbit=orbit, fov=fov)
    one = sensor(asked, CUBE, (), size)
    np.testing.assert_allclose(in_picture(one, [target]), 0, atol=2e-2)
    far = sensor(replace(asked, orbit=(*orbit, 25.0)), CUBE, (), size)
    position = np.array(far["to_world"].matrix)[:3, 3]
    assert np.linalg.norm(position - target) == pytest.approx(25, rel=1e-5)


def test_the_object_is_framed_around_a_point_that_is_looked_at() -> None:
    for target in ([0, 1, 0], [0.5, 2, -1], [3, 0, 0]):
        place = np.abs(in_picture(sensor(CameraSettings(look_at=target), CUBE), CUBE))
        assert place.max() == pytest.approx(1 - 2 * MARGIN, abs=1e-4)
    # It stands before the point: the camera still looks at it.
    one = sensor(CameraSettings(look_at=(0, 1, 500), orbit=(0, 0)), CUBE)
    assert np.array(one["to_world"].matrix)[2, 3] > 500


def test_what_is_looked_at_is_where_the_file_says() -> None:
    there, here = (CameraSettings(look_at=point) for point in ((1e7, 0, -5e6), (0, 0, 0)))
    wanted = np.array(sensor(here, CUBE)["to_world"].matrix)
    np.testing.assert_array_equal(np.array(sensor(there, CUBE, origin=(1e7, 0, -5e6))["to_world"].matrix), wanted)


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1, 1e3, 1e6])
def test_neither_small_nor_large_scenes_are_cut_off(scale: float) -> None:
    one = sensor(CameraSettings(), CUBE * scale)
    matrix = np.array(one["to_world"].matrix)
    depths = (CUBE * scale - matrix[:3, 3]) @ matrix[:3, 2]
    assert one["near_clip"] < depths.min() / 10 and one["far_clip"] > 100 * depths.max()


# ------------------------------- Scenes of Mitsuba -------------------------------


def test_scenes_of_mitsuba_bring_their_own() -> None:
    film = {"type": "hdrfilm", "width": 4, "height": 4}
    left, right = ({"type": "perspective", "fov": fov, "film": film} for fov in (30, 40))
    scene = mi.load_dict({"type": "scene", "left": left, "right": right})
    for wanted, index in (("auto", 0), (0, 0), (1, 1), ("left", 0), ("right", 1)):
        assert own_camera(CameraSettings(camera=wanted), scene) == index
    for asked, message in (
        ({"camera": 2}, r"camera '2': there is none; give one of 0 \('left'\), 1 \('right'\)"),
        ({"camera": "none"}, "camera none: a Mitsuba scene is seen through its own cameras"),
        ({"orbit": (0, 0)}, "orbit: a Mitsuba scene brings its own cameras"),
        ({"look_at": (0, 0, 0)}, "look-at: a Mitsuba scene brings its own cameras"),
        ({"fov": 20}, "fov: a Mitsuba scene"),
        ({"camera": 1, "aperture": 0.1}, "aperture: a Mitsuba scene"),
        ({"focus": 1}, "focus: a Mitsuba scene"),
    ):
        with pytest.raises(InputError, match=message):
            own_camera(CameraSettings(**asked), scene)
