"""``direct_wavelet``: its directions against their pdf, and its mean image against that of Mitsuba's ``direct``."""

from __future__ import annotations

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from stratalux.sampling.equal_area import direction_to_square, square_to_direction
from tests.helpers import (
    ALPHA,
    MATERIALS,
    assert_same_mean,
    direct,
    hall_map,
    lamp,
    runs,
    scene_dict,
    sidak,
    sun_map,
)
from tests.variants import MONO, SPECTRAL

RUNS = 24
SAMPLES = 200_000
SIZE = (12, 8)
"""Fewer and larger pixels than elsewhere: where next to nothing of the sky is visible, a sample in thousands makes the
pixel, and the means of a run would be far from normal."""


def wavelet(samples: int = 16, **more: Any) -> dict[str, Any]:
    return {"type": "direct_wavelet", "samples": samples, **more}


def black_half() -> NDArray[np.float32]:
    texels = hall_map(24, 48)
    texels[:, 24:] = 0
    return texels


# ------------------------------ The density ------------------------------


def product(material: str, texels: NDArray[np.float32], normal: tuple[float, ...], towards: float, **more: Any) -> Any:
    """The density of one shading point with that normal, seen at ``towards`` degrees from it."""
    # Reloaded with every variant, and so are the types of what it holds.
    from stratalux.integrators.direct_wavelet import Product

    light = mi.load_dict(wavelet(**more)).prepare(mi.load_dict(scene_dict("diffuse", texels)))
    si, angle = dr.zeros(mi.SurfaceInteraction3f), np.radians(towards)
    si.sh_frame = mi.Frame3f(dr.normalize(mi.Vector3f(normal)))
    si.n = si.sh_frame.n
    si.wi = mi.Vector3f([float(np.sin(angle)), 0, float(np.cos(angle))])
    return Product(light, si, mi.load_dict(MATERIALS[material]), True), light.tables.resolution


def chi_square(p: Any, resolution: int, tilt: float = 0) -> tuple[float, float]:
    """p-value, and the integral of the pdf; ``tilt`` falsifies the pdf by that part in every other texel."""
    u = mi.Point2d(np.random.default_rng(7).random((2, SAMPLES)))
    drawn = p.sample(u)
    # Sample and density say the same, but where single precision takes a direction into the next texel.
    again = p.pdf(drawn.d).numpy()
    assert (np.abs(again / drawn.pdf.numpy() - 1) < 1e-3).mean() > 0.999

    at = dr.minimum(mi.Point2u(direction_to_square(drawn.d) * resolution), resolution - 1)
    observed = np.bincount((at.y * resolution + at.x).numpy(), minlength=resolution**2)
    i, j = np.mgrid[0:resolution, 0:resolution].reshape(2, -1)
    centres = square_to_direction(mi.Point2f((np.stack([j, i]) + 0.5).astype(np.float32) / resolution))
    mass = p.pdf(centres).numpy().astype(np.float64) * 4 * np.pi / resolution**2
    total = float(mass.sum())
    expected = SAMPLES * mass * np.where((i + j) % 2, 1 + tilt, 1 - tilt) / total
    small = expected < 5
    bins = np.append(expected[~small], expected[small].sum()), np.append(observed[~small], observed[small].sum())
    expected, observed = (b[bins[0] >= 5] for b in bins)
    statistic = ((observed - expected) ** 2 / expected).sum()
    return float(stats.chi2.sf(statistic, len(expected) - 1)), total


CONFIGURATIONS: dict[str, tuple[Any, ...]] = {
    "diffuse": ("diffuse", hall_map, (0.2, 1, -0.3), 40, 16),
    "plastic": ("roughplastic", hall_map, (-1, 0.1, 0.2), 60, 16),
    "metal, grazing": ("roughconductor", hall_map, (0, 0.3, 1), 85, 16),
    "metal, seen from behind": ("roughconductor", hall_map, (0, 0.3, 1), 110, 16),
    "8x8": ("roughconductor", hall_map, (1, 0.3, 1), 30, 8),
    "32x32": ("roughplastic", hall_map, (1, -0.3, 1), 30, 32),
    "sun": ("diffuse", sun_map, (0, 1, 0), 40, 16),
    "black half": ("roughplastic", black_half, (0.5, -1, 0.4), 20, 16),
}


