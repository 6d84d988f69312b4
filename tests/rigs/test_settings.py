"""What a rig may be made of."""

from __future__ import annotations

import pytest

from stratalux import EnvironmentMap, InputError
from stratalux.rigs import RIGS
from stratalux.rigs.fitted import fitted
from stratalux.rigs.making import make_lights
from stratalux.rigs.quality import quality
from stratalux.rigs.settings import AMBIENTS, METHODS, RigSettings
from tests.rigs.maps import MAPS
from tests.rigs.test_fitted import disk_map


def test_all_techniques_are_named() -> None:
    assert (*RIGS, "fitted") == METHODS
    for ambient in AMBIENTS:
        fitted(EnvironmentMap(MAPS["constant"]), 1, ambient=ambient)


@pytest.mark.parametrize("method", METHODS)
def test_lights_are_made_and_measured(method: str) -> None:
    environment = EnvironmentMap(MAPS["hall"])
    lights, cells = make_lights(environment, RigSettings("hall.exr", method=method, lights=3))
    assert (cells is None) == (method == "fitted")
    assert (lights.method, lights.map, lights.ambient) == (method, "hall.exr", None)
    assert lights.quality == quality(environment, lights)


def test_the_sun_has_a_sky_unless_told_otherwise() -> None:
    environment = EnvironmentMap(disk_map(0.3, 0.25, 3, 64))
    assert make_lights(environment, RigSettings("sun.exr", sun=True))[0].varies
    assert not make_lights(environment, RigSettings("sun.exr", sun=True, ambient="constant"))[0].varies
    assert make_lights(environment, RigSettings("sun.exr", sun=True, ambient="none"))[0].ambient is None


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"method": "voronoi"}, "voronoi"),
        ({"lights": 0}, "too small"),
        ({"ambient": "sh3", "sun": True}, "sh3"),
        ({"ambient": "none"}, "goes with --method fitted or --sun"),
        ({"sun": True, "method": "kmeans"}, "leave --method and -n out"),
        ({"sun": True, "lights": 2}, "leave --method and -n out"),
        ({"env_frame": "maya"}, "maya"),
    ],
)
def test_what_does_not_go_together_is_refused(given: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        RigSettings("map.exr", **given)  # type: ignore[arg-type]
