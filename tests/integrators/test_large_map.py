"""The emitter of large maps is Mitsuba's ``envmap`` in all but its tables and its memory."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from mitsuba.chi2 import ChiSquareTest, SphericalDomain
from numpy.typing import NDArray

import stratalux
from stratalux import InputError
from stratalux.integrators import large_map
from stratalux.integrators.environment import MapCache, image_emitter, store
from stratalux.integrators.large_map import Memory, large_envmap
from stratalux.rendering.ready import loaded_for
from stratalux.rendering.settings import PictureSettings, SamplingSettings
from stratalux.scenes.settings import SceneSettings
from tests.helpers import ALPHA, assert_same_mean, hall_map, runs, scene_dict
from tests.images.make import write
from tests.variants import BACKEND, MONO, SPECTRAL

pytestmark = pytest.mark.skipif(BACKEND != "llvm", reason="other backends have Mitsuba's envmap")
KINDS = pytest.mark.parametrize("kind", [np.float32, np.float16])


def turn() -> mi.ScalarTransform4f:
    return mi.ScalarTransform4f().rotate([0, 1, 0], 37).rotate([1, 0, 0], -28)


def smooth_map(height: int = 25, width: int = 47) -> NDArray[np.float16]:
    """A map whose look-up does not depend on the last digits of a position. Half floats, so that both have the same."""
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, np.linspace(0, 1, height))
    wave = 2 + np.sin(np.pi * v) ** 2 * np.sin(6 * np.pi * u)
    return np.stack([wave, wave * v + 1, 3 - wave / 2], axis=-1).astype(np.float16)


def both(texels: NDArray[Any], **more: Any) -> tuple[mi.Emitter, mi.Emitter]:
    """Mitsuba's emitter, and ours."""
    theirs = mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(texels.astype(np.float32)), **more})
    return theirs, mi.load_dict({**large_envmap(texels), **more})


def directions(count: int = 20000) -> mi.Vector3f:
    """With both poles, and the seam on both sides."""
    d = np.random.default_rng(0).normal(size=(count, 3))
    d[:4] = [[0, 1, 0], [0, -1, 0], [1e-7, 0.3, -1], [-1e-7, 0.3, -1]]
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return mi.Vector3f(*d.T.astype(np.float32))


def towards(d: mi.Vector3f) -> mi.SurfaceInteraction3f:
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(d))
    si.wi = -d
    return si


@KINDS
@pytest.mark.parametrize("size", [(25, 47), (64, 128)])
def test_radiance_is_that_of_envmap(kind: Any, size: tuple[int, int]) -> None:
    theirs, ours = both(smooth_map(*size).astype(kind), scale=0.5, to_world=turn())
    assert ours.is_environment() and mi.traverse(ours)["data"].numpy().dtype == kind
    si = towards(directions())
    found, expected = ours.eval(si).numpy(), theirs.eval(si).numpy()
    # The arc cosine is off by more next to a pole, and not the same in both.
    apart = np.abs((mi.Transform4f(turn().matrix).inverse() @ si.wi).y.numpy()) < 0.999
    np.testing.assert_allclose(found[:, apart], expected[:, apart], rtol=1e-5)
    np.testing.assert_allclose(found, expected, rtol=1e-4)
    ds = dr.zeros(mi.DirectionSample3f, 20000)
    ds.uv = mi.Point2f(*np.random.default_rng(1).random((2, 20000)).astype(np.float32))
    np.testing.assert_allclose(ours.eval_direction(si, ds).numpy(), theirs.eval_direction(si, ds).numpy(), rtol=1e-5)


def test_every_half_float_is_exact() -> None:
    bits = np.arange(0x7C00, dtype=np.uint16)
    found = large_map._number(mi.UInt32(bits.astype(np.uint32))).numpy()
    np.testing.assert_array_equal(found, bits.view(np.float16).astype(np.float32))


@KINDS
def test_samples_have_the_density_that_is_stated(kind: Any) -> None:
    _, ours = both(hall_map().astype(kind), to_world=turn())
    it = dr.zeros(mi.SurfaceInteraction3f)

    def sample(u: Any, *_: Any) -> tuple[mi.Vector3f, mi.Float]:
        return ours.sample_direction(it, mi.Point2f(u[0], u[1]))[0].d, mi.Float(1)

    def density(d: mi.Vector3f, *_: Any) -> mi.Float:
        ds = dr.zeros(mi.DirectionSample3f)
        ds.d = d
        return ours.pdf_direction(it, ds)

    test = ChiSquareTest(SphericalDomain(), sample, density, sample_dim=2, sample_count=400_000, ires=8)
    assert test.run(ALPHA), test.messages