@pytest.mark.parametrize(
    "name", [n if n != "32x32" else pytest.param(n, marks=pytest.mark.slow) for n in CONFIGURATIONS]
)
def test_directions_follow_the_pdf(name: str) -> None:
    material, texels, normal, towards, resolution = CONFIGURATIONS[name]
    p_value, total = chi_square(*product(material, texels(), normal, towards, resolution=resolution))
    assert total == pytest.approx(1, rel=1e-4)
    assert p_value > sidak(len(CONFIGURATIONS))


def test_chi_square_has_teeth() -> None:
    """A density that is wrong by 5 % is rejected."""
    p_value, _ = chi_square(*product("roughplastic", hall_map(), (-1, 0.1, 0.2), 60), tilt=0.05)
    assert p_value < ALPHA


def test_density_follows_the_product() -> None:
    """It is the product that decides, but the floor keeps every direction possible, below the horizon too."""
    p, _ = product("diffuse", np.ones((24, 48, 3), dtype=np.float32), (0, 1, 0), 40)
    drawn = p.sample(mi.Point2d(np.random.default_rng(8).random((2, SAMPLES))))
    # The map of the scene is turned by 28° and 37°; the normal in its frame:
    T = mi.ScalarTransform4f().rotate([0, 1, 0], 37).rotate([1, 0, 0], -28)
    normal = np.asarray(T.inverse().matrix)[:3, :3] @ [0, 1, 0]
    cosine = normal @ drawn.d.numpy()
    floor = 0.2 / 1.2
    assert (cosine < 0).mean() == pytest.approx(floor / 2, abs=0.03)
    assert np.mean(cosine[cosine > 0]) == pytest.approx(2 / 3, abs=0.03)
    assert drawn.pdf.numpy().min() == pytest.approx(floor / (4 * np.pi), rel=1e-3)


def test_a_black_product_leaves_the_map() -> None:
    """Where the BSDF is black in the middle of every cell, samples follow the map alone."""
    p, _ = product("roughconductor", np.ones((24, 48, 3), dtype=np.float32), (0, 1, 0), 110)
    drawn = p.sample(mi.Point2d(np.random.default_rng(9).random((2, 1000))))
    np.testing.assert_allclose(drawn.pdf.numpy(), 1 / (4 * np.pi), rtol=1e-4)


# ----------------------------- The mean image -----------------------------


def small_scene(material: str, texels: NDArray[np.float32] | None = None, **more: Any) -> mi.Scene:
    return mi.load_dict(scene_dict(material, texels, SIZE, **more))


@cache
def reference(material: str) -> NDArray[Any]:
    return small_direct(material)


def small_direct(material: str, texels: NDArray[np.float32] | None = None, **more: Any) -> NDArray[Any]:
    return direct(scene_dict(material, texels, SIZE, **more), 512)


@pytest.mark.parametrize(
    ("material", "samples", "resolution", "spp"),
    [
        ("roughplastic", 16, 16, 128),
        *(pytest.param(material, 16, 16, 128, marks=pytest.mark.slow) for material in ("diffuse", "roughconductor")),
        *(
            pytest.param(material, 1, 8, 512, marks=pytest.mark.slow)
            for material in ("diffuse", "roughplastic", "roughconductor")
        ),
    ],
)
def test_same_mean_as_direct(material: str, samples: int, resolution: int, spp: int) -> None:
    ours = wavelet(samples, resolution=resolution)
    assert_same_mean(runs(small_scene(material), ours, spp, RUNS, seed=0), reference(material))


@pytest.mark.slow
def test_a_fine_product() -> None:
    ours = wavelet(7, resolution=32)
    assert_same_mean(runs(small_scene("roughconductor"), ours, 64, RUNS, seed=0), reference("roughconductor"))


