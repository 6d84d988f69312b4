"""References: who makes them, how sure they are, and when they are made again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import stratalux
from stratalux import InputError
from stratalux.comparison import reference
from stratalux.comparison.reference import (
    Reference,
    cache_folder,
    choose_estimator,
    find_reference,
    make_reference,
    reference_key,
)
from stratalux.errors import CacheWarning
from tests.helpers import hall_map, runs, scene_dict
from tests.variants import MONO

DIRECT = choose_estimator(())


def scene(**changes: Any) -> mi.Scene:
    return mi.load_dict(scene_dict(**changes))


def test_the_estimator_takes_no_part() -> None:
    assert choose_estimator(["direct_stratified"])["type"] == "direct"
    assert choose_estimator(["direct_stratified", "direct"])["type"] == "path"
    assert choose_estimator(["direct", "path"])["type"] == "volpath"
    with pytest.raises(InputError, match="all take part"):
        choose_estimator(["path", "direct", "volpath"])


def test_all_estimators_agree() -> None:
    one = scene(material="roughplastic")
    means, errors = [], []
    for estimator in reference.ESTIMATORS:
        images = runs(one, estimator, 256, 8, 11).mean(axis=(1, 2))
        means.append(images.mean(axis=0))
        errors.append(images.std(axis=0, ddof=1) / np.sqrt(8))
    for k in (1, 2):
        assert (abs(means[k] - means[0]) < 5 * np.hypot(errors[k], errors[0])).all()


def test_the_second_time_it_comes_from_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fractions: list[float] = []
    first = reference.reference(scene(), spp=30, cache=tmp_path, progress=fractions.append)
    assert not first.cached and first.spp == 32 and first.passes == 16 and first.image.shape == (12, 18, 3)
    assert fractions == pytest.approx(np.arange(1, 17) / 16)
    monkeypatch.setattr(reference, "render", None)
    again = reference.reference(scene(), spp=30, cache=tmp_path)
    assert again.cached and (again.spp, again.estimator, again.seconds) == (32, DIRECT, first.seconds)
    np.testing.assert_array_equal(again.image, first.image)
    np.testing.assert_array_equal(again.standard_error, first.standard_error)
    assert len(list(tmp_path.rglob("*.*"))) == 1


@pytest.mark.parametrize("damage", [b"", b"nonsense", "truncated", "flipped", "another"])
def test_a_damaged_file_is_made_again(tmp_path: Path, damage: bytes | str) -> None:
    first = make_reference(scene(), DIRECT, 16, cache=tmp_path)
    (path,) = tmp_path.rglob("*.npz")
    data = bytearray(path.read_bytes())
    if damage == "truncated":
        data = data[: len(data) // 2]
    elif damage == "flipped":
        data[len(data) // 2] ^= 1
    elif damage == "another":
        path.unlink()
        make_reference(scene(), DIRECT, 17, cache=tmp_path)
        (other,) = tmp_path.rglob("*.npz")
        data = bytearray(other.read_bytes())
    else:
        data = bytearray(damage)  # type: ignore[arg-type]
    path.write_bytes(data)
    with pytest.warns(CacheWarning, match="damaged"):
        again = reference.reference(scene(), spp=16, cache=tmp_path)
    assert not again.cached
    np.testing.assert_allclose(again.image, first.image, rtol=1e-5)
    assert find_reference(scene(), DIRECT, 16, cache=tmp_path) is not None


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.warns(CacheWarning, match="cannot be kept"):
        assert make_reference(scene(), DIRECT, 16, cache=tmp_path / "file").image.mean() > 0


def test_the_key_follows_the_content() -> None:
    key = reference_key(scene(), DIRECT, 16)
    assert reference_key(scene(), DIRECT, 16) == key
    used = scene()
    stratalux.render(used, strata=4, spp=1)
    assert reference_key(used, DIRECT, 16) == key
    other_sampler = scene_dict()
    other_sampler["sensor"]["sampler"] = {"type": "multijitter", "sample_count": 16}
    assert reference_key(mi.load_dict(other_sampler), DIRECT, 16) == key

    texels = hall_map()
    texels[3, 4, 1] += 1e-3
    one_colour, turned, moved, filtered = (scene_dict() for _ in range(4))
    one_colour["box"]["bsdf"] = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.6, 0.6, 0.601]}}
    turned["sky"]["to_world"] = turned["sky"]["to_world"] @ mi.ScalarTransform4f().rotate([0, 1, 0], 0.01)
    moved["ball"]["center"] = [0, 1e-4, 0]
    filtered["sensor"]["film"]["rfilter"] = {"type": "tent"}
    changed = [mi.load_dict(d) for d in (one_colour, turned, moved, filtered)]
    changed += [scene(texels=texels), scene(size=(25, 16)), scene(material="plastic"), scene(material="roughplastic")]
    keys = [key] + [reference_key(other, DIRECT, 16) for other in changed]
    keys += [reference_key(scene(), DIRECT, 17), reference_key(scene(), {**DIRECT, "bsdf_samples": 2}, 16)]
    mi.set_variant(MONO)
    keys.append(reference_key(scene(), DIRECT, 16))
    assert len(set(keys)) == len(keys)


def test_the_key_sees_the_vertices_of_a_mesh(tmp_path: Path) -> None:
    keys = set()
    for z in ("1", "1.00001"):  # the bounding box is printed with fewer digits
        (tmp_path / "mesh.obj").write_text(
            f"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 {z}\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
        )
        mesh = {"type": "obj", "filename": str(tmp_path / "mesh.obj")}
        keys.add(reference_key(mi.load_dict({**scene_dict(), "mesh": mesh}), DIRECT, 16))
    assert len(keys) == 2


def test_the_standard_error_is_right(tmp_path: Path) -> None:
    """Against the spread of other renderings: variances agree, and so do errors with a much better image."""
    one = scene(material="roughplastic")
    made = make_reference(one, DIRECT, 256, cache=tmp_path)
    others = runs(one, DIRECT, 256, 24, 77)
    expected = others.var(axis=0, ddof=1).mean()
    assert made.rmse_floor() ** 2 == pytest.approx(expected, rel=0.15)
    best = others.mean(axis=0)
    z = (made.image - best)[made.standard_error > 0] / made.standard_error[made.standard_error > 0]
    # Student's t of 15 degrees of freedom has variance 15/13, and the better image adds 1/24.
    assert np.mean(z**2) == pytest.approx(15 / 13 + 1 / 24, rel=0.15)
    floor = np.mean(others.var(axis=0, ddof=1) / (best**2 + 0.01))
    assert made.relative_mse_floor() == pytest.approx(floor, rel=0.15)
    assert made.relative_standard_error() <= np.sqrt(made.relative_mse_floor())


def test_figures_by_hand() -> None:
    image = np.array([[[0.0], [0.3]]], dtype=np.float32)
    error = np.array([[[0.1], [0.2]]], dtype=np.float32)
    made = Reference(image, error, {}, 16, 16, 0.0, "")
    assert made.relative_mse_floor() == pytest.approx((0.01 / 0.01 + 0.04 / 0.1) / 2)
    assert made.relative_standard_error() == pytest.approx((1 + np.sqrt(0.4)) / 2)
    assert made.rmse_floor(np.array([[False, True]])) == pytest.approx(0.2)
    assert made.mean() == pytest.approx(0.15)


def test_half_floats_and_alpha(tmp_path: Path) -> None:
    bright = hall_map() + 1e6
    description = scene_dict(texels=bright.astype(np.float32))
    description["sensor"]["film"] |= {"pixel_format": "rgba", "component_format": "float16"}
    made = make_reference(mi.load_dict(description), DIRECT, 16, cache=tmp_path)
    assert made.image.shape == (12, 18, 3) and np.isfinite(made.image).all()


def test_where_the_cache_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("STRATALUX_CACHE", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert cache_folder() == Path.home() / ".cache" / "stratalux"
    monkeypatch.setenv("XDG_CACHE_HOME", "/x")
    assert cache_folder() == Path("/x/stratalux")
    monkeypatch.setenv("STRATALUX_CACHE", "/y")
    assert cache_folder() == Path("/y")
