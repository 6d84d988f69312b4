"""What is behind and below an object."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import stratalux
from stratalux.errors import InputError, SceneWarning
from stratalux.maps.envmap import EnvironmentMap
from stratalux.scenes.settings import colour_of
from stratalux.scenes.surroundings import background, ground
from tests.helpers import scene_dict

OBJ = "v -1 0 -1\nv 1 0 -1\nv 0 1 0\nv 0 0 1\nf 1 4 2\nf 1 2 3\nf 2 4 3\nf 4 1 3\n"
EVEN = np.full((8, 16, 3), 0.5, dtype=np.float32)


def picture(tmp_path: Path, texels: Any = EVEN, **settings: Any) -> Any:
    (tmp_path / "a.obj").write_text(OBJ)
    environment = EnvironmentMap.from_array(np.asarray(texels, dtype=np.float32))
    settings = {"size": (24, 16), "spp": 4, "ground": "none", "direct": True, **settings}
    return stratalux.render(tmp_path / "a.obj", environment=environment, **settings).image


def test_colours() -> None:
    assert colour_of("white") == (1, 1, 1)
    assert colour_of("#fff") == colour_of("#FFFFFF") == pytest.approx((1, 1, 1))
    assert colour_of("#bc0000") == pytest.approx((0.50289, 0, 0), abs=1e-4)
    assert colour_of("0.5,2,0") == (0.5, 2, 0)
    for text in ("", "#ff", "1,2", "1,2,nan", "-1,0,0", "1,2,3,4", "blueish"):
        assert colour_of(text) is None


def test_the_map_is_behind_unless_said_otherwise(tmp_path: Path) -> None:
    np.testing.assert_allclose(picture(tmp_path)[0, 0], [0.5, 0.5, 0.5, 1], rtol=1e-5)
    np.testing.assert_allclose(picture(tmp_path, background="1,2,3")[0, 0], [1, 2, 3, 1], rtol=1e-5)
    np.testing.assert_array_equal(picture(tmp_path, background="none")[0, 0], [0, 0, 0, 0])


def test_the_background_lights_nothing(tmp_path: Path) -> None:
    middle = [picture(tmp_path, background=kind, spp=64)[9, 12, :3] for kind in ("map", "none", "9,9,9", "blur:20")]
    for other in middle[1:]:
        np.testing.assert_allclose(other, middle[0], rtol=0.05)


def test_a_blurred_map_stays_where_it_is(tmp_path: Path) -> None:
    texels = np.zeros((64, 128, 3), dtype=np.float32)
    texels[20:30, 40:50] = [1, 2, 4]
    scene = mi.load_dict(scene_dict("diffuse", texels))
    params = mi.traverse(scene.environment())
    params["to_world"] = mi.Transform4f().rotate([0, 1, 0], 40)
    params["scale"] = mi.Float(3)
    params.update()
    made = background(scene, "blur:3")
    si = mi.SurfaceInteraction3f()
    for u, v in ((45, 25), (80, 40), (47, 27)):
        phi, theta = u * 2 * np.pi / 128, v * np.pi / 63
        d = mi.Transform4f().rotate([0, 1, 0], 40) @ mi.Vector3f(
            float(np.sin(phi) * np.sin(theta)), float(np.cos(theta)), float(-np.cos(phi) * np.sin(theta))
        )
        si.wi = -d
        sharp, soft = (np.array(emitter.eval(si))[:, 0] for emitter in (scene.environment(), made))
        np.testing.assert_allclose(soft, sharp, atol=0.15 * sharp.max() + 0.01)


def test_a_blurred_map_needs_a_map() -> None:
    scene = mi.load_dict({"type": "scene", "light": {"type": "constant"}})
    with pytest.raises(InputError, match="background blur: the scene has no environment map"):
        background(scene, "blur:3")


def test_a_picture_lies_over_the_film(tmp_path: Path) -> None:
    texels = np.zeros((16, 24, 3), dtype=np.float32)
    texels[:, :12, 0], texels[:8, :, 1] = 1, 1
    mi.Bitmap(texels).write(str(tmp_path / "plate.exr"))
    image = picture(tmp_path, background=str(tmp_path / "plate.exr"))
    for pixel, expected in (((0, 0), [1, 1, 0, 1]), ((0, -1), [0, 1, 0, 1]), ((-1, 0), [1, 0, 0, 1])):
        np.testing.assert_allclose(image[pixel], expected, atol=1e-4)


def test_a_picture_of_another_shape_is_cut_and_told(tmp_path: Path) -> None:
    texels = np.zeros((32, 24, 3), dtype=np.float32)
    texels[8:24] = 1
    mi.Bitmap(texels).write(str(tmp_path / "plate.exr"))
    with pytest.warns(SceneWarning, match="24x32 is no shape for a film of 24x16; 24x16 of it are shown"):
        image = picture(tmp_path, background=str(tmp_path / "plate.exr"))
    np.testing.assert_allclose(image[[0, 0, -1], [0, -1, 0]], 1, atol=1e-4)


def test_the_ground_is_a_hair_below() -> None:
    shape = ground("matte:0.2,0.4,0.6", [[-1, 3, -1], [1, 5, 1]])
    assert shape is not None
    made = mi.load_dict(shape)
    assert made.bbox().max.y == pytest.approx(3, abs=1e-3) and made.bbox().max.y < 3
    si = mi.SurfaceInteraction3f()
    np.testing.assert_allclose(np.array(made.bsdf().eval_diffuse_reflectance(si))[:, 0], [0.2, 0.4, 0.6], rtol=1e-5)
    assert ground("none", [[-1, 3, -1], [1, 5, 1]]) is None


@pytest.mark.parametrize(("kind", "share"), [("none", 0), ("matte", 0.4 * 0.5), ("matte:1,1,1", 0.5)])
def test_what_is_below(tmp_path: Path, kind: str, share: float) -> None:
    """Far from the object, a matte ground under an even sky of 0.5."""
    image = picture(tmp_path, ground=kind, background="none", orbit=(0, 60), spp=16)
    np.testing.assert_allclose(image[0, 0, :3], share, rtol=0.06)
    assert image[0, 0, 3] == pytest.approx(float(share > 0))


@pytest.mark.parametrize("kind", ["catcher", "matte", "none"])
def test_which_pixels_show_the_object(tmp_path: Path, kind: str) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    environment = EnvironmentMap.from_array(np.ones((8, 16, 3), dtype=np.float32))
    result = stratalux.render(
        tmp_path / "a.obj", environment=environment, size=(60, 40), spp=1, ground=kind, direct=True
    )
    assert result.object_pixels is not None
    seen = result.object_pixels()
    assert 0.1 < seen.mean() < 0.6
    assert seen[20, 30] and not seen[0].any() and not seen[-1].any()


def test_the_automatic_exposure_is_that_of_the_object(tmp_path: Path) -> None:
    """Whatever is behind; but what is far brighter still has a say."""
    (tmp_path / "a.obj").write_text(OBJ)
    environment = EnvironmentMap.from_array(np.ones((8, 16, 3), dtype=np.float32))
    stops = [
        stratalux.render(
            tmp_path / "a.obj", environment=environment, size=(60, 40), spp=16, background=behind, direct=True
        ).exposure
        for behind in ("map", "none", "0.5,0.5,0.5")
    ]
    np.testing.assert_allclose(stops, stops[0], atol=0.15)
