"""A pilot, and what follows it: here, launch by launch, or in any other order."""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from types import SimpleNamespace
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from stratalux.integrators.launches import Arrays, Launch, here, together
from tests.helpers import scene_dict
from tests.variants import RGB

mi.set_variant(RGB)


@pytest.mark.parametrize("varied", [False, True])
@pytest.mark.parametrize("room", [100, 12])
def test_later_samples_follow_those_of_the_pilot(room: int, varied: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The image is the mean of all, and its alpha as well, whether they come at once or in parts."""
    from stratalux.integrators.automatic.stages import TwoStages  # of the active variant
    from stratalux.integrators.automatic.view import View

    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", room)
    seeds: list[int] = []

    def light_samples(seed: mi.UInt32) -> mi.Float:
        seeds.append(int(seed[0]))
        return mi.Float(len(seeds))

    def samples(launch: Any) -> tuple[Any, ...]:
        assert float(launch.shared[0]) == len(seeds)
        value = mi.Float(launch.pixel) + 10 * mi.Float(launch.index)
        L = mi.Color3f(value, 2 * value, 3 * value)
        return L, -0.5 * L, (launch.index & 1) == 0, mi.Point2f(0)

    film = mi.load_dict(
        {"type": "hdrfilm", "width": 3, "height": 2, "rfilter": {"type": "box"}, "pixel_format": "rgba"}
    )
    film.prepare([])
    sensor = SimpleNamespace(film=lambda: film)
    view = View(SimpleNamespace(sensor=sensor, samples=samples, light_samples=light_samples), None)
    few, counts = 2, np.array([[3, 0, 8], [1, 4, 20]])
    share = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0], dtype=np.float32)
    first = np.full((2, 3, 5), 4.0, dtype=np.float32)
    first[..., 3:] = [0.5, 1]
    memory: dict[str, Any] = {"first": first, "counts": counts + few}
    if varied:
        memory |= {"level": np.zeros(6, np.float32), "share": share, "learned": np.zeros(1, np.float32)}
    stages = TwoStages(view, few, 8, mi.UInt32(5), 0.0, memory, varied=varied)
    passes = list(stages.passes(here))[1:]
    assert len(seeds) == len(set(seeds)) and len(passes) - len(seeds) in (0, 1)  # one launch may have nothing left
    assert (len(passes) > 1) == (room == 12)
    numbers = [spp for _, spp, _ in passes]
    assert numbers == sorted(numbers) and numbers[-1] == pytest.approx(few + counts.mean())
    kept = 1 - 0.5 * share if varied else np.ones(6)
    image = passes[-1][0]
    for pixel, count in enumerate(counts.ravel()):
        index = np.arange(few, few + count)
        values = np.concatenate([[4.0] * few, (pixel + 10 * index) * kept[pixel]])
        row, column = divmod(pixel, 3)
        alpha = np.concatenate([[0.5] * few, index % 2 == 0])
        red, *_, covered, weight = image[row, column]
        assert (red, covered, weight) == pytest.approx((values.mean(), alpha.mean(), 1), rel=1e-5)
        if count:
            green = np.concatenate([[4.0] * few, 2 * values[few:]])
            assert image[row, column, 1] == pytest.approx(green.mean(), rel=1e-5)


def owned(array: np.ndarray) -> bool:
    """Whether its memory is NumPy's, and not that of an array of Dr.Jit's."""
    while isinstance(array.base, np.ndarray):
        array = array.base
    return array.base is None


@pytest.mark.parametrize("plugin", ["direct_stratified", "path_stratified"])
def test_launches_can_be_made_in_any_order(plugin: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """And anywhere, by an integrator that knows but the number, and what its stage begins with."""
    monkeypatch.setattr("stratalux.integrators.automatic.view.LAUNCH", 1500)
    scene, seed, spp = mi.load_dict(scene_dict("roughplastic")), 3, 24
    camera = scene.sensors()[0]
    alone = list(mi.load_dict({"type": plugin}).passes(scene, camera, seed, spp))
    other = mi.load_dict({"type": plugin})
    asked: list[str] = []

    def make(stage: str, known: Any, first: int, count: int, launch: Launch) -> Iterator[tuple[int, Arrays]]:
        asked.append(stage)
        theirs = other.launch(scene, camera, seed, spp, stage, known)
        found = {k: theirs(k) for k in reversed(range(first, count))}
        assert all(map(owned, (*known.values(), *(array for arrays in found.values() for array in arrays.values()))))
        ends = sorted({1, *(first + (count - first) * part // 3 for part in (1, 2, 3))} - {first})
        for begin, end in zip([first, *ends], ends, strict=False):
            yield end, reduce(together, (found[k] for k in range(begin, end)))

    passes = list(mi.load_dict({"type": plugin}).passes(scene, camera, seed, spp, make=make))
    parts = ("direct",) if plugin == "direct_stratified" else ("direct", "paths")
    assert sorted(asked) == sorted(f"{part}/{stage}" for part in parts for stage in ("pilot", "later"))
    assert len(alone) > len(passes) > 3
    np.testing.assert_allclose(passes[-1][0], alone[-1][0], rtol=1e-5, atol=1e-6)
    assert passes[-1][1] == alone[-1][1]
