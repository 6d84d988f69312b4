"""Images of glTF, and how they lie on surfaces."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from stratalux.errors import InputError, SceneWarning
from stratalux.scenes.formats import read_model
from stratalux.scenes.model import Texture
from tests.scenes.formats.gltf_files import Gltf, ktx2


def texture_of(path: Path, gltf: Gltf, index: int, **info: Any) -> Texture | None:
    """The texture of the base colour of the first part."""
    gltf.show_material(pbrMetallicRoughness={"baseColorTexture": {"index": index, **info}})
    material = read_model(gltf.write(path)).parts[0].material
    assert material is not None
    return material.base_colour.texture


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "scene.glb"


@pytest.mark.parametrize(
    ("sampler", "wrap", "nearest"),
    [
        (None, ("repeat", "repeat"), False),
        ({}, ("repeat", "repeat"), False),
        ({"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}, ("clamp", "mirror"), True),
        ({"wrapS": 1, "wrapT": 2}, ("repeat", "repeat"), False),
        ({"wrapS": 10497, "wrapT": 33071, "magFilter": 9729, "minFilter": 9728}, ("repeat", "clamp"), False),
    ],
)
def test_samplers(file: Path, sampler: dict[str, Any] | None, wrap: tuple[str, str], nearest: bool) -> None:
    gltf = Gltf()
    found = texture_of(file, gltf, gltf.texture(sampler=sampler))
    assert found is not None
    assert (found.wrap, found.nearest) == (wrap, nearest)


def moved(found: Texture | None, u: float, v: float) -> list[float]:
    assert found is not None
    return (np.array(found.transform) @ [u, v, 1]).tolist()


def test_a_texture_that_is_moved(file: Path) -> None:
    """The example of the specification: the lower left quarter of the image, turned by a quarter."""
    gltf = Gltf()
    gltf.require("KHR_texture_transform")
    said = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5], "texCoord": 2}
    found = texture_of(file, gltf, gltf.texture(), texCoord=1, extensions={"KHR_texture_transform": said})
    assert found is not None and found.uv_set == 2
    corners = [moved(found, u, v) for u, v in ((0, 0), (1, 0), (0, 1), (1, 1))]
    np.testing.assert_allclose(corners, [[0, 1], [0, 0.5], [0.5, 1], [0.5, 0.5]], atol=1e-12)


def test_the_scale_of_a_texture_comes_before_its_rotation(file: Path) -> None:
    """(1, 1) becomes (2, 3), and is turned about the origin by 30°, from v to u; v goes down."""
    gltf = Gltf()
    said = {"rotation": np.pi / 6, "scale": [2, 3], "offset": [10, 20]}
    found = texture_of(file, gltf, gltf.texture(), extensions={"KHR_texture_transform": said})
    cosine, sine = np.sqrt(0.75), 0.5
    np.testing.assert_allclose(moved(found, 1, 1), [10 + 2 * cosine + 3 * sine, 20 - 2 * sine + 3 * cosine])


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        (None, [0.25, 0.5]),
        ({}, [0.25, 0.5]),
        ({"offset": [1, 2]}, [1.25, 2.5]),
        ({"scale": [2, 4]}, [0.5, 2]),
        ({"rotation": np.pi}, [-0.25, -0.5]),
    ],
)
def test_what_a_texture_does_not_say_of_its_place(
    file: Path, said: dict[str, Any] | None, expected: list[float]
) -> None:
    gltf = Gltf()
    more = {} if said is None else {"extensions": {"KHR_texture_transform": said}}
    found = texture_of(file, gltf, gltf.texture(), **more)
    assert found is not None and found.uv_set == 0
    np.testing.assert_allclose(moved(found, 0.25, 0.5), expected)


def test_where_images_are(tmp_path: Path) -> None:
    gltf = Gltf()
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "a ü.png").write_bytes(b"beside")
    uris = ["below/a%20%C3%BC.png", "data:image/png;base64,aW5zaWRl"]
    for uri in uris:
        index = gltf.texture(source=gltf.add("images", uri=uri))
        gltf.show_material(pbrMetallicRoughness={"baseColorTexture": {"index": index}})
    gltf.show_material(pbrMetallicRoughness={"baseColorTexture": {"index": gltf.texture(b"packed")}})
    parts = read_model(gltf.write(tmp_path / "scene.gltf")).parts
    pictures = [part.material.base_colour.texture.picture for part in parts]  # type: ignore[union-attr]
    assert (pictures[0].path, pictures[0].data) == (tmp_path / "below" / "a ü.png", None)
    assert [picture.data for picture in pictures[1:]] == [b"inside", b"packed"]
    assert pictures[0].name == "a ü.png"


@pytest.mark.parametrize(
    ("uri", "message"),
    [
        ("gone.png", "the file 'gone.png' that it refers to is not there"),
        ("https://example.org/a.png", "refers to 'https://example.org/a.png'; download it"),
        ("../secret.png", "outside of its own folder"),
        ("%2e%2e/secret.png", "outside of its own folder"),
        ("{here}/scene/inside.png", "outside of its own folder"),
        ("link.png", "outside of its own folder"),
        ("folder/../../secret.png", "outside of its own folder"),
    ],
)
def test_images_that_are_not_there_or_elsewhere_are_told(tmp_path: Path, uri: str, message: str) -> None:
    here = tmp_path / "scene"
    (here / "folder").mkdir(parents=True)
    (tmp_path / "secret.png").write_bytes(b"secret")
    (here / "inside.png").write_bytes(b"inside")
    (here / "link.png").symlink_to(tmp_path / "secret.png")
    gltf = Gltf()
    index = gltf.texture(source=gltf.add("images", uri=uri.format(here=tmp_path)))
    with pytest.warns(SceneWarning, match=f"{message}.*; what it is on is shown without") as caught:
        assert texture_of(here / "scene.gltf", gltf, index) is None
    assert len(caught) == 1


@pytest.mark.parametrize("uri", ["../secret.bin", "link.bin", "{here}/secret.bin"])
def test_buffers_elsewhere_are_refused(tmp_path: Path, uri: str) -> None:
    here = tmp_path / "scene"
    here.mkdir()
    gltf = Gltf()
    gltf.show_material()
    (tmp_path / "secret.bin").write_bytes(gltf.binary)
    (here / "link.bin").symlink_to(tmp_path / "secret.bin")
    gltf.json["buffers"] = [{"byteLength": len(gltf.binary), "uri": uri.format(here=tmp_path)}]
    with pytest.raises(InputError, match="outside of its own folder"):
        read_model(gltf.write(here / "scene.glb"))


def test_a_folder_that_is_a_link_itself_is_no_matter(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    gltf = Gltf()
    gltf.show_material()
    gltf.write(tmp_path / "real" / "scene.gltf", how="scene.bin")
    assert len(read_model(tmp_path / "link" / "scene.gltf").parts) == 1


@pytest.mark.parametrize("plain", [True, False])
def test_webp_is_preferred(file: Path, plain: bool) -> None:
    gltf = Gltf()
    images = [gltf.image(data) for data in (b"plain", b"webp")]
    more = {"source": images[0]} if plain else {}
    found = texture_of(file, gltf, gltf.texture(extensions={"EXT_texture_webp": {"source": images[1]}}, **more))
    assert found is not None and found.picture.data == b"webp"


@pytest.mark.parametrize("name", ["KHR_texture_basisu", "MSFT_texture_dds"])
def test_plain_images_are_preferred_to_those_of_graphics_cards(file: Path, name: str) -> None:
    gltf = Gltf()
    images = [gltf.image(data) for data in (b"plain", b"packed")]
    index = gltf.texture(source=images[0], extensions={name: {"source": images[1]}})
    found = texture_of(file, gltf, index)
    assert found is not None and found.picture.data == b"plain"


def test_dds_images_stay_as_they_are(file: Path) -> None:
    gltf = Gltf()
    found = texture_of(file, gltf, gltf.texture(extensions={"MSFT_texture_dds": {"source": gltf.image(b"DDS ...")}}))
    assert found is not None and found.picture.data == b"DDS ..."


def test_images_that_cannot_be_read_are_refused_by_name(file: Path) -> None:
    gltf = Gltf()
    index = gltf.texture(extensions={"EXT_texture_avif": {"source": gltf.image(b"")}})
    with pytest.raises(InputError, match=r"no image that can be read \(EXT_texture_avif\)"):
        texture_of(file, gltf, index)


def test_textures_without_an_image_are_told(file: Path) -> None:
    gltf = Gltf()
    with pytest.warns(SceneWarning, match="a texture that has no image is not shown"):
        assert texture_of(file, gltf, gltf.add("textures")) is None


# ------------------------------- Basis Universal -------------------------------

COLOURS = np.array([[[200, 100, 50, 255], [1, 2, 3, 128]], [[0, 255, 0, 255], [90, 90, 90, 0]]])


def basisu(gltf: Gltf, data: bytes) -> int:
    gltf.require("KHR_texture_basisu")
    return gltf.texture(extensions={"KHR_texture_basisu": {"source": gltf.image(data, name="paint")}})


def test_basis_universal_is_decoded_to_a_png(file: Path) -> None:
    pytest.importorskip("opengl_basisu")
    gltf = Gltf()
    found = texture_of(file, gltf, basisu(gltf, ktx2(COLOURS)))
    assert found is not None and found.picture.data is not None
    copy = file.with_suffix(".png")
    copy.write_bytes(found.picture.data)
    straight = oiio.ImageSpec()
    straight.attribute("oiio:UnassociatedAlpha", 1)  # or colours are multiplied with alpha
    pixels = oiio.ImageBuf(str(copy), 0, 0, straight).get_pixels(oiio.UINT8)
    expected = COLOURS.repeat(4, axis=0).repeat(4, axis=1)
    np.testing.assert_array_equal(pixels, expected)


def test_basis_universal_in_a_file_beside_the_document(tmp_path: Path) -> None:
    pytest.importorskip("opengl_basisu")
    (tmp_path / "a.ktx2").write_bytes(ktx2(COLOURS))
    gltf = Gltf()
    index = gltf.texture(extensions={"KHR_texture_basisu": {"source": gltf.add("images", uri="a.ktx2")}})
    found = texture_of(tmp_path / "scene.gltf", gltf, index)
    assert found is not None and found.picture.data is not None
    assert found.picture.data.startswith(b"\x89PNG")
    assert found.picture.name == "a.ktx2"


def test_basis_universal_without_its_package(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "opengl_basisu", None)
    gltf = Gltf()
    with pytest.raises(InputError, match=r"paint: compressed with Basis Universal.* pip install 'stratalux\[gltf\]'"):
        texture_of(file, gltf, basisu(gltf, ktx2(COLOURS)))


@pytest.mark.parametrize(
    ("at", "bytes_", "message"),
    [(20, b"\xff\xff\xff\x7f", "paint cannot be decoded"), (200, b"", "paint cannot be decoded")],
)
def test_damaged_basis_universal_is_one_line(file: Path, at: int, bytes_: bytes, message: str) -> None:
    """A width beyond all measure, and a file that is cut short."""
    pytest.importorskip("opengl_basisu")
    data = ktx2(COLOURS)
    data = data[:at] + bytes_ + (data[at + len(bytes_) :] if bytes_ else b"")
    gltf = Gltf()
    with pytest.raises(InputError, match=message) as caught:
        texture_of(file, gltf, basisu(gltf, data))
    assert "\n" not in str(caught.value)


def test_texels_that_the_bytes_cannot_hold_are_refused_before_there_is_memory_for_them(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opengl_basisu = pytest.importorskip("opengl_basisu")

    class Bomb:
        width, height = 16384, 16384

        def transcode(self, _: str) -> None:
            raise AssertionError

    monkeypatch.setattr(opengl_basisu, "open", lambda _: Bomb())
    gltf = Gltf()
    with pytest.raises(InputError, match="no 16384x16384 texels"):
        texture_of(file, gltf, basisu(gltf, ktx2(COLOURS)))


def test_a_pipe_is_no_image(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    gltf = Gltf()
    index = gltf.texture(source=gltf.add("images", uri="pipe.png"))
    with pytest.warns(SceneWarning, match="is not there"):
        assert texture_of(tmp_path / "scene.gltf", gltf, index) is None
