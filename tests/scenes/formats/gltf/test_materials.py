"""What glTF says of materials, value by value."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from stratalux.errors import InputError, SceneWarning
from stratalux.scenes.formats import read_model
from stratalux.scenes.model import Material, SpecularGlossiness, Texture, Value
from tests.scenes.formats.gltf_files import Gltf

TRIANGLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def look(path: Path, gltf: Gltf) -> Material:
    """The material of the first part."""
    material = read_model(gltf.write(path)).parts[0].material
    assert material is not None
    return material


def of(path: Path, **properties: Any) -> Material:
    gltf = Gltf()
    gltf.show_material(**properties)
    return look(path, gltf)


def extended(path: Path, name: str, **said: Any) -> Material:
    return of(path, extensions={name: said})


def image(value: Value | None) -> bytes:
    """What the image of a value was called in the file: its bytes stand for one."""
    assert value is not None and value.texture is not None and value.texture.picture.data is not None
    return value.texture.picture.data


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "scene.glb"


def test_a_primitive_without_a_material_has_the_default_one(file: Path) -> None:
    gltf = Gltf()
    gltf.show(gltf.primitive(TRIANGLE))
    expected = Material(
        base_colour=Value((1.0,) * 3), metallic=Value((1.0,)), roughness=Value((1.0,)), double_sided=False
    )
    assert look(file, gltf) == expected
    assert of(file) == expected


def test_metal_and_roughness(file: Path) -> None:
    gltf = Gltf()
    base, rest = gltf.texture(b"base"), gltf.texture(b"rest")
    surface = {
        "baseColorFactor": [0.1, 0.2, 0.3, 0.4],
        "baseColorTexture": {"index": base},
        "metallicFactor": 0.5,
        "roughnessFactor": 0.25,
        "metallicRoughnessTexture": {"index": rest, "texCoord": 1},
    }
    gltf.show_material(name="wood", pbrMetallicRoughness=surface, doubleSided=True)
    found = look(file, gltf)
    assert (found.name, found.double_sided) == ("wood", True)
    colour, alpha, metal, rough = found.base_colour, found.alpha, found.metallic, found.roughness
    assert (colour.factor, colour.channels, image(colour)) == ((0.1, 0.2, 0.3), "rgb", b"base")
    assert (alpha.factor, alpha.channels, alpha.texture) == ((0.4,), "a", colour.texture)
    assert (metal.factor, metal.channels, image(metal)) == ((0.5,), "b", b"rest")
    assert (rough.factor, rough.channels, rough.texture) == ((0.25,), "g", metal.texture)
    assert colour.texture and metal.texture
    assert (colour.texture.curve, metal.texture.curve) == ("srgb", "linear")
    assert (colour.texture.uv_set, metal.texture.uv_set) == (0, 1)


@pytest.mark.parametrize("mode", ["OPAQUE", "MASK", "BLEND", None])
def test_alpha_modes(file: Path, mode: str | None) -> None:
    found = of(file, **({"alphaMode": mode, "alphaCutoff": 0.3} if mode else {}))
    assert found.alpha_mode == (mode or "OPAQUE").lower()
    assert found.alpha_cutoff == (0.3 if mode else 0.5)


def test_an_alpha_mode_that_nobody_knows(file: Path) -> None:
    with pytest.warns(SceneWarning, match="the alpha mode 'SOMETIMES' is not shown"):
        assert of(file, alphaMode="SOMETIMES").alpha_mode == "opaque"


def test_normals_and_emission(file: Path) -> None:
    gltf = Gltf()
    bumps, glow = gltf.texture(b"bumps"), gltf.texture(b"glow")
    gltf.show_material(
        normalTexture={"index": bumps, "scale": 0.7},
        occlusionTexture={"index": glow},
        emissiveFactor=[0.5, 1, 0],
        emissiveTexture={"index": glow},
        extensions={"KHR_materials_emissive_strength": {"emissiveStrength": 20}},
    )
    found = look(file, gltf)
    assert found.normal is not None and found.normal.texture is not None
    assert (found.normal.factor[:2], found.normal.texture.curve, image(found.normal)) == (
        (0.7, 0.7),
        "linear",
        b"bumps",
    )
    assert found.emission.texture is not None
    assert (found.emission.factor, found.emission.texture.curve, image(found.emission)) == (
        (10, 20, 0),
        "srgb",
        b"glow",
    )


def test_clearcoat(file: Path) -> None:
    gltf = Gltf()
    coat, rough, bumps = (gltf.texture(name) for name in (b"coat", b"rough", b"bumps"))
    said = {
        "clearcoatFactor": 0.8, "clearcoatTexture": {"index": coat},
        "clearcoatRoughnessFactor": 0.2, "clearcoatRoughnessTexture": {"index": rough},
        "clearcoatNormalTexture": {"index": bumps, "scale": 2},
    }  # fmt: skip
    gltf.show_material(extensions={"KHR_materials_clearcoat": said})
    found = look(file, gltf)
    assert (found.clearcoat.factor, found.clearcoat.channels, image(found.clearcoat)) == ((0.8,), "r", b"coat")
    value = found.clearcoat_roughness
    assert (value.factor, value.channels, image(value)) == ((0.2,), "g", b"rough")
    assert found.clearcoat_normal is not None
    assert (found.clearcoat_normal.factor[:2], image(found.clearcoat_normal)) == ((2, 2), b"bumps")


def test_transmission_volume_and_index_of_refraction(file: Path) -> None:
    gltf = Gltf()
    gltf.show_material(
        extensions={
            "KHR_materials_transmission": {"transmissionFactor": 0.9, "transmissionTexture": {"index": gltf.texture()}},
            "KHR_materials_volume": {
                "thicknessFactor": 0.1,
                "attenuationColor": [0.2, 0.4, 0.6],
                "attenuationDistance": 3,
            },
            "KHR_materials_ior": {"ior": 1.8},
        }
    )
    found = look(file, gltf)
    assert (found.transmission.factor, found.transmission.channels, image(found.transmission)) == (
        (0.9,),
        "r",
        b"an image",
    )
    assert (found.thin, found.attenuation, found.attenuation_distance) == (False, (0.2, 0.4, 0.6), 3)
    assert found.ior == 1.8


def test_what_has_no_thickness_is_thin(file: Path) -> None:
    assert extended(file, "KHR_materials_transmission", transmissionFactor=1).thin
    found = extended(file, "KHR_materials_volume", attenuationColor=[0.5, 0.5, 0.5])
    assert (found.thin, found.attenuation_distance) == (True, math.inf)


def test_an_index_of_refraction_of_zero_stays(file: Path) -> None:
    assert extended(file, "KHR_materials_ior", ior=0).ior == 0
    assert extended(file, "KHR_materials_ior").ior == 1.5


def test_specular(file: Path) -> None:
    gltf = Gltf()
    much, colour = gltf.texture(b"much"), gltf.texture(b"colour")
    said = {
        "specularFactor": 0.4, "specularTexture": {"index": much},
        "specularColorFactor": [1, 2, 3], "specularColorTexture": {"index": colour},
    }  # fmt: skip
    gltf.show_material(extensions={"KHR_materials_specular": said})
    found = look(file, gltf)
    assert (found.specular.factor, found.specular.channels, image(found.specular)) == ((0.4,), "a", b"much")
    value = found.specular_colour
    assert value.texture is not None
    assert (value.factor, value.channels, value.texture.curve, image(value)) == ((1, 2, 3), "rgb", "srgb", b"colour")


def test_sheen(file: Path) -> None:
    gltf = Gltf()
    colour, rough = gltf.texture(b"colour"), gltf.texture(b"rough")
    said = {
        "sheenColorFactor": [0.1, 0.2, 0.3], "sheenColorTexture": {"index": colour},
        "sheenRoughnessFactor": 0.6, "sheenRoughnessTexture": {"index": rough},
    }  # fmt: skip
    gltf.show_material(extensions={"KHR_materials_sheen": said})
    found = look(file, gltf)
    assert found.sheen_colour.texture is not None
    assert (found.sheen_colour.factor, found.sheen_colour.texture.curve) == ((0.1, 0.2, 0.3), "srgb")
    value = found.sheen_roughness
    assert (value.factor, value.channels, image(value)) == ((0.6,), "a", b"rough")


def test_anisotropy(file: Path) -> None:
    gltf = Gltf()
    said = {"anisotropyStrength": 0.6, "anisotropyRotation": 1.25, "anisotropyTexture": {"index": gltf.texture()}}
    gltf.show_material(extensions={"KHR_materials_anisotropy": said})
    with pytest.warns(SceneWarning, match="the directions in textures of anisotropy is not shown"):
        found = look(file, gltf)
    assert (found.anisotropy.factor, found.anisotropy.channels, image(found.anisotropy)) == ((0.6,), "b", b"an image")
    assert found.anisotropy_rotation == 1.25


def test_specular_and_glossiness(file: Path) -> None:
    gltf = Gltf()
    matte, glossy = gltf.texture(b"matte"), gltf.texture(b"glossy")
    said = {
        "diffuseFactor": [0.1, 0.2, 0.3, 0.4], "diffuseTexture": {"index": matte},
        "specularFactor": [0.5, 0.6, 0.7], "glossinessFactor": 0.8, "specularGlossinessTexture": {"index": glossy},
    }  # fmt: skip
    gltf.show_material(extensions={"KHR_materials_pbrSpecularGlossiness": said})
    found = look(file, gltf)
    given = found.specular_glossiness
    assert given is not None and given.specular.texture is not None
    assert (given.diffuse.factor, image(given.diffuse)) == ((0.1, 0.2, 0.3), b"matte")
    assert (found.alpha.factor, found.alpha.channels, image(found.alpha)) == ((0.4,), "a", b"matte")
    assert (given.specular.factor, image(given.specular)) == ((0.5, 0.6, 0.7), b"glossy")
    assert (given.glossiness.factor, given.glossiness.channels, image(given.glossiness)) == ((0.8,), "a", b"glossy")
    assert given.specular.texture.curve == "srgb"


def test_unlit(file: Path) -> None:
    assert extended(file, "KHR_materials_unlit").unlit
    assert not of(file).unlit


def test_what_is_equal_is_the_same_object(file: Path) -> None:
    gltf = Gltf()
    first, second = gltf.texture(b"one", name="a"), gltf.texture(b"two")
    for index in (first, first, second):
        gltf.show_material(pbrMetallicRoughness={"baseColorTexture": {"index": index}}, doubleSided=index == second)
    gltf.show_material(emissiveTexture={"index": first}, emissiveFactor=[1, 1, 1])
    gltf.show(gltf.primitive(TRIANGLE), gltf.primitive(TRIANGLE))
    looks = [part.material for part in read_model(gltf.write(file)).parts]
    assert looks[0] is looks[1] and looks[0] is not looks[2] and looks[4] is looks[5]
    assert looks[0] is not None and looks[3] is not None
    texture, light = looks[0].base_colour.texture, looks[3].emission.texture
    assert isinstance(texture, Texture)
    assert texture is light


def test_what_is_not_shown_is_named_in_one_line(file: Path) -> None:
    gltf = Gltf()
    for name in ("KHR_materials_iridescence", "KHR_materials_dispersion", "ACME_glitter", "KHR_xmp_json_ld"):
        gltf.show_material(extensions={name: {}})
    gltf.add("materials", extensions={"ACME_unused": {}})
    with pytest.warns(SceneWarning) as caught:
        look(file, gltf)
    lines = [str(each.message) for each in caught]
    assert lines == [
        f"{file}: KHR_materials_iridescence, KHR_materials_dispersion, ACME_glitter are not shown",
    ]


def test_variants_are_left_out_and_named(file: Path) -> None:
    gltf = Gltf(extensions={"KHR_materials_variants": {"variants": [{"name": "blue"}, {"name": "red"}]}})
    gltf.require("KHR_materials_variants")
    plain, other = gltf.add("materials", name="plain"), gltf.add("materials", name="other")
    mapping = {"mappings": [{"material": other, "variants": [0]}]}
    gltf.show(gltf.primitive(TRIANGLE, material=plain, extensions={"KHR_materials_variants": mapping}))
    with pytest.warns(SceneWarning, match="by default; left out: 'blue', 'red'") as caught:
        assert look(file, gltf).name == "plain"
    assert len(caught) == 1


def test_numbers_out_of_their_range_are_told(file: Path) -> None:
    with pytest.warns(SceneWarning, match="metallicFactor above 1, roughnessFactor below 0 are not shown"):
        of(file, pbrMetallicRoughness={"metallicFactor": 3, "roughnessFactor": -1})


@pytest.mark.parametrize(
    ("extension", "name", "field", "high"),
    [
        ("", "metallicFactor", "metallic", 1),
        ("", "roughnessFactor", "roughness", 1),
        ("anisotropy", "anisotropyStrength", "anisotropy", 1),
        ("clearcoat", "clearcoatFactor", "clearcoat", 1),
        ("clearcoat", "clearcoatRoughnessFactor", "clearcoat_roughness", 1),
        ("sheen", "sheenRoughnessFactor", "sheen_roughness", 1),
        ("sheen", "sheenColorFactor", "sheen_colour", 1),
        ("specular", "specularFactor", "specular", 1),
        ("specular", "specularColorFactor", "specular_colour", math.inf),
        ("transmission", "transmissionFactor", "transmission", 1),
    ],
)
@pytest.mark.filterwarnings("ignore::stratalux.errors.SceneWarning")
def test_factors_are_clamped_to_their_range(
    file: Path, extension: str | None, name: str, field: str, high: float
) -> None:
    count = len(getattr(Material(), field).factor)
    for given, expected in ((-0.5, 0), (0.3, 0.3), (1.5, min(1.5, high))):
        said = {name: given if count == 1 else [given] * count}
        whole = {f"KHR_materials_{extension}": said}
        found = of(file, **({"extensions": whole} if extension else {"pbrMetallicRoughness": said}))
        assert getattr(found, field).factor == (expected,) * count


@pytest.mark.filterwarnings("ignore::stratalux.errors.SceneWarning")
def test_other_numbers_are_clamped_to_their_range(file: Path) -> None:
    found = of(
        file, alphaCutoff=-1, emissiveFactor=[-1, 0.5, 20], pbrMetallicRoughness={"baseColorFactor": [-1, 2, 0, 2]}
    )
    assert (found.alpha_cutoff, found.emission.factor) == (0, (0, 0.5, 20))
    assert (found.base_colour.factor, found.alpha.factor) == ((0, 1, 0), (1,))
    assert extended(file, "KHR_materials_ior", ior=0.5).ior == 1
    found = extended(
        file, "KHR_materials_volume", thicknessFactor=-1, attenuationDistance=0, attenuationColor=[2, -1, 0]
    )
    assert (found.thin, found.attenuation, found.attenuation_distance) == (True, (1, 0, 0), math.inf)
    said = {"diffuseFactor": [2, -1, 0, 2], "specularFactor": [2, -1, 0], "glossinessFactor": 2}
    found = extended(file, "KHR_materials_pbrSpecularGlossiness", **said)
    expected = SpecularGlossiness(Value((1, 0, 0)), Value((1, 0, 0)), Value((1,)))
    assert (found.specular_glossiness, found.alpha) == (expected, Value((1,)))


@pytest.mark.parametrize(
    "name", ["anisotropy", "clearcoat", "emissive_strength", "ior", "sheen", "specular", "transmission", "volume"]
)
def test_an_extension_that_says_nothing_changes_nothing(file: Path, name: str) -> None:
    assert extended(file, f"KHR_materials_{name}") == Material(double_sided=False)


def test_the_default_of_specular_and_glossiness(file: Path) -> None:
    found = extended(file, "KHR_materials_pbrSpecularGlossiness")
    assert found == Material(double_sided=False, specular_glossiness=SpecularGlossiness())


@pytest.mark.parametrize(
    ("properties", "message"),
    [
        ({"pbrMetallicRoughness": {"metallicFactor": "much"}}, "metallicFactor is much, not a number"),
        ({"pbrMetallicRoughness": {"roughnessFactor": math.nan}}, "roughnessFactor is nan, not a number"),
        ({"emissiveFactor": [1, 2]}, r"emissiveFactor is \[1, 2\], not 3 numbers"),
        ({"normalTexture": {"index": 7}}, "there is no object 7"),
    ],
)
def test_damaged_materials_are_one_line(file: Path, properties: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        of(file, **properties)
    assert "\n" not in str(caught.value)
