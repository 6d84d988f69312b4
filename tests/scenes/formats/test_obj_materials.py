"""MTL: what each of its terms becomes, and the textures that it names."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from stratalux.errors import SceneWarning
from stratalux.scenes.formats.obj.materials import read_materials
from stratalux.scenes.model import NONE, ONE, Material, Texture, Value


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("wood.png", "two words.png", "wood_normal.png", "sky.exr", "sub/deep.png", "2"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    return tmp_path


def material(folder: Path, text: str) -> Material:
    (folder / "m.mtl").write_text("newmtl m\n" + text.replace("; ", "\n") + "\n")
    return read_materials(folder / "m.mtl", folder)["m"]


def texture(value: Value | None) -> Texture:
    assert value is not None and value.texture is not None
    return value.texture


def approx(value: Value) -> tuple[float, ...]:
    return tuple(round(factor, 6) for factor in value.factor)


def test_names_and_encodings(tmp_path: Path) -> None:
    text = "# a comment\r\n\tnewmtl  a b \r\nkd 0.5\r\n\r\nnewmtl Stra\xdfe\r\nKd 1 0 0\r\n"
    (tmp_path / "m.mtl").write_bytes(text.encode("latin-1"))
    found = read_materials(tmp_path / "m.mtl", tmp_path)
    assert list(found) == ["a b", "Stra\xdfe"] and found["a b"].name == "a b"
    assert found["a b"].base_colour.factor == (0.5, 0.5, 0.5)


@pytest.mark.parametrize(
    ("said", "specular", "colour", "roughness"),
    [
        ("Kd 1 0 0", NONE, (1, 1, 1), 1),
        ("Ks 0 0 0; Ns 10", NONE, (1, 1, 1), 0.9),
        ("Ks 0.5 0.5 0.5; Ns 250; illum 2", ONE, (1, 1, 1), 0.5),
        ("Ks 1 0.5 0", ONE, (2, 1, 0), 1),
        ("Ks 0.5 0.5 0.5; Ns 4000; illum 1", NONE, (1, 1, 1), 0),
        ("Ks 0.5; Ns -5; illum 4", ONE, (1, 1, 1), 1),
    ],
)
def test_phong(tmp_path: Path, said: str, specular: Value, colour: tuple[float, ...], roughness: float) -> None:
    found = material(tmp_path, said)
    assert found.specular == specular and approx(found.specular_colour) == colour
    assert approx(found.roughness) == (roughness,) and found.metallic == NONE
    assert found.specular_glossiness is None and found.transmission == NONE and found.alpha_mode == "opaque"


def test_mirrors(tmp_path: Path) -> None:
    found = material(tmp_path, "Kd 0 0 0; Ks 0.9 0.8 0.7; illum 3").specular_glossiness
    assert found and found.diffuse.factor == (0, 0, 0) and found.specular.factor == (0.9, 0.8, 0.7)
    assert found.glossiness == ONE
    found = material(tmp_path, "Kd 0.5 0 0; Ka 0 0 0; Ks 0.9 0.8 0.7; Ns 250; illum 5").specular_glossiness
    assert found and approx(found.glossiness) == (0.5,)
    # As Blender writes gold.
    gold = material(tmp_path, "Ns 250; Ka 1 1 1; Kd 1 0.8 0.3; Ks 0.5 0.5 0.5; Ni 1.5; d 1; illum 3")
    assert gold.specular_glossiness is None and gold.metallic == ONE and gold.base_colour.factor == (1, 0.8, 0.3)
    assert approx(gold.roughness) == (0.5,)


def test_physical_terms(folder: Path) -> None:
    found = material(folder, "Kd 1 0 0; Pr 0.25; Pm 0.75; Ps 0.125; Pc 0.5; Pcr 0.1; aniso 0.3; anisor 0.25; illum 1")
    assert found.specular == ONE and found.specular_colour.factor == (1, 1, 1)
    assert found.roughness.factor == (0.25,) and found.metallic.factor == (0.75,)
    assert found.sheen_colour.factor == (0.125,) * 3 and found.sheen_roughness.factor == (0.5,)
    assert found.clearcoat.factor == (0.5,) and found.clearcoat_roughness.factor == (0.1,)
    assert found.anisotropy.factor == (0.3,) and found.anisotropy_rotation == pytest.approx(math.pi / 2)
    found = material(
        folder, "map_Pr -imfchan r wood.png; map_Pm -imfchan b wood.png; Ks 0.25 0.25 0.25; map_Ps wood.png"
    )
    assert (found.roughness.channels, found.metallic.channels) == ("r", "b")
    assert found.roughness.factor == found.metallic.factor == (1,) and found.sheen_colour.factor == (1, 1, 1)
    assert found.specular_colour.factor == (0.5,) * 3
    assert texture(found.roughness).curve == "linear"


@pytest.mark.parametrize(
    ("said", "alpha"),
    [("d 0.25", 0.25), ("Tr 0.75", 0.25), ("d 0.25; Tr 0.25", 0.25), ("d 0.25; illum 2", 0.25), ("d 0", 0)],
)
def test_a_share_of_light_passes(tmp_path: Path, said: str, alpha: float) -> None:
    found = material(tmp_path, said)
    assert found.alpha_mode == "blend" and found.alpha.factor == (alpha,) and found.transmission == NONE


def test_what_is_opaque(tmp_path: Path) -> None:
    for said in ("d 1", "Tr 0", "illum 4", "illum 4; Tf 1 1 1; Ni 1", "d 1.5"):
        found = material(tmp_path, said)
        assert found.alpha_mode == "opaque" and found.transmission == NONE
    with pytest.warns(SceneWarning, match=r"'Tr 1' without 'd' is taken for opaque \(m\)"):
        assert material(tmp_path, "Tr 1").alpha_mode == "opaque"


def test_glass(tmp_path: Path) -> None:
    found = material(tmp_path, "Kd 0 0 0; Ks 0.5 0.5 0.5; Ns 1000; Ni 1.33; Tf 0.9 1 0.9; illum 7")
    assert found.transmission == ONE and found.ior == 1.33 and not found.thin
    assert found.base_colour.factor == (0.9, 1, 0.9) and found.roughness == NONE
    found = material(tmp_path, "Kd 0.5 0 0; d 0.25; illum 4; Ni 1")
    assert found.transmission.factor == (0.75,) and found.thin and found.ior == 1.5 and found.alpha_mode == "opaque"
    assert found.base_colour.factor == (0.5, 0, 0)


def test_images_multiply_colours(folder: Path) -> None:
    found = material(folder, "Kd 0.5 1 1; map_Kd wood.png; map_Ks wood.png; map_Ke -mm 0.5 2 sky.exr; Ke 3 3 3")
    assert found.base_colour.factor == (0.5, 1, 1) and texture(found.base_colour).curve == "srgb"
    assert texture(found.base_colour).picture.path == folder / "wood.png"
    assert texture(found.base_colour).picture is texture(found.specular_colour).picture  # and is read once
    assert found.specular == ONE and found.specular_colour.factor == (2, 2, 2)
    assert texture(found.emission).curve == "linear"  # high dynamic range
    assert found.emission.factor == (6, 6, 6) and found.emission.offset == (1.5, 1.5, 1.5)
    with pytest.warns(SceneWarning, match="'Kd' is 0 beside 'map_Kd', and taken for 1"):
        assert material(folder, "Kd 0 0 0; map_Kd wood.png").base_colour.factor == (1, 1, 1)


def test_images_of_numbers(folder: Path) -> None:
    found = material(folder, "Ns 250; Ks 1 1 1; map_Ns wood.png")
    assert approx(found.roughness) == (-0.5,) and found.roughness.offset == (1,)
    assert material(folder, "map_Kd wood.png; map_d wood.png").alpha.channels == "a"
    found = material(folder, "map_Kd wood.png; map_d 2; d 0.5")
    assert found.alpha.channels == "g" and found.alpha.factor == (0.5,) and found.alpha_mode == "blend"
    assert material(folder, "map_d -imfchan m 2").alpha.channels == "a"
    found = material(folder, "map_Tr wood.png")
    assert found.alpha.factor == (-1,) and found.alpha.offset == (1,)


def test_bumps_and_normals(folder: Path) -> None:
    found = material(folder, "map_bump -bm 0.02 wood.png")
    assert found.normal is None and found.bump and found.bump.factor == (0.02,) and found.bump.channels == "g"
    found = material(folder, "norm -bm 2 wood.png; bump 2")
    assert found.normal and found.normal.factor == (2,) and found.bump and found.bump.factor == (1,)
    assert texture(found.normal).curve == "linear"
    with pytest.warns(SceneWarning, match="'map_Bump' is taken for a map of normals"):
        found = material(folder, "map_Bump -bm 0.5 wood_normal.png")
    assert found.bump is None and found.normal and found.normal.factor == (0.5,)


@pytest.mark.parametrize(
    ("options", "u", "v", "wrap"),
    [
        ("", (1, 0, 0), (0, 1, 0), "repeat"),
        ("-o 0.25 0.5 0", (1, 0, 0.25), (0, 1, -0.5), "repeat"),
        ("-s 2 4 1", (2, 0, 0), (0, 4, -3), "repeat"),
        ("-blendu off -s 2 -o 0.5 -texres 64 -t 0 0 0 -clamp on -cc on", (2, 0, 0.5), (0, 1, 0), "clamp"),
    ],
)
@pytest.mark.parametrize("name", ["two words.png", "2", '"two words.png"', ".\\sub\\deep.png"])
def test_options(folder: Path, options: str, u: tuple[float, ...], v: tuple[float, ...], wrap: str, name: str) -> None:
    """The coordinate (0, 0) of the file is the lower left corner, where v is 1 in the model."""
    found = texture(material(folder, f"map_Kd {options} {name}").base_colour)
    assert found.transform == (u, v) and found.wrap == (wrap, wrap)
    assert found.picture.name == name.strip('"').rsplit("\\", 1)[-1]


def test_textures_come_from_below_the_folder_alone(folder: Path) -> None:
    inner = folder / "sub"
    (inner / "m.mtl").write_text("newmtl m\nmap_Kd ../wood.png\nmap_Ks /etc/hostname\nmap_Ke C:\\x\\Deep.PNG\n")
    with pytest.warns(SceneWarning) as caught:
        found = read_materials(inner / "m.mtl", inner)["m"]
    said = sorted(str(each.message) for each in caught)
    assert len(said) == 2 and "'../wood.png' is not there" in said[0] and "'/etc/hostname' is not there" in said[1]
    assert texture(found.emission).picture.path == inner / "deep.png"
    assert found.base_colour.texture is None and found.base_colour.factor == (0.8,) * 3


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ("disp wood.png", r"'disp' is not shown \(m\)"),
        ("refl -type sphere wood.png", "'refl' is not shown"),
        ("Kd spectral a.rfl 1", "'Kd spectral' is not supported, and ignored"),
        ("Ns shiny", "'Ns shiny' is not a number, and ignored"),
        ("Ns nan", "'Ns nan' is not a number, and ignored"),
        ("Kd 1 x 1", "'Kd x' is not a number, and ignored"),
        ("d -halo 0.5", "'d -halo' is taken for 'd'"),
    ],
)
def test_what_is_not_shown_is_told_once(tmp_path: Path, said: str, message: str) -> None:
    with pytest.warns(SceneWarning, match=message) as caught:
        material(tmp_path, said)
    assert len(caught) == 1


def test_ambient_light_is_nothing_to_tell(folder: Path) -> None:
    material(folder, "Ka 1 1 1; map_Ka wood.png; sharpness 60")
    with pytest.warns(SceneWarning, match=r"statements before the first 'newmtl' are ignored \(Kd\)"):
        (folder / "m.mtl").write_text("Kd 1 1 1\nnewmtl m\n")
        read_materials(folder / "m.mtl", folder)
