"""What surfaces of files look like: values at known places."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from stratalux.errors import SceneWarning
from stratalux.scenes.assembly import mirrored_faces
from stratalux.scenes.bitmaps import Bitmaps
from stratalux.scenes.looks import Looks, _metal_of_specular
from stratalux.scenes.model import NONE, ONE, Instance, Material, Model, SpecularGlossiness, Texture, Value
from stratalux.scenes.shapes import object_of
from tests.scenes.models import UV, base_colour, look, parts, picture, seen, square, texture

FOUR = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [188, 188, 188]]], dtype=np.uint8)
GREY = ((188 / 255 + 0.055) / 1.055) ** 2.4
LEFT_RIGHT, UP_DOWN = [-0.5, 0.5, -0.5, 0.5], [0.5, 0.5, -0.5, -0.5]
EVEN = {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}}


def coloured(image: Texture, **more: Any) -> Material:
    return Material(base_colour=Value((1.0, 1.0, 1.0), image), metallic=NONE, **more)


def test_texels_are_found_at_their_places_and_decoded(tmp_path: Path) -> None:
    found = base_colour(square(coloured(texture(tmp_path, FOUR, curve="srgb"))), LEFT_RIGHT, UP_DOWN)
    np.testing.assert_allclose(found, [[1, 0, 0], [0, 1, 0], [0, 0, 1], [GREY] * 3], atol=2e-3)


def test_numbers_are_not_decoded(tmp_path: Path) -> None:
    found = base_colour(square(coloured(texture(tmp_path, FOUR, curve="linear"))), 0.5, -0.5)
    np.testing.assert_allclose(found, [[188 / 255] * 3], atol=1e-3)


def test_a_file_says_itself_what_it_is(tmp_path: Path) -> None:
    """ "auto": integers are coded, floats are not."""
    texels = np.full((2, 2, 3), 0.25, dtype=np.float32)
    image = Texture(picture(tmp_path, texels, "float.exr"), curve="auto")
    np.testing.assert_allclose(base_colour(square(coloured(image)), 0.1, 0.1), [[0.25] * 3], atol=1e-3)
    found = base_colour(square(coloured(texture(tmp_path, FOUR, curve="auto"))), 0.5, -0.5)
    np.testing.assert_allclose(found, [[GREY] * 3], atol=2e-3)


def test_factors_and_offsets(tmp_path: Path) -> None:
    value = Value((0.5, 0.25, 1.0), texture(tmp_path, FOUR, curve="srgb"), offset=(0.0, 0.0, 0.5))
    found = base_colour(square(Material(base_colour=value, metallic=NONE)), LEFT_RIGHT, UP_DOWN)
    grey = [0.5 * GREY, 0.25 * GREY, 1]
    np.testing.assert_allclose(found, [[0.5, 0, 0.5], [0, 0.25, 0.5], [0, 0, 1], grey], atol=2e-3)


def test_16_bits(tmp_path: Path) -> None:
    texels = np.full((2, 2, 3), 12345, dtype=np.uint16)
    found = base_colour(square(coloured(texture(tmp_path, texels))), 0.1, 0.1)
    np.testing.assert_allclose(found, [[12345 / 65535] * 3], rtol=1e-3)


@pytest.mark.parametrize(("wrap", "expected"), [("repeat", [0, 1]), ("clamp", [1, 1]), ("mirror", [1, 0])])
def test_what_is_beyond_the_edges(tmp_path: Path, wrap: Any, expected: list[float]) -> None:
    """At u = 1.25 and 1.75 of two texels, 0 and 1."""
    image = texture(tmp_path, np.array([[[0] * 3, [255] * 3]], dtype=np.uint8), wrap=(wrap, wrap))
    part = square(coloured(image), uvs={0: UV + np.array([1, 0])})
    np.testing.assert_allclose(base_colour(part, [-0.5, 0.5], [0, 0])[:, 0], expected, atol=1e-3)


def test_edges_that_differ(tmp_path: Path) -> None:
    """Clamped along u, mirrored along v."""
    rows = np.array([[[0] * 3, [100] * 3], [[200] * 3, [255] * 3]], dtype=np.uint8)
    part = square(coloured(texture(tmp_path, rows, wrap=("clamp", "mirror"))), uvs={0: UV + np.array([1, 1])})
    found = base_colour(part, LEFT_RIGHT, UP_DOWN)[:, 0] * 255
    np.testing.assert_allclose(found, [255, 255, 100, 100], atol=0.5)


def test_a_transform_of_coordinates(tmp_path: Path) -> None:
    """Half a turn: what was below right is above left."""
    image = texture(tmp_path, FOUR, curve="srgb", transform=((-1, 0, 1), (0, -1, 1)))
    found = base_colour(square(coloured(image)), LEFT_RIGHT, UP_DOWN)
    np.testing.assert_allclose(found, [[GREY] * 3, [0, 0, 1], [0, 1, 0], [1, 0, 0]], atol=2e-3)


def test_a_second_set_of_coordinates(tmp_path: Path) -> None:
    """The base colour is on the first set, and the colours that are taken from the second are mirrored."""
    matte, other = texture(tmp_path, FOUR, curve="srgb"), texture(tmp_path, FOUR, curve="srgb", uv_set=1)
    mirrored = UV * [-1, 1] + [1, 0]
    part = square(coloured(other, roughness=Value((1.0,), matte, "r")), uvs={0: UV, 1: mirrored})
    found = base_colour(part, LEFT_RIGHT, UP_DOWN)
    np.testing.assert_allclose(found, [[0, 1, 0], [1, 0, 0], [GREY] * 3, [0, 0, 1]], atol=2e-3)


def test_coordinates_that_a_mesh_does_not_have(tmp_path: Path) -> None:
    value = Value((0.25, 0.25, 0.25), texture(tmp_path, FOUR, uv_set=3))
    with pytest.warns(SceneWarning, match="does not have; its factor is taken alone"):
        found = base_colour(square(Material(base_colour=value, metallic=NONE)), 0.1, 0.1)
    np.testing.assert_allclose(found, [[0.25] * 3])


def test_an_image_that_cannot_be_read_is_done_without(tmp_path: Path) -> None:
    image = texture(tmp_path, FOUR)
    assert image.picture.path is not None
    image.picture.path.write_bytes(b"nonsense")
    with pytest.warns(SceneWarning, match="the surface is shown without it"):
        found = base_colour(square(Material(base_colour=Value((0.5, 0.5, 0.5), image), metallic=NONE)), 0.1, 0.1)
    np.testing.assert_allclose(found, [[0.5] * 3])


def test_vertex_colours_are_a_factor() -> None:
    colours = np.array([[1, 0, 0, 1], [0, 1, 0, 1], [0, 1, 0, 1], [1, 0, 0, 1.0]])
    part = square(Material(base_colour=Value((0.5, 0.5, 0.5)), metallic=NONE), colours=colours)
    np.testing.assert_allclose(
        base_colour(part, [-0.5, 0.5], [0, 0]), [[0.375, 0.125, 0], [0.125, 0.375, 0]], atol=1e-5
    )


def test_a_normal_map_tilts(tmp_path: Path) -> None:
    """A normal to the right, one up: where light comes from there, the surface is lit as if it faced it."""
    half = 1 / np.sqrt(2)
    for tilt in ([half, 0, half], [0, half, half]):
        code = np.rint((np.array(tilt) + 1) / 2 * 255).astype(np.uint8)
        normal = Value((1.0, 1.0), texture(tmp_path, np.tile(code, (2, 2, 1))))
        for uvs, sign in ((UV, 1), (UV * [-1, 1] + [1, 0], -1)):
            bsdf, si = look(square(Material(normal=normal, metallic=NONE), uvs={0: uvs}), 0.3, 0.3)
            right = -1 if tilt[0] and sign < 0 else 1  # where the image is mirrored, its right is the left
            towards = si.to_local(mi.Vector3f(right * float(tilt[0]), float(tilt[1]), float(tilt[2])))
            away = si.to_local(mi.Vector3f(-right * float(tilt[0]), -float(tilt[1]), float(tilt[2])))
            lit, unlit = (bsdf.eval(mi.BSDFContext(), si, wo)[1][0] for wo in (towards, away))
            assert lit > 0.2 and unlit < 0.01


def test_the_scale_of_a_normal_map(tmp_path: Path) -> None:
    code = np.rint((np.array([0.6, 0, 0.8]) + 1) / 2 * 255).astype(np.uint8)
    image = texture(tmp_path, np.tile(code, (2, 2, 1)))
    flat = Material(metallic=NONE, normal=Value((0.0, 0.0), image))
    values = []
    for material in (flat, Material(metallic=NONE)):
        bsdf, si = look(square(material), 0.3, 0.3)
        values.append(bsdf.eval(mi.BSDFContext(), si, si.to_local(mi.Vector3f(0.6, 0, 0.8)))[1][0])
    assert values[0] == pytest.approx(values[1], rel=0.01)


def test_which_faces_have_mirrored_textures() -> None:
    (shape,) = object_of(Path("a"), Model.of(square(Material()))).shapes
    assert not mirrored_faces(shape.mesh, "uv").any()
    flipped = shape.mesh.transformed(np.diag([-1.0, 1, 1, 1]))
    assert mirrored_faces(flipped, "uv").all()


@pytest.mark.parametrize(("mode", "expected"), [("opaque", 1), ("blend", 0.25), ("mask", 0)])
def test_alpha(mode: Any, expected: float) -> None:
    material = Material(metallic=NONE, alpha=Value((0.25,)), alpha_mode=mode)
    bsdf, si = look(square(material), 0.1, 0.1)
    assert bsdf.eval_null_transmission(si)[0][0] == pytest.approx(1 - expected)


def test_alpha_of_texels_and_vertices(tmp_path: Path) -> None:
    texels = np.full((2, 2, 4), 255, dtype=np.uint8)
    texels[0, 0, 3], texels[0, 1, 3] = 51, 153
    alpha = Value((1.0,), texture(tmp_path, texels), "a")
    material = Material(metallic=NONE, alpha=alpha, alpha_mode="blend")
    bsdf, si = look(square(material), LEFT_RIGHT, UP_DOWN)
    np.testing.assert_allclose(1 - bsdf.eval_null_transmission(si)[0].numpy(), [0.2, 0.6, 1, 1], atol=1e-3)
    colours = np.tile([1, 1, 1, 0.5], (4, 1))
    bsdf, si = look(square(material, colours=colours), LEFT_RIGHT, UP_DOWN)
    np.testing.assert_allclose(1 - bsdf.eval_null_transmission(si)[0].numpy(), [0.1, 0.3, 0.5, 0.5], atol=1e-3)
    cut = Material(metallic=NONE, alpha=alpha, alpha_mode="mask", alpha_cutoff=0.5)
    bsdf, si = look(square(cut), LEFT_RIGHT, UP_DOWN)
    np.testing.assert_allclose(1 - bsdf.eval_null_transmission(si)[0].numpy(), [0, 1, 1, 1])


def test_both_sides_are_shown() -> None:
    part = square(Material(metallic=NONE, double_sided=False))
    turned = parts(Model([part], [Instance(0, np.eye(4)), Instance(0, np.diag([-1.0, 1, -1, 1]))]))
    for shape in turned.values():
        image = seen({"shape": shape, "light": EVEN})
        assert image[4, 4, 1] > 0.9


def test_emission_is_seen_and_lights() -> None:
    """It is seen as it is; and a large square that shines on a white one makes E = π L there, nearly."""
    shining = Material(base_colour=Value((0.0, 0.0, 0.0)), emission=Value((2.0, 1.0, 0.5)))
    image = seen(parts(square(shining)))
    np.testing.assert_allclose(image[4, 4, :3], [2, 1, 0.5], rtol=1e-5)
    white = Material(metallic=NONE, roughness=ONE, specular=NONE)
    behind_the_camera = np.diag([-100.0, 100, -100, 1])
    behind_the_camera[2, 3] = 6
    model = Model([square(white), square(shining)], [Instance(0, np.eye(4)), Instance(1, behind_the_camera)])
    image = seen(parts(model), spp=4096)
    assert image[4, 4, 0] == pytest.approx(2 * image[4, 4, 1], rel=1e-3)
    assert image[4, 4, 1] == pytest.approx(1, rel=0.06)


def test_unlit_is_its_colour(tmp_path: Path) -> None:
    material = coloured(texture(tmp_path, FOUR, curve="srgb"), unlit=True)
    with pytest.warns(SceneWarning, match="unlit surfaces"):
        shapes = parts(square(material))
    np.testing.assert_allclose(seen(shapes)[2, 2, :3], [1, 0, 0], atol=2e-3)


def test_the_index_of_refraction_follows_the_reflectance() -> None:
    """Of glass; other surfaces keep theirs, as only their reflection is weaker."""

    def eta(material: Material) -> float:
        return Looks(Bitmaps(Path("a")))._eta(material)

    assert eta(Material()) == pytest.approx(1.5)
    assert eta(Material(ior=1.33)) == pytest.approx(1.33)
    root = np.sqrt(0.02)
    assert eta(Material(specular=Value((0.5,)), transmission=ONE)) == pytest.approx((1 + root) / (1 - root))
    assert eta(Material(specular=Value((0.5,)))) == pytest.approx(1.5)
    assert eta(Material(specular=NONE, metallic=NONE)) == 1


BLACK_GLOSS = {"base_colour": Value((0.0, 0.0, 0.0)), "metallic": NONE, "roughness": Value((0.4,))}


def mirrored_light(material: Material, cos: float = 1.0, side: int = -1) -> NDArray[np.float32]:
    """What a surface reflects of light that comes from where the eye is mirrored; `side` 1: from the eye."""
    bsdf, si = look(square(material), 0.3, 0.3)
    sin = float(np.sqrt(1 - cos * cos))
    si.wi = mi.Vector3f(sin, 0, cos)
    return np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(side * sin, 0, cos)).numpy()[:, 0])


def test_reflections_have_a_colour_and_a_strength(tmp_path: Path) -> None:
    """Those of what is no metal: the colour at right angles, up to all light, and the strength at all angles."""
    plain = mirrored_light(Material(**BLACK_GLOSS))
    assert plain.min() > 0.05
    tinted = mirrored_light(Material(**BLACK_GLOSS, specular_colour=Value((1.0, 0.25, 0.0))))
    np.testing.assert_allclose(tinted, plain * [1, 0.25, 0], rtol=1e-3, atol=1e-6)
    strong = mirrored_light(Material(**BLACK_GLOSS, specular_colour=Value((100.0, 2.0, 12.5))))
    np.testing.assert_allclose(strong, plain * [25, 2, 12.5], rtol=1e-3)
    for cos in (1.0, 0.1):
        full = mirrored_light(Material(**BLACK_GLOSS), cos)
        half = mirrored_light(Material(**BLACK_GLOSS, specular=Value((0.5,))), cos)
        np.testing.assert_allclose(half, full / 2, rtol=1e-3)
    texels = np.array([[[255, 0, 188, 51]]], dtype=np.uint8)
    image = Texture(texture(tmp_path, texels).picture, "srgb", nearest=True)
    of_image = Material(
        **BLACK_GLOSS, specular=Value((1.0,), image, "a"), specular_colour=Value((2.0, 2.0, 2.0), image)
    )
    np.testing.assert_allclose(mirrored_light(of_image), plain * [0.4, 0, 0.4 * GREY], rtol=5e-3, atol=1e-6)


def test_metals_do_not_know_of_the_reflections_of_others() -> None:
    metal = Material(base_colour=Value((0.9, 0.6, 0.3)), roughness=Value((0.4,)))
    plain = mirrored_light(metal)
    assert plain.min() > 0.5
    for other in ({"specular": NONE}, {"specular_colour": Value((1.0, 0.0, 0.0))}):
        np.testing.assert_allclose(mirrored_light(replace(metal, **other)), plain, rtol=1e-4)


def test_what_is_matte_gets_what_the_reflection_leaves() -> None:
    """White under an even light: less is reflected by neither of the two."""
    count = 1 << 16
    for more in ({"specular": Value((0.3,))}, {"specular_colour": Value((25.0, 25.0, 25.0))}, {"ior": 0.0}):
        material = Material(metallic=NONE, roughness=Value((0.2,)), **more)
        bsdf, si = look(square(material), np.full(count, 0.1), np.full(count, 0.1))
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(1, count)
        si.wi = mi.Vector3f(0.6, 0, 0.8)
        bs, weight = bsdf.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
        value, pdf = bsdf.eval_pdf(mi.BSDFContext(), si, bs.wo)
        np.testing.assert_allclose((weight * pdf).numpy(), value.numpy(), rtol=2e-3, atol=1e-4)
        assert 0.95 < weight[0].numpy().mean() < 1.005


def test_coats_and_sheen_are_shown(tmp_path: Path) -> None:
    """With the textures of both, on both sides: what a coat adds in the mirror, and what sheen adds at the rim."""
    matte = {"base_colour": Value((0.0, 0.0, 0.0)), "metallic": NONE, "specular": NONE}
    half = texture(tmp_path, np.full((1, 1, 4), 128, dtype=np.uint8))
    coat = Material(**matte, clearcoat=Value((1.0,), half, "r"), clearcoat_roughness=Value((1.0,), half, "g"))
    D = 1 / (np.pi * (128 / 255) ** 4)  # GGX along the normal, of α = roughness²
    np.testing.assert_allclose(mirrored_light(coat), 128 / 255 * 0.04 * D / 4, rtol=0.01)
    fibres = Material(**matte, sheen_colour=Value((1.0, 0.5, 0.0)), sheen_roughness=Value((0.5,)))
    rim, middle = (mirrored_light(fibres, cos, 1) for cos in (0.2, 1.0))
    np.testing.assert_allclose(rim / rim[0], [1, 0.5, 0], atol=1e-4)
    assert middle.max() == 0 < rim[0]
    both = replace(coat, sheen_colour=fibres.sheen_colour, sheen_roughness=fibres.sheen_roughness)
    share = 128 / 255 * float(mi.fresnel(mi.Float(0.2), 1.5)[0][0])
    added = mirrored_light(both, 0.2, 1) - mirrored_light(coat, 0.2, 1)
    np.testing.assert_allclose(added, rim * (1 - share), rtol=0.01, atol=1e-5)


def test_normals_of_coats_from_both_sides(tmp_path: Path) -> None:
    """To the right; where the image is mirrored, to the left, and from behind, a bump is a dent."""
    code = np.rint((np.array([0.6, 0, 0.8]) + 1) / 2 * 255).astype(np.uint8)
    normal = Value((1.0, 1.0), texture(tmp_path, np.tile(code, (2, 2, 1))))
    coat = Material(
        base_colour=Value((0.0, 0.0, 0.0)),
        metallic=NONE,
        specular=NONE,
        clearcoat=ONE,
        clearcoat_roughness=Value((0.2,)),
        clearcoat_normal=normal,
    )
    for uvs, to_right in ((UV, 1), (UV * [-1, 1] + [1, 0], -1)):
        for side in (1, -1):
            bsdf, si = look(square(coat, uvs={0: uvs}), 0.3, 0.3)
            tilted = si.to_local(mi.Vector3f(0.6 * to_right * side, 0, 0.8 * side))
            si.wi = tilted
            assert bsdf.eval(mi.BSDFContext(), si, tilted)[0][0] > 1


def test_specular_and_glossy_colours_of_metals_and_others() -> None:
    """What metallic surfaces and others have for colours gives these again."""
    base = np.array([[[0.8, 0.4, 0.1]]], dtype=np.float32)
    for metallic in (0.0, 1.0):
        glossy = 0.04 * (1 - metallic) + base * metallic
        matte = base * (1 - metallic) * (1 - 0.04) / (1 - glossy.max(axis=2))
        found, metal = _metal_of_specular(matte, glossy)
        np.testing.assert_allclose(found, base, atol=0.01)
        assert metal[0, 0] == pytest.approx(metallic, abs=0.01)


def test_a_surface_of_specular_and_glossiness(tmp_path: Path) -> None:
    given = SpecularGlossiness(
        Value((1.0, 1.0, 1.0), texture(tmp_path, FOUR, curve="srgb")), Value((0.04,) * 3), Value((0.25,))
    )
    found = base_colour(square(Material(specular_glossiness=given)), LEFT_RIGHT, UP_DOWN)
    np.testing.assert_allclose(found, [[1, 0, 0], [0, 1, 0], [0, 0, 1], [GREY] * 3], atol=5e-3)


@pytest.mark.parametrize("thin", [True, False])
@pytest.mark.parametrize("roughness", [0.0, 0.4])
@pytest.mark.parametrize("share", [1.0, 0.5])
def test_glass_lets_light_through(thin: bool, roughness: float, share: float) -> None:
    material = Material(metallic=NONE, roughness=Value((roughness,)), transmission=Value((share,)), thin=thin)
    bsdf, _ = look(square(material), 0.1, 0.1)
    through = mi.BSDFFlags.Transmission if not thin or roughness else mi.BSDFFlags.Null
    assert mi.has_flag(bsdf.flags(), through)


def test_what_is_not_shown_is_told_once() -> None:
    material = Material(
        anisotropy=ONE, anisotropy_rotation=1.0, specular_colour=Value((1.0, 0.5, 0.5)), transmission=ONE
    )
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        parts(square(material), square(material))
    (line,) = [str(one.message) for one in told]
    assert "the direction of anisotropy" in line and "the colour of what glass reflects" in line


def test_a_material_is_made_once() -> None:
    material = Material()
    with Bitmaps(Path("a")) as bitmaps:
        looks = Looks(bitmaps)
        assert looks.bsdf(material, {}, False, False) is looks.bsdf(material, {}, False, False)
        assert looks.bsdf(Material(), {}, False, False) is not looks.bsdf(material, {}, False, False)


def test_matte_surfaces_are_lamberts_under_their_reflection() -> None:
    """Without a reflection, base / π · cos θ everywhere; with one, white under an even light never gains."""
    base = (0.8, 0.5, 0.2)
    bsdf, si = look(square(Material(base_colour=Value(base), metallic=NONE, specular=NONE)), 0.1, 0.1)
    for of_eye, of_light in ((0.1, 1.4), (1.4, 0.1), (1.4, 1.4)):
        si.wi = mi.Vector3f(float(np.sin(of_eye)), 0, float(np.cos(of_eye)))
        wo = mi.Vector3f(-float(np.sin(of_light)), 0, float(np.cos(of_light)))
        found = bsdf.eval(mi.BSDFContext(), si, wo).numpy()[:, 0]
        np.testing.assert_allclose(found, np.array(base) * np.cos(of_light) / np.pi, rtol=1e-4)
    bsdf, si = look(square(Material(metallic=NONE)), np.full(4096, 0.1), np.full(4096, 0.1))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, 4096)
    for cos in (1.0, 0.3):
        si.wi = mi.Vector3f(float(np.sqrt(1 - cos * cos)), 0, cos)
        bs, weight = bsdf.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
        value, pdf = bsdf.eval_pdf(mi.BSDFContext(), si, bs.wo)
        np.testing.assert_allclose((weight * pdf).numpy(), value.numpy(), rtol=1e-3, atol=1e-6)
        assert 0.85 < weight[0].numpy().mean() < 1.0


def test_a_dent_that_is_seen_from_behind_is_a_bump(tmp_path: Path) -> None:
    """A normal to the right, seen from behind, points away to the left."""
    code = np.rint((np.array([0.6, 0, 0.8]) + 1) / 2 * 255).astype(np.uint8)
    normal = Value((1.0, 1.0), texture(tmp_path, np.tile(code, (2, 2, 1))))
    material = Material(normal=normal, metallic=NONE, specular=NONE)
    bsdf, si = look(square(material), 0.3, 0.3)
    for side in (1, -1):
        si.wi = mi.Vector3f(0, 0, side)
        wo = si.to_local(mi.Vector3f(0.6 * side, 0, 0.8 * side))
        assert bsdf.eval(mi.BSDFContext(), si, wo)[0][0] == pytest.approx(1 / np.pi, rel=0.02)
