"""Where paths share what they find, and on what surfaces."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from stratalux.integrators.kinds import made_of
from tests.helpers import scene_dict
from tests.variants import RGB

mi.set_variant(RGB)

WHITE = {"type": "diffuse", "reflectance": 0.8}


@pytest.mark.parametrize(
    ("bsdf", "matte"),
    [
        (WHITE, True),
        ({"type": "twosided", "of": WHITE}, True),
        ({"type": "twosided", "of": WHITE, "other": {"type": "roughplastic"}}, False),
        ({"type": "roughplastic"}, False),
        ({"type": "twosided", "of": {"type": "bumpmap", "b": {"type": "checkerboard"}, "of": WHITE}}, False),
        ({"type": "mask", "opacity": 0.5, "of": WHITE}, False),
    ],
)
def test_what_is_matte(bsdf: dict[str, Any], matte: bool) -> None:
    from stratalux.integrators.indirect.sharing import MATTE  # of the active variant

    assert made_of(mi.load_dict(bsdf), MATTE) is matte


def launcher(description: dict[str, Any]) -> Any:
    """That of a scene, before a picture of it."""
    scene = mi.load_dict(description)
    integrator = mi.load_dict({"type": "path_stratified"})
    integrator._parts(scene, scene.sensors()[0], 0, 4, {})
    return integrator._launchers["paths"]


def box(bsdf: dict[str, Any], size: float = 10.0) -> dict[str, Any]:
    """A closed one around the camera."""
    described = scene_dict()
    turned = {"type": "cube", "flip_normals": True, "to_world": mi.ScalarTransform4f().scale(size), "bsdf": bsdf}
    return {name: described[name] for name in ("type", "sky", "sensor")} | {"box": turned}


@pytest.mark.parametrize(
    ("description", "expected"),
    [
        (box(WHITE), True),
        (box({"type": "roughplastic"}), False),
        (box({"type": "mask", "opacity": 0.9, "of": {"type": "twosided", "of": WHITE}}), False),
        (scene_dict(), False),
        ({name: scene_dict()[name] for name in ("type", "sky", "sensor")}, False),
    ],
)
def test_where_it_is_enclosed(description: dict[str, Any], expected: bool) -> None:
    assert launcher(description).enclosed() is expected


def lit() -> mi.Scene:
    """A box whose walls shine."""
    described = box({"type": "diffuse", "reflectance": 0.5})
    described["box"]["emitter"] = {"type": "area", "radiance": 1.0}
    return mi.load_dict(described)


def test_light_that_is_alike_everywhere() -> None:
    image = np.array(mi.render(lit(), integrator=mi.load_dict({"type": "path_stratified", "max_depth": 3}), spp=16))
    np.testing.assert_allclose(image.mean(), 1 + 0.5 + 0.25, rtol=0.01)


def test_the_same_seed_gives_the_same_bits() -> None:
    scene = lit()
    images = [
        mi.render(scene, integrator=mi.load_dict({"type": "path_stratified"}), spp=4, seed=5).numpy() for _ in range(2)
    ]
    np.testing.assert_array_equal(*images)
    assert images[0].mean() > 1.5


@pytest.mark.parametrize("description", [box(WHITE), scene_dict("roughplastic")], ids=["room", "open"])
def test_whatever_is_launched_is_recorded(description: dict[str, Any]) -> None:
    """Where Dr.Jit does not record something, it is traced anew for every launch, which takes as long as small ones."""
    scene = mi.load_dict(description)
    integrator = mi.load_dict({"type": "path_stratified", "max_depth": 4})
    for spp in (2, 64):
        mi.render(scene, integrator=integrator, spp=spp)
    functions = [pair for launcher in integrator._launchers.values() for pair in launcher._recorded.items()]
    assert len(functions) > 8 and all(function != replayed for function, replayed in functions)
