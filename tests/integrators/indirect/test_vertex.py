"""How many samples of the map stand behind a ray towards it."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from tests.helpers import scene_dict

SHINY = {"type": "roughconductor", "alpha": 0.05}


@pytest.mark.parametrize(("detailed", "bsdf", "expected"), [
    (True, SHINY, 16), (False, SHINY, 4), (True, {"type": "diffuse"}, 4), (True, {"type": "roughplastic"}, 4)
])  # fmt: skip
def test_more_where_narrow_lobes_see_detail(detailed: bool, bsdf: dict[str, object], expected: int) -> None:
    from stratalux.integrators.indirect.vertex import VertexLight  # of the active variant
    from stratalux.integrators.other_emitters import OtherEmitters

    texels = np.ones((64, 128, 3), dtype=np.float32)
    if detailed:
        texels[np.random.default_rng(1).random((64, 128)) < 0.05] = 200
    description = scene_dict("diffuse", texels)
    description["ball"]["bsdf"] = bsdf
    scene = mi.load_dict(description)
    light = mi.load_dict({"type": "direct_stratified"}).prepare(scene)
    at = next(shape for shape in scene.shapes() if shape.id() == "ball")
    arriving = VertexLight(scene, scene, OtherEmitters(scene, True), light, None)
    shape, bsdf = (
        dr.gather(kind, kind(one), mi.UInt32(0)) for kind, one in ((mi.ShapePtr, at), (mi.BSDFPtr, at.bsdf()))
    )
    M = arriving.proposals(shape, bsdf, mi.Bool(True))
    assert M.numpy().tolist() == [expected]


def test_no_map_no_matter() -> None:
    from stratalux.integrators.indirect.vertex import PROPOSALS, VertexLight
    from stratalux.integrators.other_emitters import OtherEmitters

    scene = mi.load_dict(scene_dict("diffuse"))
    arriving = VertexLight(scene, scene, OtherEmitters(scene, False), None, None)
    assert arriving.proposals(mi.ShapePtr(), mi.BSDFPtr(), mi.Bool(True)).numpy().tolist() == [PROPOSALS]
