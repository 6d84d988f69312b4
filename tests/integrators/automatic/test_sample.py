"""What is prepared for a scene, and when anew."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from stratalux import EnvironmentMap
from tests.helpers import scene_dict


def test_the_mean_of_the_map_as_it_shines() -> None:
    """Luminance, times the scale that the scene gives it: 0.5."""
    texels = np.full((16, 32, 3), [0.2, 0.6, 1.0], dtype=np.float32)
    light = mi.load_dict({"type": "direct_stratified"}).prepare(mi.load_dict(scene_dict("diffuse", texels)))
    luminance = EnvironmentMap(texels).texels[0, 0] @ [0.212671, 0.715160, 0.072169]
    assert light.mean == pytest.approx(0.5 * luminance, rel=1e-3)


def test_samples_are_shared_out_anew_for_another_scene_and_another_map() -> None:
    scene, other = (mi.load_dict(scene_dict("diffuse")) for _ in range(2))
    integrator = mi.load_dict({"type": "direct_stratified"})
    first = integrator.prepare(scene).allocation
    assert integrator.prepare(scene).allocation is first
    second = integrator.prepare(other).allocation
    assert second is not first
    params = mi.traverse(other)
    params["sky.data"] = mi.TensorXf(np.ones(params["sky.data"].shape, dtype=np.float32))
    params.update()
    assert integrator.prepare(other).allocation is not second
