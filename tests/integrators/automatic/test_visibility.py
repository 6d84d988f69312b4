"""What a pilot's rays tell of visibility."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import scene_dict

PARTS = 64


def sphere(count: int) -> mi.Vector3f:
    u = np.random.default_rng(5).random((2, count)).astype(np.float32)
    return mi.warp.square_to_uniform_sphere(mi.Point2f(u))


def test_parts_divide_the_sphere() -> None:
    """Each of them has its directions, about as many as the others, and not those of the opposite side."""
    from stratalux.integrators.automatic.visibility import _part

    d = sphere(100_000)
    part = _part(d).numpy()
    share = np.bincount(part, minlength=PARTS) / len(part) * PARTS
    assert len(share) == PARTS
    assert share.min() > 0.4
    assert share.max() < 2.5
    middle = np.stack([np.bincount(part, axis) for axis in d.numpy()])
    towards = (middle / np.linalg.norm(middle, axis=0))[:, part]
    assert (towards * d.numpy()).sum(axis=0).min() > np.cos(np.radians(45))
    axes = np.concatenate([np.eye(3), -np.eye(3)]).T
    assert (_part(mi.Vector3f(axes)).numpy() < PARTS).all()


def test_tiles_count_by_themselves() -> None:
    from stratalux.integrators.automatic.visibility import TILE, Visibility

    width, height = 2 * TILE + 3, TILE + 1
    x, y = (mi.UInt32(value) for value in ([0, TILE - 1, TILE, 2 * TILE + 2, 0], [0, TILE - 1, 0, 0, TILE]))
    tile = Visibility.tile(x, y, mi.UInt32(width))
    assert tile.numpy().tolist() == [0, 0, 1, 2, 3]

    counts = Visibility.nothing(width, height)
    d = mi.Vector3f(0, 1, 0.01)
    pupil = Visibility(tile, counts)
    pupil.note(d, mi.Bool([True, False, False, True, False]), mi.Bool([True, True, True, True, False]))
    V, doubt = Visibility(tile, None, Visibility.learn(counts)).expected(d, mi.Bool(True))
    np.testing.assert_allclose(V.numpy(), [0.5, 0.5, 0.75, 0.25, 0.5])
    np.testing.assert_allclose(doubt.numpy(), 2 * np.sqrt(V.numpy() * (1 - V.numpy())), rtol=1e-6)
    elsewhere, most = Visibility(tile, None, Visibility.learn(counts)).expected(-d, mi.Bool(True))
    assert elsewhere.numpy().tolist() == [0.5] * 5
    assert most.numpy().tolist() == [1] * 5


def test_some_doubt_is_left() -> None:
    from stratalux.integrators.automatic.visibility import Visibility

    counts = mi.UInt32([1 << 20] * PARTS), mi.UInt32([1 << 20] * PARTS)
    V, doubt = Visibility(mi.UInt32(0), None, Visibility.learn(counts)).expected(mi.Vector3f(1, 0, 0), mi.Bool(True))
    assert 0.999 < V[0] < 1
    assert doubt[0] == pytest.approx(0.1)
    V, doubt = Visibility(mi.UInt32(0), None).expected(mi.Vector3f(1, 0, 0), mi.Bool(True))
    assert (V[0], doubt[0]) == (0, 1)  # nothing is known


@pytest.mark.parametrize("spp", [1, 16])
def test_only_a_pilot_that_something_follows_learns(spp: int, launches: list[Any]) -> None:
    mi.render(mi.load_dict(scene_dict("diffuse")), integrator=mi.load_dict({"type": "direct_stratified"}), spp=spp)
    pilot, *later = launches
    assert pilot.learned is None
    if spp == 1:
        assert pilot.counts is None
        assert not later
    else:
        assert pilot.counts is not None
        rays, free = (int(dr.sum(counts)[0]) for counts in pilot.counts)
        assert 0 < free < rays
        assert [launch.counts for launch in later] == [None]
        assert later[0].learned is not None