@KINDS
def test_samples_are_worth_what_the_map_has_there(kind: Any) -> None:
    _, ours = both(hall_map().astype(kind), scale=2.0, to_world=turn())
    u = mi.Point2f(*np.random.default_rng(0).random((2, 20000)).astype(np.float32))
    ds, weight = ours.sample_direction(dr.zeros(mi.SurfaceInteraction3f), u)
    np.testing.assert_allclose(dr.norm(ds.d).numpy(), 1, rtol=1e-5)
    seen = ours.eval(towards(ds.d)).numpy()
    np.testing.assert_allclose((weight * ds.pdf).numpy(), seen, rtol=5e-3, atol=5e-3)
    np.testing.assert_allclose(ours.pdf_direction(ds, ds).numpy(), ds.pdf.numpy(), rtol=2e-2)


@pytest.mark.parametrize("integrator", [{"type": "path", "max_depth": 2}, {"type": "direct_stratified"}])
def test_pictures_are_those_of_envmap(integrator: dict[str, Any]) -> None:
    texels = hall_map().astype(np.float16)
    description = scene_dict("roughplastic", texels.astype(np.float32))
    expected = runs(mi.load_dict(description), integrator, 64, 24, 10_000)
    sky = description["sky"]
    description["sky"] = large_envmap(texels) | {key: sky[key] for key in ("scale", "to_world")}
    scene = mi.load_dict(description)
    assert image_emitter(scene) is not None
    assert_same_mean(runs(scene, integrator, 64, 24, 0), expected)


@KINDS
def test_changes_are_followed_where_calls_are_recorded(kind: Any) -> None:
    """Through a pointer as well: what is recorded of arrays of NumPy's goes on to read the older ones."""
    rng = np.random.default_rng(0)
    scene = mi.load_dict({"type": "scene", "sky": large_envmap(smooth_map().astype(kind)), "ball": {"type": "sphere"}})
    emitter = scene.environment()
    look = dr.freeze(lambda scene, si: si.emitter(scene).eval(si))
    for step in range(8):
        if step > 1:
            store(emitter, rng.random((25, 47, 3)).astype(kind))
        if step > 4:
            params = mi.traverse(emitter)
            params["scale"] = mi.Float(step)
            params["to_world"] = type(params["to_world"])(mi.ScalarTransform4f().rotate([0, 1, 0], 10 * step).matrix)
            params.update()
        texels = mi.traverse(emitter)["data"].numpy()
        assert texels.dtype == kind
        theirs, _ = both(texels)
        params = mi.traverse(theirs)
        params["scale"], params["to_world"] = (mi.traverse(emitter)[name] for name in ("scale", "to_world"))
        params.update()
        si = towards(directions(1000 + step))
        np.testing.assert_allclose(look(scene, si).numpy(), theirs.eval(si).numpy(), rtol=1e-3, atol=1e-3)
        sampled, weight = emitter.sample_direction(si, mi.Point2f(0.3, 0.6))
        expected = theirs.eval(towards(sampled.d)).numpy()
        np.testing.assert_allclose((weight * sampled.pdf).numpy(), expected, rtol=1e-2, atol=1e-2)


def test_tables_follow_a_map_that_has_changed() -> None:
    built: list[NDArray[Any]] = []
    scene = mi.load_dict({"type": "scene", "sky": large_envmap(smooth_map())})
    cache = MapCache(lambda environment: [built.append(environment.texels.copy())])
    for texels in (smooth_map(), smooth_map(), smooth_map()[::-1]):
        if built:
            store(scene.environment(), texels)
        cache.get(scene)
        cache.get(scene)
    assert [one.dtype for one in built] == [np.float16] * 3
    np.testing.assert_array_equal(built[2], smooth_map()[::-1])


def test_derivatives_are_the_weights_of_the_look_up() -> None:
    """It is linear, so that they give its values back; and texels that are not looked up have none."""
    _, ours = both(smooth_map().astype(np.float32))
    params = mi.traverse(ours)
    dr.enable_grad(params["data"])
    params.update()
    seen = ours.eval(towards(directions(100)))
    dr.backward(dr.sum(seen))
    gradient = dr.grad(mi.traverse(ours)["data"]).numpy().astype(np.float64)
    np.testing.assert_allclose((gradient * smooth_map()).sum(), dr.detach(seen).numpy().sum(), rtol=1e-5)
    assert 0 < np.count_nonzero(gradient) <= 1200 and gradient.min() >= 0


