"""Maps, scenes and statistics that several tests share."""

from __future__ import annotations

import gc
import sys
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from stratalux.assets import Assets
from stratalux.cli import main

ALPHA = 1e-3
"""Significance level of every statistical test, for all of its comparisons together (Šidák). Seeds are fixed."""
PATIENCE = 900.0
"""Seconds after which what has not happened is taken for a hang. No test measures time: a machine may be very busy."""


def asset(name: str) -> Path:
    """A file of real data, by its path in the folder of assets; skips the test where it is missing.

    Files in `models/` are those of nobody's list: they are looked for where the others are.
    """
    assets = Assets()
    if name.startswith("models/"):
        path = next((folder / name for folder in assets.folders if (folder / name).is_file()), None)
    else:
        path = assets.find(name)
    if path is None:
        pytest.skip(f"needs {name}: see stratalux assets")
    return path


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """The exit code of the command line."""
    monkeypatch.setattr(sys, "argv", ["stratalux", *arguments])
    with warnings.catch_warnings(), pytest.raises(SystemExit) as stop:
        warnings.simplefilter("always")  # as in a process of its own, not as in this one
        main()
    return int(stop.value.code or 0)


def sidak(comparisons: int, alpha: float = ALPHA) -> float:
    """Level of one of many comparisons whose family errs with probability ``alpha``."""
    return float(-np.expm1(np.log1p(-alpha) / comparisons))


def sun_map(height: int = 24, width: int = 48) -> NDArray[np.float32]:
    """A dim coloured sky with a sun of 1e5 times its mean in one texel."""
    texels = np.random.default_rng(1).uniform(0.5, 1.5, (height, width, 3)) * [0.4, 0.6, 1.0]
    texels[height // 3, width // 4] = [1e5, 0.9e5, 0.7e5]
    return texels.astype(np.float32)


def hall_map(height: int = 25, width: int = 47) -> NDArray[np.float32]:
    """A dim hall of odd size, partly black; windows of pure colours beside black texels, at a pole and the seam."""
    texels = 0.02 + 0.05 * np.random.default_rng(2).random((height, width, 3))
    texels[height // 2 : height // 2 + 6, 5:20] = 0
    texels[8:11, 10:12] = [30, 2, 1]
    texels[7:10, 30:33] = [1, 4, 40]
    texels[14:15, 24:25] = [0, 90, 0]
    texels[5:8, [0, width - 1]] = [20, 20, 0]
    texels[0] = [3, 3, 6]
    return texels.astype(np.float32)


MATERIALS: dict[str, dict[str, Any]] = {
    "diffuse": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.7, 0.5, 0.3]}},
    "roughplastic": {"type": "roughplastic", "alpha": 0.2, "diffuse_reflectance": {"type": "rgb", "value": 0.4}},
    "roughconductor": {"type": "roughconductor", "alpha": 0.3, "material": "Cu"},
    "plastic": {"type": "plastic", "diffuse_reflectance": {"type": "rgb", "value": [0.2, 0.4, 0.6]}},
    "mirror": {"type": "conductor"},
}


def scene_dict(
    material: str = "diffuse", texels: NDArray[np.float32] | None = None, size: tuple[int, int] = (18, 12), **more: Any
) -> dict[str, Any]:
    """A ball and a leaning box on a floor under a map that is turned about two axes.

    No two meshes share a BSDF: Mitsuba 3.9 merges those that do, and forgets the rectangle in the bounding box of the
    scene. Its own shadow rays towards a map are as long as that box tells, so they would end before they are blocked.
    """
    T = mi.ScalarTransform4f
    return {
        "type": "scene",
        "ball": {"type": "sphere", "bsdf": MATERIALS[material]},
        "box": {
            "type": "cube",
            "to_world": T().translate([1.4, -0.3, 0.6]).rotate([1, 1, 0], 30).scale(0.5),
            "bsdf": {"type": "diffuse", "reflectance": 0.6},
        },
        "floor": {
            "type": "rectangle",
            "to_world": T().translate([0, -1, 0]).rotate([1, 0, 0], -90).scale(6),
            "bsdf": MATERIALS[material],
        },
        "sky": {
            "type": "envmap",
            "bitmap": mi.Bitmap(hall_map() if texels is None else texels),
            "scale": 0.5,
            "to_world": T().rotate([0, 1, 0], 37).rotate([1, 0, 0], -28),
        },
        "sensor": {
            "type": "perspective",
            "fov": 40,
            "to_world": T().look_at([1, 2, 5], [0.3, -0.2, 0], [0, 1, 0]),
            "sampler": {"type": "independent", "sample_count": 4},
            "film": {
                "type": "hdrfilm",
                "width": size[0],
                "height": size[1],
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
                "component_format": "float32",
            },
        },
        **more,
    }