def test_the_test_has_teeth() -> None:
    """Light that is 1 % too bright in one channel is noticed."""
    images = runs(small_scene("diffuse"), wavelet(16), 128, RUNS, seed=0)
    images[..., 2] *= 1.01
    with pytest.raises(AssertionError):
        assert_same_mean(images, reference("diffuse"))


@pytest.mark.parametrize(
    "texels", [sun_map, pytest.param(black_half, marks=pytest.mark.slow)], ids=["sun", "black half"]
)
def test_difficult_maps(texels: Any) -> None:
    scene = small_scene("roughplastic", texels())
    assert_same_mean(runs(scene, wavelet(16), 128, RUNS, 0), small_direct("roughplastic", texels()))


@pytest.mark.slow
def test_with_an_area_light_and_delta_lobes() -> None:
    scene = small_scene("plastic", lamp=lamp())
    assert_same_mean(runs(scene, wavelet(16), 128, RUNS, 0), small_direct("plastic", lamp=lamp()))


@pytest.mark.slow
@pytest.mark.parametrize("variant", [MONO, SPECTRAL])
def test_other_variants(variant: str) -> None:
    mi.set_variant(variant)
    scene = small_scene("roughplastic")
    assert_same_mean(runs(scene, wavelet(16), 128, RUNS, 0), small_direct("roughplastic"))


@pytest.mark.slow
def test_a_stratified_sampler() -> None:
    description = scene_dict("diffuse", size=SIZE)
    description["sensor"]["sampler"] = {"type": "multijitter", "sample_count": 256}
    assert_same_mean(runs(mi.load_dict(description), wavelet(4), 256, RUNS, 0), reference("diffuse"))


def test_an_edited_texel_and_a_new_orientation_are_followed() -> None:
    """A light appears where there was nothing: a quadtree of the old map would never find it."""
    texels = hall_map()
    texels[3:6, 20:24] = 0
    scene = small_scene("diffuse", texels)
    ours = mi.load_dict(wavelet(16))
    before = np.array(mi.render(scene, integrator=ours, spp=16))
    params = mi.traverse(scene)
    data = params["sky.data"].numpy().copy()
    data[4, 22] = 5000
    params["sky.data"] = mi.TensorXf(data)
    params["sky.to_world"] = mi.Transform4f().rotate([1, 0, 0], 10).rotate([0, 0, 1], 20)
    params.update()
    after = runs(scene, ours, 128, RUNS, 0)
    assert after.mean() > 2 * before.mean()
    assert_same_mean(after, runs(scene, {"type": "direct", "emitter_samples": 2}, 1024, RUNS, 10_000))


# ------------------------------- The plugin -------------------------------


def test_a_black_map_renders_black() -> None:
    scene = mi.load_dict(scene_dict("roughplastic", np.zeros((16, 32, 3), dtype=np.float32)))
    assert (np.array(mi.render(scene, integrator=mi.load_dict(wavelet()), spp=4)) == 0).all()


@pytest.mark.parametrize("bad", [{"samples": 0}, {"resolution": 4}, {"resolution": 24}, {"resolution": 64}])
def test_bad_properties_are_refused(bad: dict[str, int]) -> None:
    with pytest.raises(RuntimeError, match=next(iter(bad))):
        mi.load_dict({"type": "direct_wavelet", **bad})


def test_kernels_do_not_grow_with_samples() -> None:
    scene = mi.load_dict(scene_dict("diffuse"))
    operations, kernels = [], set()
    for samples in (1, 4, 16, 64):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            mi.render(scene, integrator=mi.load_dict(wavelet(samples)), spp=1)
            dr.sync_thread()
            history = [kernel for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]
        main = max(history, key=lambda kernel: kernel["operation_count"])
        operations.append(main["operation_count"])
        kernels.add(main["hash"])
    assert max(operations) < 1.1 * min(operations)
    assert len(kernels) <= 2  # Dr.Jit addresses memory in two ways, not as many as there are settings
