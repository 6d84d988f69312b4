"""Paths that share what they find: the mean image of Mitsuba's ``path``, whatever is shared and with whom."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.helpers import MATERIALS, assert_same_mean, lamp, runs, scene_dict
from tests.variants import MONO

RUNS = 32
SLOW = pytest.mark.slow


@pytest.fixture(autouse=True)
def _everywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stratalux.integrators.indirect.sharing.ENCLOSED", -1)


def walled(material: str = "diffuse", **more: Any) -> dict[str, Any]:
    """Between three walls, one of which can be seen from one side alone."""
    description = scene_dict(material, lamp=lamp(), **more)
    wall = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.8, 0.7, 0.5]}}
    for k, place in enumerate(([1, 0, 0], [-1, 0, 0], [0, 0, -1])):
        turn = mi.ScalarTransform4f().look_at([3 * x for x in place], [0, 0, 0], [0, 1, 0])
        bsdf = wall if k == 0 else {"type": "twosided", "bsdf": wall}
        description[f"wall{k}"] = {"type": "rectangle", "to_world": turn.scale(3), "bsdf": bsdf}
    return description


def tilted() -> dict[str, Any]:
    """A wall whose normals are tilted so much that who looks at it from the left sees it from behind, so to speak."""
    description = walled()
    corners = np.array([[-2, -1, -1.5], [2, -1, -1.5], [2, 3, -1.5], [-2, 3, -1.5]], dtype=np.float32)
    props = mi.Properties()
    props["bsdf"] = mi.load_dict({"type": "diffuse", "reflectance": 0.8})
    mesh = mi.Mesh("wall", 4, 2, props=props, has_vertex_normals=True)
    params = mi.traverse(mesh)
    params["vertex_positions"] = mi.Float(corners.ravel())
    params["faces"] = mi.UInt32([0, 1, 2, 0, 2, 3])
    params.update()  # makes normals of its own
    params["vertex_normals"] = mi.Float(np.tile(np.float32([0.95, 0, 0.31]), 4))
    params.update()
    return description | {"tilted": mesh}


def screen() -> dict[str, Any]:
    """A thin wall, seen from its edge: what one side of it shows is nothing to who is on the other."""
    description = walled()
    place = mi.ScalarTransform4f().look_at([0.5, 0, 0.5], [5, 0, -0.5], [0, 1, 0])
    white = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": 0.9}}
    del description["ball"]
    return description | {"screen": {"type": "rectangle", "to_world": place.scale(1.5), "bsdf": white}}


def bumps() -> dict[str, Any]:
    """A matte floor that bumps tilt is not matte: what it reflects depends on where it is seen from."""
    heights = mi.Bitmap(np.random.default_rng(3).random((16, 16, 1), dtype=np.float32))
    bumps = {"type": "bitmap", "bitmap": heights, "raw": True}
    description = walled()
    description["floor"]["bsdf"] = {"type": "bumpmap", "scale": 20.0, "bumps": bumps, "of": {"type": "diffuse"}}
    return description


def glass() -> dict[str, Any]:
    description = walled()
    description["ball"]["bsdf"] = {"type": "dielectric"}
    return description


SCENES: dict[str, Callable[[], dict[str, Any]]] = {
    **{name: lambda name=name: walled(name) for name in MATERIALS},
    **{made.__name__: made for made in (tilted, screen, bumps, glass)},
    "open": lambda: scene_dict("roughplastic"),
}


@cache
def reference(variant: str, name: str, depth: int) -> NDArray[Any]:
    description = SCENES[name]()
    description["sensor"]["sampler"] = {"type": "multijitter", "sample_count": 1024}
    return runs(mi.load_dict(description), {"type": "path", "max_depth": depth}, 1024, RUNS, seed=20_000)


CASES = [
    ("diffuse", 3, 16, ()),
    ("diffuse", 8, 16, SLOW),
    ("diffuse", -1, 16, SLOW),
    ("roughplastic", 3, 64, ()),
    ("roughplastic", -1, 64, SLOW),
    ("roughconductor", 8, 128, SLOW),
    ("plastic", 8, 256, SLOW),
    ("mirror", 3, 256, SLOW),
    ("glass", 8, 256, SLOW),
    ("tilted", 3, 64, ()),
    ("tilted", 8, 64, SLOW),
    ("screen", 3, 64, ()),
    ("bumps", 3, 64, SLOW),
    ("open", 8, 64, ()),
]


@pytest.mark.parametrize(("name", "depth", "spp"), [pytest.param(*case, marks=marks) for *case, marks in CASES])
def test_same_mean_as_path(name: str, depth: int, spp: int) -> None:
    ours = runs(mi.load_dict(SCENES[name]()), {"type": "path_stratified", "max_depth": depth}, spp, RUNS, 0)
    assert_same_mean(ours, reference(mi.variant(), name, depth))


def test_launches_cut_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stratalux.integrators.indirect.tiles.ROOM", 24 * 18 + 7)
    ours = runs(mi.load_dict(SCENES["diffuse"]()), {"type": "path_stratified", "max_depth": 3}, 8, RUNS, 0)
    assert_same_mean(ours, reference(mi.variant(), "diffuse", 3))


@SLOW
def test_in_grey() -> None:
    mi.set_variant(MONO)
    ours = runs(mi.load_dict(SCENES["diffuse"]()), {"type": "path_stratified", "max_depth": 8}, 16, RUNS, 0)
    assert_same_mean(ours, reference(MONO, "diffuse", 8))