def test_what_is_in_its_memory_is_not_copied() -> None:
    for kind in (np.float16, np.float32):
        memory = Memory()
        texels = memory.allocate((25, 47, 3), kind)
        texels[:] = smooth_map()
        emitter = mi.load_dict(large_envmap(texels, memory))
        assert mi.traverse(emitter)["data"].numpy().ctypes.data == texels.ctypes.data
        other = mi.load_dict(large_envmap(smooth_map().astype(kind), memory))
        np.testing.assert_array_equal(mi.traverse(other)["data"].numpy(), smooth_map())


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A map in half floats and one in others, and a scene that names the former. All maps are large ones."""
    monkeypatch.setattr(large_map, "LARGE", 1)
    texels = smooth_map(24, 48).astype(np.float32)
    write(tmp_path / "half.exr", texels, type="half")
    write(tmp_path / "float.exr", texels)
    (tmp_path / "scene.xml").write_text(
        '<scene version="3.0.0"><sensor type="perspective" id="camera"/><shape type="sphere" id="ball"/>'
        '<emitter type="envmap" id="sky">'
        '<string name="filename" value="half.exr"/><float name="scale" value="3"/>'
        '<transform name="to_world"><rotate y="1" angle="40"/></transform></emitter></scene>'
    )
    return tmp_path


@pytest.mark.parametrize("given", [True, False])
def test_half_floats_stay_so_from_the_file_on(files: Path, given: bool) -> None:
    path = files / "scene.xml"
    for name, kind in (("half.exr", np.float16), ("float.exr", np.float32)):
        scene = stratalux.load_scene(path, environment=files / name if given else None, rotate=(0, 10, 0))
        params = mi.traverse(scene.environment())
        assert params["data"].numpy().dtype == (kind if given else np.float16)
        np.testing.assert_array_equal(params["data"].numpy(), smooth_map(24, 48))
        assert float(params["scale"][0]) == 3
        large_map.LARGE = 1 << 40
        other = stratalux.load_scene(path, environment=files / name if given else None, rotate=(0, 10, 0))
        large_map.LARGE = 1
        assert other.environment().class_name() == "EnvironmentMapEmitter"
        si = towards(directions())
        found, expected = (one.environment().eval(si).numpy() for one in (scene, other))
        np.testing.assert_allclose(found, expected, rtol=1e-5)


@pytest.mark.parametrize("variant", [MONO, SPECTRAL, "scalar_rgb"])
def test_other_variants_have_that_of_mitsuba(files: Path, variant: str) -> None:
    mi.set_variant(variant)
    assert not large_map.there()
    if variant != "scalar_rgb":
        scene = stratalux.load_scene(files / "scene.xml")
        assert scene.environment().class_name() == "EnvironmentMapEmitter"


def test_a_checkpoint_of_another_map_is_another_picture(files: Path) -> None:
    from stratalux.rendering.checkpoint import identity_of
    from stratalux.rendering.settings import PictureSettings

    hashes = []
    for scale in (1.0, 1.0, 2.0):
        settings = {"environment": str(files / "half.exr"), "scale": scale}
        scene = stratalux.load_scene(files / "scene.xml", **settings)
        hashes.append(identity_of(scene, PictureSettings.of(str(files / "scene.xml"), **settings)))
    assert hashes[0] == hashes[1] and hashes[0]["map"] != hashes[2]["map"]
    assert hashes[0]["scene"] == hashes[2]["scene"]


def test_what_it_cannot_do_is_told() -> None:
    _, ours = both(smooth_map())
    with pytest.raises(InputError, match="emits no rays"):
        ours.sample_ray(0.0, 0.5, mi.Point2f(0.5), mi.Point2f(0.5))
    with pytest.raises(InputError, match="no positions"):
        ours.sample_position(0.0, mi.Point2f(0.5))


@pytest.mark.parametrize(
    ("technique", "large"),
    [
        (None, True),
        ("path", False),
        ("direct:bsdf_samples=2", False),
    ],
)
def test_mitsubas_integrators_have_mitsubas_maps(
    technique: str | None, large: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(large_map, "LARGE", 1)
    write(tmp_path / "sky.exr", np.ones((16, 32, 3), dtype=np.float32))
    scene = SceneSettings(source="demo", environment=str(tmp_path / "sky.exr"))
    picture = PictureSettings(scene=scene, sampling=SamplingSettings(technique=technique))
    emitter = loaded_for(picture).scene.environment()
    assert hasattr(emitter, "large") is large
