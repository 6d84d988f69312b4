"""The light that falls onto an object, against known values."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from stratalux.scenes.metering import incident_light
from tests.variants import MONO, RGB, SPECTRAL

BLACK = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
GREEN = [0.0, 2.0, 0.0]
EVEN = {"type": "constant", "radiance": {"type": "rgb", "value": 2.0}}


def metered(**things: Any) -> float:
    """Of a black square that faces the eye."""
    sensor = {
        "type": "perspective",
        "to_world": mi.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0]),
        "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}},
    }
    square = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(3), "bsdf": BLACK}
    scene = mi.load_dict({"type": "scene", "sensor": sensor, "square": square, **things})
    return incident_light(scene, scene.sensors()[0], np.ones((8, 8), dtype=bool))


def distant(slope: float, irradiance: Any) -> dict[str, Any]:
    return {"type": "directional", "direction": [slope, 0, -1], "irradiance": {"type": "rgb", "value": irradiance}}


@pytest.mark.parametrize("variant", [RGB, MONO, SPECTRAL])
def test_an_even_light_is_what_white_shows(variant: str) -> None:
    mi.set_variant(variant)
    assert metered(even=EVEN) == pytest.approx(2, rel=0.03)


def test_a_distant_light_counts_by_its_angle() -> None:
    assert metered(lamp=distant(0, 3.0)) == pytest.approx(3 / np.pi, rel=1e-3)
    assert metered(lamp=distant(1, 3.0)) == pytest.approx(3 / np.pi / np.sqrt(2), rel=1e-3)
    assert metered(lamp=distant(0, GREEN)) == pytest.approx(0.7152 * 2 / np.pi, rel=1e-3)


def test_the_side_that_is_seen_counts() -> None:
    turned = mi.ScalarTransform4f().rotate([0, 1, 0], 180).scale(3)
    front = metered(lamp=distant(0, 3.0), square={"type": "rectangle", "to_world": turned, "bsdf": BLACK})
    assert front == pytest.approx(3 / np.pi, rel=1e-3)
    behind = {**distant(0, 3.0), "direction": [0, 0, 1]}
    assert metered(lamp=behind) == 0


def test_what_is_in_the_way_casts_its_shadow() -> None:
    place = mi.ScalarTransform4f().translate([0, 0, 6]).scale(9)  # behind the eye
    assert metered(lamp=distant(0, 3.0), wall={"type": "rectangle", "to_world": place}) == 0


def test_where_nothing_is_or_shines_it_is_dark() -> None:
    assert metered() == 0
    away = mi.ScalarTransform4f().translate([0, 0, 50])
    assert metered(even=EVEN, square={"type": "rectangle", "to_world": away, "bsdf": BLACK}) == 0
