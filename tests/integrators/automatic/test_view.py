"""How a budget is divided into launches, and what becomes of their sums."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import scene_dict
from tests.variants import MONO, RGB, SPECTRAL


def test_a_pilot_is_a_power_of_two_of_a_small_part() -> None:
    from stratalux.integrators.automatic.view import pilot_samples  # of the active variant

    expected = {1: 1, 2: 1, 8: 1, 15: 1, 16: 2, 31: 2, 32: 4, 64: 8, 100: 8, 1024: 128}
    assert {spp: pilot_samples(spp) for spp in expected} == expected


def view(width: int, height: int) -> Any:
    from stratalux.integrators.automatic.view import View

    film = mi.load_dict({"type": "hdrfilm", "width": width, "height": height})
    sensor = SimpleNamespace(film=lambda: film)
    return View(SimpleNamespace(sensor=sensor), None)


@pytest.mark.parametrize(("room", "launches"), [(6_100, 1), (5_000, 5), (500, 16)])
def test_launches_go_over_all_samples_once(room: int, launches: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each over the whole image; where there are several, the first is small, and none is larger than there is room."""
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", room)
    monkeypatch.setattr("stratalux.integrators.automatic.view.LARGEST", 1)
    counts = np.random.default_rng(1).integers(0, 21, 600).astype(np.int64)
    total = int(counts.sum())
    assert 5_000 < total <= 6_100
    before = np.zeros(600, dtype=np.int64)
    sizes = []
    for start, end in view(30, 20).launches(counts):
        np.testing.assert_array_equal(start, before)
        assert (end >= start).all() and (end <= counts).all()
        sizes.append(int((end - start).sum()))
        # Every pixel has the same part of its samples, but for one of them.
        assert np.abs(end - counts * (end.sum() / total)).max() <= 1
        before = end
    np.testing.assert_array_equal(before, counts)
    assert len(sizes) == launches and max(sizes) <= 1.1 * room
    if launches > 1:
        assert np.abs(np.array(sizes[:3]) - np.array([1, 1, 2]) * room / 8).max() < 20
    assert list(view(30, 20).launches(np.zeros(600, dtype=np.int64))) == []


def test_large_films_have_large_launches(monkeypatch: pytest.MonkeyPatch) -> None:
    """One sample of each pixel, as long as these are not too many."""
    from stratalux.integrators.automatic.view import room

    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", 100)
    assert [room(pixels) for pixels in (1, 100, 150, 800, 1000)] == [100, 100, 150, 800, 800]
    sizes = [int((end - start).sum()) for start, end in view(30, 20).launches(np.full(600, 4, dtype=np.int64))]
    assert sum(sizes) == 2400 and 500 < max(sizes) <= 660 and view(30, 20).at_once(1) and not view(30, 20).at_once(2)


