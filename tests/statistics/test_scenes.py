"""Kinds of scene that want something else: sensors, curves and hair, lights of no weight, mirrored maps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba as mi
import pytest

from tests.helpers import assert_same_mean, runs, scene_dict

RUNS = 32
SLOW = pytest.mark.slow
AUTOMATIC = {"type": "direct_stratified"}
PINNED = {"type": "direct_stratified", "strata": 16, "bsdf_samples": 1}
DIRECT = {"type": "direct", "emitter_samples": 2, "bsdf_samples": 2}
both = pytest.mark.parametrize("ours", [AUTOMATIC, pytest.param(PINNED, marks=SLOW)], ids=["automatic", "pinned"])


def compare(description: dict[str, Any], ours: dict[str, Any], spp: int = 64, reference_spp: int = 1024) -> None:
    scene = mi.load_dict(description)
    assert_same_mean(runs(scene, ours, spp, RUNS, 0), runs(scene, DIRECT, reference_spp, RUNS, 10_000))


def film(width: int, height: int) -> dict[str, Any]:
    return {
        "type": "hdrfilm",
        "width": width,
        "height": height,
        "rfilter": {"type": "box"},
        "pixel_format": "rgb",
        "component_format": "float32",
    }


def view() -> mi.ScalarTransform4f:
    return mi.ScalarTransform4f().look_at([1, 2, 5], [0.3, -0.2, 0], [0, 1, 0])


def sensor(name: str) -> dict[str, Any]:
    sensors: dict[str, dict[str, Any]] = {
        "radiancemeter": {"origin": [1, 2, 5], "direction": [-0.2, -2.8, -3.5], "film": film(1, 1)},
        "distant": {"direction": [0, -1, -0.5], "film": film(1, 1)},
        "distant, at a point": {"direction": [0, -1, -0.5], "target": [0.4, -1, 1.2], "film": film(1, 1)},
        "irradiancemeter": {"film": film(1, 1)},
        "thinlens": {
            "fov": 40,
            "aperture_radius": 0.2,
            "focus_distance": 5.0,
            "to_world": view(),
            "film": film(18, 12),
        },
        "orthographic": {"to_world": view().scale(2), "film": film(18, 12)},
    }
    return {"type": name.split(",")[0], **sensors[name], "sampler": {"type": "independent", "sample_count": 16}}


@both
@pytest.mark.parametrize(
    "name",
    [
        "radiancemeter",
        "distant, at a point",
        *(pytest.param(name, marks=SLOW) for name in ("distant", "irradiancemeter", "thinlens", "orthographic")),
    ],
)
def test_sensors(name: str, ours: dict[str, Any]) -> None:
    description = scene_dict("roughplastic")
    if name == "irradiancemeter":
        T = mi.ScalarTransform4f
        probe = {
            "type": "rectangle",
            "to_world": T().translate([1, 0.5, 2]).rotate([1, 0, 0], 100).scale(0.3),
            "bsdf": {"type": "diffuse"},
            "sensor": sensor(name),
        }
        del description["sensor"]
        description["probe"] = probe
    else:
        description["sensor"] = sensor(name)
    compare(description, ours, 512 if description.get("sensor", {}).get("type") != "thinlens" else 64, 2048)


def test_sensors_that_are_no_cameras_end_no_process() -> None:
    """One pixel each, of few samples: the kernels have to compile."""
    for name in ("radiancemeter", "distant", "irradiancemeter"):
        description = scene_dict("roughplastic")
        description["sensor"] = sensor(name)
        if name == "irradiancemeter":
            description["ball"]["sensor"] = description.pop("sensor")
        image = mi.render(mi.load_dict(description), integrator=mi.load_dict(AUTOMATIC), spp=4).numpy()
        assert image.shape == (1, 1, 3)
        assert (image > 0).all()


HAIR = {"type": "hair", "eumelanin": 0.3, "pheomelanin": 0.2}


@both
@pytest.mark.parametrize(
    ("ball", "curve"),
    [(HAIR, None), pytest.param(None, HAIR, marks=SLOW), pytest.param(None, {"type": "roughplastic"}, marks=SLOW)],
    ids=["hair", "curves of hair", "curves"],
)
def test_hair_and_curves(
    ball: dict[str, Any] | None, curve: dict[str, Any] | None, ours: dict[str, Any], tmp_path: Path
) -> None:
    description = scene_dict("diffuse")
    if ball:
        description["ball"]["bsdf"] = ball
    if curve:
        path = tmp_path / "curve.txt"
        path.write_text("-1 -.5 .5 .1\n-.4 .2 .8 .1\n.3 .6 .9 .12\n.9 .2 .8 .1\n1.2 -.5 .6 .1\n")
        description["curve"] = {"type": "bsplinecurve", "filename": str(path), "bsdf": curve}
    compare(description, ours)


@both
@pytest.mark.parametrize("material", ["roughplastic", pytest.param("roughconductor", marks=SLOW)])
@pytest.mark.parametrize("signs", [(-1, 1, 1), *(pytest.param(s, marks=SLOW) for s in ((1, 1, -1), (-1, -1, -1)))])
def test_mirrored_maps(signs: tuple[int, int, int], material: str, ours: dict[str, Any]) -> None:
    description = scene_dict(material)
    description["sky"]["to_world"] = mi.ScalarTransform4f().rotate([1, 0, 0], 30).scale(signs)
    compare(description, ours, 256 if material == "roughconductor" else 64)


def lamp(weight: float, x: float = -1.5) -> dict[str, Any]:
    emitter = {"type": "area", "sampling_weight": weight, "radiance": {"type": "rgb", "value": [6, 4, 2]}}
    place = mi.ScalarTransform4f().translate([x, 2, 1.5]).rotate([1, 0, 0], 90).scale(0.8)
    return {"type": "rectangle", "to_world": place, "emitter": emitter}


@both
@pytest.mark.parametrize("others", [False, pytest.param(True, marks=SLOW)])
def test_lights_of_no_sampling_weight(others: bool, ours: dict[str, Any]) -> None:
    """Only BSDF samples find them."""
    more = {"second": lamp(1.0, 1.5)} if others else {}
    compare(scene_dict("diffuse", lamp=lamp(0.0), **more), ours, 256)
