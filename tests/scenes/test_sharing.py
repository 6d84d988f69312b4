"""Materials that are one BSDF look as each does by itself."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from stratalux.errors import InputError, SceneWarning
from stratalux.scenes import album
from stratalux.scenes.looks import Looks
from stratalux.scenes.model import NONE, ONE, Material, Part, Picture, Texture, Value
from stratalux.scenes.sharing import structure
from tests.scenes.models import UV, parts, picture, seen, square

SETS: dict[int, str | None] = {0: None}
RNG = np.random.default_rng(3)
TRANSFORM = ((0.5, 0.25, 0.1), (-0.3, 2.0, 0.7))


def random_texture(folder: Path, size: tuple[int, int] = (5, 7), channels: int = 3, **how: Any) -> Texture:
    texels = RNG.integers(0, 256, (*size, channels), dtype=np.uint8)
    return Texture(picture(folder, texels, f"{len(list(folder.iterdir()))}.png"), **how)


def coloured(folder: Path, k: int, **how: Any) -> Material:
    image = random_texture(folder, (3 + k, 6 - k), curve="srgb", **how)
    return Material(base_colour=Value((1.0, 1.0, 1.0), image), metallic=NONE, roughness=Value((0.3 + 0.2 * k,)))


def bent(folder: Path, k: int) -> Material:
    normals = np.array([0, 0, 1]) + RNG.uniform(-0.2, 0.2, (4, 4 + k, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    normal = Texture(picture(folder, np.rint(127.5 * (normals + 1)).astype(np.uint8), f"n{k}.png"))
    return replace(coloured(folder, k), normal=Value((0.5 + 0.25 * k,) * 2, normal))


def layered(folder: Path, k: int) -> Material:
    """Of all that may differ, with images of one channel, grey, and with alpha."""
    image = random_texture(folder, channels=4, curve="srgb", wrap=("mirror", "mirror"), transform=TRANSFORM)
    rough = random_texture(folder, (4, 4))
    return Material(
        base_colour=Value((0.5, 0.8, 0.2 + 0.2 * k), image, offset=(0.1, 0.0, 0.0)),
        roughness=Value((0.5 + 0.1 * k,), rough, "g", (0.2,)),
        metallic=Value((1.0,), rough, "b"),
        clearcoat=Value((0.4 + 0.2 * k,)),
        clearcoat_roughness=Value((0.2,)),
        alpha=Value((1.0,), image, "a"),
        alpha_mode="blend",
    )


KINDS: dict[str, Callable[[Path, int], Material]] = {
    "textures": coloured,
    "nearest": lambda folder, k: coloured(folder, k, nearest=True, wrap=("mirror", "clamp")),
    "normals": bent,
    "all": layered,
    "grey": lambda folder, k: Material(
        base_colour=Value((0.3 + 0.2 * k,) * 3, random_texture(folder, channels=1, curve="auto")),
        roughness=Value((0.9,), random_texture(folder, channels=2), "a"),
    ),
    "numbers": lambda folder, k: replace(
        coloured(folder, k), base_colour=Value((0.2 * k, 0.5, 0.1)), metallic=Value((1.0,), random_texture(folder))
    ),
}


def values(shape: mi.Shape) -> list[Any]:
    """What a BSDF is on a mesh, at many places and from both sides."""
    x, y = np.random.default_rng(1).random((2, 500)).astype(np.float32) * 3 - 1
    found = []
    for side, wo in ((1, [0.3, 0.2, 0.9]), (-1, [-0.5, 0.1, 0.4])):
        si = dr.zeros(mi.SurfaceInteraction3f, len(x))
        si.t, si.uv, si.shape = mi.Float(1), mi.Point2f(x, y), mi.ShapePtr(shape)
        si.n, si.sh_frame = mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Vector3f(0, 0, 1))
        si.dp_du, si.dp_dv = mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0)
        si.wi = mi.Vector3f(0.1, 0.2, 0.9 * side)
        bsdf, context = shape.bsdf(), mi.BSDFContext()
        found += [bsdf.eval(context, si, mi.Vector3f(*wo) * side).numpy(), bsdf.eval_diffuse_reflectance(si).numpy()]
        found.append(bsdf.pdf(context, si, mi.Vector3f(*wo) * side).numpy()[None])
    return found


@pytest.mark.parametrize(("kind", "mirrored"), [*((kind, False) for kind in KINDS), ("normals", True)])
def test_each_looks_as_it_does_alone(
    tmp_path: Path, kind: str, mirrored: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    uvs = UV[:, ::-1] if mirrored else UV
    pieces = [square(KINDS[kind](tmp_path, k), uvs={0: uvs}) for k in range(3)]
    shared = list(parts(*pieces).values())
    assert len({id(shape.bsdf()) for shape in shared}) == 1
    monkeypatch.setattr(Looks, "share", lambda *_: None)
    for piece, together in zip(pieces, shared, strict=True):
        (alone,) = parts(piece).values()
        for one, other in zip(values(together), values(alone), strict=True):
            # Texels have 11 bits where materials are alone, and normals are shortened before they are interpolated.
            limit = (0.05, 0.02) if kind == "normals" else (0.01, 2e-3)
            np.testing.assert_allclose(one, other, rtol=limit[0], atol=limit[1])


def test_materials_of_several_structures_keep_apart(tmp_path: Path) -> None:
    colours = ((0.2, 0.3, 0.4), (0.5, 0.6, 0.7), (0.8, 0.1, 0.2), (0.3, 0.9, 0.1))
    rough = Value((1.0,), random_texture(tmp_path), "g")
    materials = [Material(base_colour=Value(each), metallic=NONE, roughness=rough) for each in colours]
    materials[2:] = [replace(each, clearcoat=Value((0.5,))) for each in materials[2:]]
    shapes = list(parts(*map(square, materials)).values())
    assert len({id(shape.bsdf()) for shape in shapes}) == 2
    for shape, colour in zip(shapes, colours, strict=True):
        scene = mi.load_dict({"type": "scene", "shape": shape})
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f([0.3], [0.3], 5), mi.Vector3f(0, 0, -1)))
        np.testing.assert_allclose(np.array(shape.bsdf().eval_diffuse_reflectance(si)).ravel(), colour, atol=1e-6)


def test_other_coordinates_than_the_meshs_own(tmp_path: Path) -> None:
    """In the second set, the image lies half as large, and its first texel where x and y are small."""
    texels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255] * 3]], dtype=np.uint8)
    image = Texture(picture(tmp_path, texels), nearest=True, uv_set=1)
    other = random_texture(tmp_path)
    shapes = []
    for k in range(2):
        material = Material(
            base_colour=Value((1.0, 1.0, 1.0), image), roughness=Value((1.0,), other, "g"), metallic=NONE
        )
        material = replace(material, normal=Value((1.0, 1.0), other), specular=NONE if k else ONE)
        shapes.append(square(material, uvs={0: UV, 1: UV / 2}))
    for shape in parts(*shapes).values():
        scene = mi.load_dict({"type": "scene", "shape": shape})
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f([-0.5, 0.5], [0.5, -0.5], 5), mi.Vector3f(0, 0, -1)))
        found = np.array(si.bsdf().eval_diffuse_reflectance(si)).T
        np.testing.assert_allclose(found, [[1, 0, 0], [1, 0, 0]], atol=1e-6)


def test_a_picture_shows_what_belongs_on_each_mesh(tmp_path: Path) -> None:
    """Also where kernels of another scene are replayed. Noise is far below what colours differ by."""
    places = (-0.5, 0.5)
    for swapped in (False, True):
        colours = [(255, 0, 0), (0, 0, 255)][:: -1 if swapped else 1]
        pieces: list[Part] = []
        for k, colour in enumerate(colours):
            image = picture(tmp_path, np.full((2, 2, 3), colour, np.uint8), f"{swapped}{k}.png")
            texture = Texture(image, curve="srgb")
            material = Material(base_colour=Value((1.0, 1.0, 1.0), texture), metallic=NONE, specular=NONE)
            piece = square(material)
            shift = np.array([places[k], 0, 0])
            pieces.append(replace(piece, vertices=piece.vertices * [0.5, 1, 1] + shift))
        light = {"type": "envmap", "bitmap": mi.Bitmap(np.ones((8, 16, 3), np.float32))}
        pixels = seen({**parts(*pieces), "light": light})
        for column, colour in zip((2, 5), colours, strict=True):
            np.testing.assert_allclose(pixels[3, column, :3], np.array(colour) / 255, atol=0.1)


def test_what_differs_in_more_than_numbers_and_images_is_not_one() -> None:
    first = Material(metallic=Value((0.5,)), roughness=Value((0.25,)))
    assert structure(first, SETS, False) == structure(replace(first, roughness=Value((0.75,)), name="a"), SETS, False)
    others = [
        replace(first, roughness=NONE),
        replace(first, ior=1.3),
        replace(first, alpha_mode="blend"),
        replace(first, alpha=Value((0.5,))),
        replace(first, clearcoat=ONE),
        replace(first, vertex_colours=False),
        replace(first, roughness=Value((0.25,), Texture(Picture("a", Path("a"))))),
        replace(first, roughness=Value((0.25,), Texture(Picture("a", Path("a")), nearest=True))),
        replace(first, roughness=Value((0.25,), Texture(Picture("a", Path("a"))), "g")),
    ]
    keys = [structure(each, SETS, False) for each in (first, *others)]
    keys += [structure(first, {}, False), structure(first, SETS, True)]
    assert len(set(keys)) == len(keys) and None not in keys
    for alone in (
        replace(first, unlit=True),
        replace(first, transmission=ONE),
        replace(first, bump=ONE),
        replace(first, anisotropy=ONE),
        replace(first, roughness=Value((0.25,), Texture(Picture("a", Path("a")), uv_set=1))),
    ):
        assert structure(alone, SETS, False) is None


def test_a_lost_image_leaves_the_others_alone(tmp_path: Path) -> None:
    (tmp_path / "damaged.png").write_bytes(b"\x89PNG")
    damaged = Texture(Picture("damaged.png", tmp_path / "damaged.png"))
    whole = random_texture(tmp_path)
    pieces = [square(Material(base_colour=Value((0.5, 0.25, 1.0), image))) for image in (whole, damaged, whole)]
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        first, second, third = parts(*pieces).values()
    (line,) = [str(one.message) for one in told if one.category is SceneWarning]
    assert "damaged.png: " in line and line.endswith("the surface is shown without it")
    assert first.bsdf() is third.bsdf() is not second.bsdf()
    np.testing.assert_allclose(values(second)[1][:, 0], [0.5, 0.25, 1.0], atol=1e-6)


def test_images_of_more_bits_are_textures_of_mitsubas(tmp_path: Path) -> None:
    deep = Texture(picture(tmp_path, np.full((2, 2, 3), 12345, np.uint16)))
    pieces = [square(Material(base_colour=Value((1.0, 1.0, 1.0), deep))) for _ in range(2)]
    first, second = parts(*pieces).values()
    assert first.bsdf() is not second.bsdf()
    np.testing.assert_allclose(values(first)[1], 12345 / 65535, rtol=1e-3)


def test_images_that_do_not_fit_into_memory_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pieces = [square(coloured(tmp_path, k)) for k in range(2)]
    monkeypatch.setattr(album, "default_memory", lambda: 100)
    refused = r"a\.glb: its textures take .* GB, more than there is room for"
    with pytest.raises(InputError, match=refused):
        parts(*pieces)
    monkeypatch.undo()

    def full(*_: Any) -> None:
        raise OSError(12, "Cannot allocate memory")

    monkeypatch.setattr(album.Room, "array", full)
    with pytest.raises(InputError, match=refused):
        parts(*pieces)


def test_images_are_read_once_and_kept_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each by one of the processes, of which there are as many as there are images, at most."""
    image = random_texture(tmp_path)
    read: list[Any] = []
    original = album.Found.read_rgba
    monkeypatch.setattr(album.Found, "read_rgba", lambda self, *how: read.append(self.path) or original(self, *how))
    pieces = [
        square(Material(base_colour=Value((1.0, 1.0, 0.1 * k), image), roughness=Value((1.0,), image, "g")))
        for k in range(3)
    ]
    shapes = list(parts(*pieces).values())
    assert len(read) == 1 and len({id(shape.bsdf()) for shape in shapes}) == 1


def test_without_memory_that_processes_share(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on systems that have none, texels come through a pipe, and are the same."""
    shown = []
    pieces = [square(coloured(tmp_path, k)) for k in range(3)]
    for there in (True, False):
        monkeypatch.setattr(album.Room, "there", lambda there=there: there)
        shown.append([values(shape)[0] for shape in parts(*pieces).values()])
    assert np.ptp(shown) > 0.1
    np.testing.assert_array_equal(shown[0], shown[1])