def runs(scene: mi.Scene, integrator: dict[str, Any] | mi.Integrator, spp: int, count: int, seed: int) -> NDArray[Any]:
    """``count`` independent images (count, H, W, C), float64."""
    gc.collect()  # kernels are compiled for all scenes that live
    if isinstance(integrator, dict):
        integrator = mi.load_dict(integrator)
    images = [np.array(mi.render(scene, integrator=integrator, spp=spp, seed=seed + k)) for k in range(count)]
    return np.stack(images).astype(np.float64)


def set_few(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """Up to so many samples per pixel, the whole light is estimated in one, whatever is there; none are shared."""
    for name in ("FEW", "FEW_MATTE", "FEW_DETAILED", "FEW_IN_THE_SUN"):
        monkeypatch.setattr(f"stratalux.integrators.indirect.whole.{name}", most)
    if most == 0:
        monkeypatch.setattr("stratalux.integrators.indirect.whole.FEW_IN_MANY", 0)
    monkeypatch.setattr("stratalux.integrators.path_stratified.FEW_IN_THE_SUN", most)
    monkeypatch.setattr("stratalux.integrators.indirect.sharing.ENCLOSED", 2)


def lamp() -> dict[str, Any]:
    """An area light above the scene of :func:`scene_dict`."""
    return {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().translate([-1.5, 2, 1.5]).rotate([1, 0, 0], 90).scale(0.4),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [6, 4, 2]}},
    }


def direct(scene: dict[str, Any], spp: int = 1024, **properties: Any) -> NDArray[Any]:
    """Images of a scene by Mitsuba's ``direct``, (32, H, W, C): the other side of a test of the mean.

    Its sampler is Mitsuba's correlated multi-jittered one, which seeds scramble anew. For the same standard error where
    most light is blocked, independent samples take twice the time, and elsewhere up to ten times.
    """
    sampler = {"type": "multijitter", "sample_count": spp}
    scene = {**scene, "sensor": {**scene["sensor"], "sampler": sampler}}
    integrator = {"type": "direct", "emitter_samples": 2, "bsdf_samples": 1, **properties}
    return runs(mi.load_dict(scene), integrator, spp, 32, seed=10_000)


def reference(material: str, *, lit_by_lamp: bool = False) -> NDArray[Any]:
    """:func:`direct` of :func:`scene_dict` in the active variant, made once for all tests."""
    return _reference(mi.variant(), material, lit_by_lamp)


@cache
def _reference(variant: str, material: str, lit_by_lamp: bool) -> NDArray[Any]:
    return direct(scene_dict(material, **({"lamp": lamp()} if lit_by_lamp else {})))


def assert_same_mean(a: NDArray[Any], b: NDArray[Any]) -> None:
    """Welch's t-test of two stacks of independent images, for each pixel and channel and for the mean of each channel.

    The level :data:`ALPHA` holds for all comparisons together. A pixel whose mean is not known to a fifth on both sides
    gets its light from rare events, and no normal statistic judges it; at most one in twenty may be so. Sums in single
    precision are equal to one part in 10⁵: where nearly all samples are alike, that is more than the noise.
    """
    assert np.isfinite(a).all() and np.isfinite(b).all()
    samples = [
        (a.reshape(len(a), -1), b.reshape(len(b), -1)),
        (a.mean(axis=(1, 2)), b.mean(axis=(1, 2))),
    ]
    comparisons = sum(x.shape[1] for x, _ in samples)
    for (x, y), what in zip(samples, ("pixel", "mean"), strict=True):
        constant = (x.var(axis=0) == 0) & (y.var(axis=0) == 0)
        equal = np.isclose(x.mean(axis=0), y.mean(axis=0), rtol=1e-5, atol=1e-7)
        assert equal[constant].all()
        known = np.all([s.std(axis=0, ddof=1) <= 0.2 * np.sqrt(len(s)) * s.mean(axis=0) for s in (x, y)], axis=0)
        tested = known & ~constant
        assert tested.sum() >= 0.95 * (~constant).sum()
        p = np.where(equal[tested], 1, stats.ttest_ind(x[:, tested], y[:, tested], axis=0, equal_var=False).pvalue)
        if p.size:
            worst = int(np.argmin(p))
            left, right = x.mean(axis=0)[tested][worst], y.mean(axis=0)[tested][worst]
            assert p[worst] > sidak(comparisons), f"{what} {worst}: {left:.6g} against {right:.6g}, p = {p[worst]:.2g}"
