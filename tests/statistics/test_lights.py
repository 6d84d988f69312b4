"""Directional lights: what they converge to, and what jitter does."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux import EnvironmentMap, InputError
from stratalux.rigs import RIGS, light_rig
from tests.helpers import runs, scene_dict
from tests.variants import MONO, RGB, SPECTRAL


def smooth_map() -> NDArray[np.float32]:
    """Broad lobes of light, which a few directional lights can stand for."""
    y, x = np.mgrid[0:33, 0:64]
    lobe = np.exp(-((x - 20) ** 2 + (y - 10) ** 2) / 40)[..., None] * [6, 5, 3]
    return (0.2 + lobe + np.exp(-((x - 50) ** 2 + (y - 14) ** 2) / 60)[..., None] * [1, 2, 4]).astype(np.float32)


@pytest.fixture(scope="module")
def scene() -> mi.Scene:
    mi.set_variant(RGB)
    return mi.load_dict(scene_dict("diffuse", smooth_map()))


@pytest.fixture(scope="module")
def reference(scene: mi.Scene) -> NDArray[np.float64]:
    return runs(scene, {"type": "direct", "hide_emitters": True}, 4096, 4, 0).mean(axis=0)


def error(scene: mi.Scene, reference: NDArray[np.float64], **properties: object) -> float:
    integrator = {"type": "direct_lights", "hide_emitters": True, **properties}
    image = runs(scene, integrator, 64, 2, 5).mean(axis=0)
    return float(np.sqrt(((image - reference) ** 2).mean()) / reference.mean())


@pytest.mark.parametrize("rig", list(RIGS))
def test_error_falls_with_the_number_of_lights(scene: mi.Scene, reference: NDArray[np.float64], rig: str) -> None:
    few, some, many = (error(scene, reference, rig=rig, lights=n) for n in (2, 16, 256))
    assert many < 0.5 * few and many < some < few
    assert many < 0.05


def test_without_jitter_a_bias_stays(scene: mi.Scene, reference: NDArray[np.float64]) -> None:
    """Averaging over seeds removes noise, not the bands of the shadows."""
    integrator = {"type": "direct_lights", "lights": 4, "hide_emitters": True}
    once, many = (np.sqrt(((runs(scene, integrator, 64, n, 1).mean(axis=0) - reference) ** 2).mean()) for n in (1, 8))
    assert many > 0.9 * once


def test_jitter_changes_with_the_seed_and_keeps_the_energy(scene: mi.Scene) -> None:
    """A ball that only the light reaches: jitter moves the lights, and its mean stays near."""
    still, moved = (
        runs(scene, {"type": "direct_lights", "lights": 16, "jitter": jitter, "hide_emitters": True}, 64, 8, 1)
        for jitter in (False, True)
    )
    assert moved.std(axis=0).mean() > 1.5 * still.std(axis=0).mean()
    assert moved.mean() == pytest.approx(still.mean(), rel=0.1)


def test_scale_and_rotation_are_followed(scene: mi.Scene, reference: NDArray[np.float64]) -> None:
    params = mi.traverse(scene)
    params["sky.scale"] = 1.0
    params.update()
    bright = runs(scene, {"type": "direct_lights", "lights": 256, "hide_emitters": True}, 64, 2, 5).mean(axis=0)
    params["sky.scale"] = 0.5
    params.update()
    np.testing.assert_allclose(bright.mean(), 2 * reference.mean(), rtol=0.03)


def test_the_light_of_one_light_is_the_light_of_the_map() -> None:
    environment = EnvironmentMap.from_array(smooth_map())
    total = environment.cell_energy.sum()
    for rig in RIGS:
        colour = light_rig(rig, environment, 16).total_colour
        assert colour @ [0.212671, 0.715160, 0.072169] == pytest.approx(total, rel=1e-5)


def test_mono_renders_and_spectral_is_refused() -> None:
    mi.set_variant(MONO)
    scene = mi.load_dict(scene_dict("diffuse", smooth_map()))
    ours = runs(scene, {"type": "direct_lights", "lights": 256}, 16, 2, 0).mean()
    assert ours == pytest.approx(runs(scene, {"type": "direct"}, 1024, 2, 0).mean(), rel=0.02)
    mi.set_variant(SPECTRAL)
    with pytest.raises((RuntimeError, InputError), match="RGB or monochromatic"):
        mi.load_dict({"type": "direct_lights"})