@pytest.mark.parametrize("rest", [0, 1, 7])
def test_each_launch_of_a_pilot_has_something_to_do(rest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """However little is left for the last one."""
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", 592 - 8 * rest)
    monkeypatch.setattr("stratalux.integrators.automatic.view.LARGEST", 1)
    sizes = [int((end - start).sum()) for start, end in view(30, 20).launches(np.full(600, 8, dtype=np.int64))]
    assert sum(sizes) == 4800 and min(sizes) > 0


def test_samples_are_numbered_within_their_pixels() -> None:
    asked: list[Any] = []

    def samples(launch: Any) -> tuple[Any, ...]:
        asked.append(launch)
        return mi.Spectrum(0), mi.Spectrum(0), mi.Bool(True), mi.Point2f(0)

    some = view(3, 2)
    some.launcher.samples = samples
    first, number = np.array([5, 0, 1, 0, 7, 2]), np.array([2, 0, 1, 3, 0, 1])
    lanes = some.samples(first, number, mi.UInt32(1), mi.Float([10, 11, 12, 13, 14, 15]), None)
    assert lanes.pixel.numpy().tolist() == [0, 0, 2, 3, 3, 3, 5]
    assert lanes.index.numpy().tolist() == [5, 6, 1, 0, 1, 2, 2]
    (launch,) = asked
    assert launch.expected.numpy().tolist() == [10, 10, 12, 13, 13, 13, 15] and launch.detailed is None
    some.samples(first, number, mi.UInt32(1), mi.Float(3), None)
    assert asked[1].expected.numpy().tolist() == [3]


def test_later_samples_are_weighted_by_their_number() -> None:
    from stratalux.integrators.automatic.view import combined
    from stratalux.integrators.sums import normalised

    pilot = np.full((1, 3, 4), 1.0, dtype=np.float32)
    later = np.full((1, 3, 4), 5.0, dtype=np.float32)
    later[..., -1] = [1, 1, 0]  # the last pixel has none
    counts = np.array([[2, 6, 9]])
    np.testing.assert_allclose(combined(pilot, later, 2, counts)[..., 0], [[3, 4, 1]])
    np.testing.assert_array_equal(normalised(np.array([[[6.0, 3.0], [2.0, 0.0]]])), [[[2, 1], [0, 0]]])


@pytest.mark.parametrize(("rfilter", "alpha"), [("box", None), ("gaussian", None), ("box", 0.4)])
def test_parts_of_a_pilot_are_means_of_their_samples(
    rfilter: str, alpha: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where alpha is a share, errors are looked for over a grey picture."""
    from stratalux.integrators.automatic.view import Pilot

    def samples(launch: Any) -> tuple[Any, ...]:
        value = mi.Float(launch.pixel) + 10 * mi.Float(launch.index)
        place = mi.Point2f(mi.Float(launch.pixel % 3) + 0.5, mi.Float(launch.pixel // 3) + 0.5)
        covered = mi.Bool(True) if alpha is None else mi.Float(alpha)
        taken = mi.Color3f(value, 2 * value, 3 * value), mi.Color3f(-value, value, 2 * value), covered, place
        return (*taken, mi.Float(launch.pixel + launch.index)) if rfilter == "box" else taken

    film = mi.load_dict({"type": "hdrfilm", "width": 3, "height": 2, "rfilter": {"type": rfilter}})
    film.prepare([])
    some = view(3, 2)
    some.film, some.launcher.samples = film, samples
    seen: list[Any] = []
    plan = "stratalux.integrators.automatic.view.plan_samples"
    monkeypatch.setattr(plan, lambda *arguments: seen.append(arguments))
    pilot = Pilot(some, 8, 4, None, mi.UInt32(0), 0.5, 0.25, varied=True)
    assert len(pilot.launches) == 1
    pilot.add(pilot.launch(0))
    pilot.plan(16)
    (values, difference, dim, budget, least, footprint, marks, costs), pixel = seen[0], np.arange(6).reshape(2, 3)
    assert (dim, marks) == (0.5, ())
    assert [cost.numpy().tolist() for cost in costs] == ([[28, 36, 44, 52, 60, 68]] if rfilter == "box" else [])
    # With a filter, each sample counts in several pixels, and each of these needs later ones.
    assert (budget, least, footprint) == ((16, 8, 0) if rfilter == "box" else (16, 16, 2))
    expected = pixel + 10 * (2 * np.arange(4)[:, None, None] + 0.5)  # two samples in each part
    behind = 0 if alpha is None else (1 - alpha) * 0.25
    np.testing.assert_allclose(values.numpy(), [c * expected + behind for c in (1, 2, 3)], rtol=1e-6)
    np.testing.assert_allclose(difference.numpy(), [c * expected for c in (-1, 1, 2)], rtol=1e-6)
    if rfilter == "box":
        image = pilot.image(np.full((2, 3), 0.5, dtype=np.float32))
        for channel, factor in enumerate((0.5, 2.5, 4)):
            np.testing.assert_allclose(image[..., channel], factor * expected.mean(axis=0), rtol=1e-5)
        np.testing.assert_allclose(image[..., -1], 1, rtol=1e-5)


@pytest.mark.parametrize("rfilter", ["box", "gaussian"])
@pytest.mark.parametrize("crop", [{}, {"crop_width": 3, "crop_height": 2, "crop_offset_x": 2, "crop_offset_y": 1}])
def test_samples_are_put_where_they_are(rfilter: str, crop: dict[str, int]) -> None:
    film = mi.load_dict({"type": "hdrfilm", "width": 6, "height": 4, "rfilter": {"type": rfilter}, **crop})
    film.prepare([])
    some = view(6, 4)
    some.film = film
    some.width, some.height = (int(side) for side in film.crop_size())
    some.pixels = some.width * some.height
    rng = np.random.default_rng(1)
    pixel = mi.UInt32(np.repeat(np.arange(some.width * some.height), 3).astype(np.uint32))
    row, column = pixel // some.width, pixel % some.width
    inside = mi.Point2f(rng.random((2, len(pixel))).astype(np.float32))
    place = mi.Point2f(mi.Float(column), mi.Float(row)) + inside
    value, alpha, weight = mi.Spectrum(mi.Float(rng.random(len(pixel)))), mi.Bool(rng.random(len(pixel)) < 0.5), 0.25
    lanes = SimpleNamespace(pixel=pixel, place=mi.Point2f(place))
    image = some.put(lanes, value, alpha, mi.Float(np.full(len(pixel), weight)), 3)
    block = film.create_block()
    offset = mi.Vector2f(film.crop_offset())
    block.put(place + offset, [], value * weight, dr.select(alpha, mi.Float(weight), 0), mi.Float(weight))
    np.testing.assert_allclose(image, block.tensor().numpy(), rtol=2e-4, atol=1e-6)  # it reads its filter off a table
    np.testing.assert_allclose(lanes.place.numpy(), place.numpy())


@pytest.mark.parametrize(
    ("change", "adapts"),
    [
        ({}, True),
        ({"sensor": {"type": "radiancemeter"}}, False),
        ({"sensor": {"type": "orthographic"}}, True),
        ({"sample_border": True}, False),
        ({"variant": SPECTRAL}, False),
        ({"variant": MONO}, True),
        ({"sky": {"type": "constant"}}, False),
    ],
)
def test_what_it_adapts_to(change: dict[str, Any], adapts: bool) -> None:
    mi.set_variant(change.pop("variant", RGB))
    description = scene_dict()
    if "sample_border" in change:
        description["sensor"]["film"]["sample_border"] = True
    elif "sensor" in change:
        film = description["sensor"]["film"]
        if change["sensor"]["type"] == "radiancemeter":
            film.update(width=1, height=1)
        description["sensor"] = {**change["sensor"], "film": film}
    else:
        description |= change
    scene = mi.load_dict(description)
    assert mi.load_dict({"type": "direct_stratified"}).adapts_to(scene, scene.sensors()[0]) == adapts


def test_what_is_dim_is_so_beside_the_map_as_it_shines(launches: list[Any]) -> None:
    from stratalux.integrators.automatic.lobes import DIM

    texels = np.full((8, 16, 3), 0.8, dtype=np.float32)
    scene = mi.load_dict(scene_dict("diffuse", texels))  # at half of its brightness
    mi.render(scene, integrator=mi.load_dict({"type": "direct_stratified"}), spp=32)
    pilot, *later = launches
    assert pilot.expected.numpy() == pytest.approx(DIM * 0.8 * 0.5, rel=1e-4)
    assert later and min(launch.expected.numpy().min() for launch in later) >= DIM * 0.8 * 0.5 * 0.999
