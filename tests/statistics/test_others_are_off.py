"""Known values that Mitsuba's own integrators miss and ours have; should theirs change, docs/correctness.md has to."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.helpers import runs, scene_dict

OURS = [{"type": "direct_stratified"}, {"type": "direct_stratified", "strata": 16, "bsdf_samples": 1}]
ours = pytest.mark.parametrize("integrator", OURS, ids=["automatic", "pinned"])
EVEN = np.ones((16, 32, 3), dtype=np.float32)


def means(scene: mi.Scene, integrator: dict[str, Any]) -> NDArray[np.float64]:
    """Of 16 independent images."""
    return runs(scene, integrator, 64, 16, 0).mean(axis=(1, 2, 3))


def furnace() -> mi.Scene:
    """The middle of a ball, 0.6 of it matte with albedo 0.5 and 0.4 a mirror, in a world that is 1 everywhere."""
    description = scene_dict("diffuse", EVEN, size=(6, 6))
    parts = {"first": {"type": "diffuse", "reflectance": 0.5}, "second": {"type": "conductor"}}
    description["ball"]["bsdf"] = {"type": "blendbsdf", "weight": 0.4, **parts}
    description["sky"]["scale"] = 1.0
    description["sensor"]["to_world"] = mi.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0])
    description["sensor"]["fov"] = 10
    return mi.load_dict({name: part for name, part in description.items() if name not in ("box", "floor")})


@ours
def test_a_blend_of_matte_and_mirror_in_a_furnace(integrator: dict[str, Any]) -> None:
    found = means(furnace(), integrator)
    error = found.std(ddof=1) / np.sqrt(len(found))
    assert error < 0.003
    assert abs(found.mean() - (0.6 * 0.5 + 0.4)) < 4.1 * error  # Student's t with 15 degrees of freedom, 0.001


def test_direct_is_off_there() -> None:
    assert means(furnace(), {"type": "direct"}).mean() == pytest.approx(0.638, abs=0.005)


def closed_room(optimize: bool) -> mi.Scene:
    """A cube in a room of six walls, all of one material: no light gets in."""
    T = mi.ScalarTransform4f
    material = {"type": "ref", "id": "white"}
    description = scene_dict("diffuse", EVEN)
    description["sensor"]["to_world"] = T().look_at([1, 2, 3.5], [0, 0, 0], [0, 1, 0])
    sides = [([1, 0, 0], 90), ([1, 0, 0], -90), ([0, 1, 0], 0), ([0, 1, 0], 90), ([0, 1, 0], 180), ([0, 1, 0], 270)]
    walls = {
        f"wall{k}": {
            "type": "rectangle",
            "to_world": T().rotate(axis, angle).translate([0, 0, -4]).scale(4),
            "bsdf": material,
        }
        for k, (axis, angle) in enumerate(sides)
    }
    white = {"type": "twosided", "id": "white", "bsdf": {"type": "diffuse", "reflectance": 0.6}}
    cube = {"type": "cube", "to_world": T().scale(0.3), "bsdf": material}
    rest = {name: description[name] for name in ("sky", "sensor")}
    return mi.load_dict({"type": "scene", "white": white, "cube": cube, **walls, **rest}, optimize=optimize)


@ours
def test_a_closed_room_is_dark(integrator: dict[str, Any]) -> None:
    """Whether its walls have been merged or not; of the control variate, rounding is left."""
    for optimize in (True, False):
        assert np.abs(means(closed_room(optimize), integrator)).max() < 1e-5


def test_direct_is_off_where_walls_have_been_merged() -> None:
    merged, single = (means(closed_room(optimize), {"type": "direct"}).mean() for optimize in (True, False))
    assert single == 0
    assert merged > 0.003


@pytest.mark.parametrize(("away", "off"), [(100, 0.00014), (600, 0.029), (3000, 0.068)])
def test_balls_are_too_bright_from_afar(away: float, off: float) -> None:
    """So many radii: their density against 1 / solid angle, π / away² where the sine is the angle."""
    ball = mi.load_dict({"type": "sphere", "center": [0, 0, away], "emitter": {"type": "area"}})
    density = float(ball.sample_direction(dr.zeros(mi.Interaction3f), mi.Point2f(0.3, 0.7)).pdf[0])
    assert 1 - density * np.pi / away**2 * (1 + 1 / (4 * away**2)) == pytest.approx(off, rel=0.1)
