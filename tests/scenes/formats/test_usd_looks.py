"""USD: materials with their textures, lights and cameras."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from stratalux.errors import SceneWarning
from stratalux.scenes.model import Light, Material, Model, Texture, Value
from tests.scenes.formats.test_usd import mesh

pytest.importorskip("pxr")
from stratalux.scenes.formats.usd.stage import read_stage


def model(folder: Path, text: str, head: str = "") -> Model:
    path = folder / "scene.usda"
    path.write_text(f"#usda 1.0\n(\n{head}\n)\n{text}\n{mesh(name='other')}")
    return read_stage(path)


def shader(kind: str, inputs: str = "", name: str = "surface", outputs: str = "token outputs:surface") -> str:
    return f'def Shader "{name}"\n{{\nuniform token info:id = "{kind}"\n{inputs}\n{outputs}\n}}\n'


def preview(inputs: str, more: str = "", name: str = "m") -> str:
    surface = shader("UsdPreviewSurface", inputs)
    output = f"token outputs:surface.connect = </{name}/surface.outputs:surface>"
    return f'def Material "{name}"\n{{\n{output}\n{surface}{more}}}\n'


def image(inputs: str = "", name: str = "image", file: str = "wood.png") -> str:
    outputs = "\n".join(f"float outputs:{each}" for each in "rgba") + "\nfloat3 outputs:rgb"
    return shader("UsdUVTexture", f"asset inputs:file = @{file}@\n{inputs}", name, outputs)


def bound(folder: Path, text: str, body: str = "") -> Material:
    for name in ("wood.png", "sky.exr"):
        (folder / name).write_bytes(b"")
    found = model(folder, text + mesh(f"rel material:binding = </m>\n{body}")).parts[0].material
    assert found is not None
    return found


def texture(value: Value | None) -> Texture:
    assert value is not None and value.texture is not None
    return value.texture


def approx(value: Value) -> tuple[float, ...]:
    return tuple(round(float(each), 6) for each in value.factor)


def test_numbers_of_a_surface(tmp_path: Path) -> None:
    found = bound(tmp_path, preview(""))
    assert found.name == "m" and approx(found.base_colour) == (0.18,) * 3 and found.roughness.factor == (0.5,)
    assert found.metallic.factor == (0,) and found.ior == 1.5 and not found.vertex_colours
    assert found.alpha_mode == "opaque" and found.specular_glossiness is None
    inputs = """
    color3f inputs:diffuseColor = (1, 0.5, 0)
    color3f inputs:emissiveColor = (3, 2, 1)
    float inputs:metallic = 1
    float inputs:roughness = 0.25
    float inputs:clearcoat = 0.5
    float inputs:clearcoatRoughness = 0.125
    float inputs:ior = 1.25
    """
    found = bound(tmp_path, preview(inputs))
    assert found.base_colour.factor == (1, 0.5, 0) and found.emission.factor == (3, 2, 1)
    assert found.metallic.factor == (1,) and found.roughness.factor == (0.25,) and found.ior == 1.25
    assert found.clearcoat.factor == (0.5,) and found.clearcoat_roughness.factor == (0.125,)


def test_the_specular_workflow(tmp_path: Path) -> None:
    inputs = "int inputs:useSpecularWorkflow = 1\ncolor3f inputs:specularColor = (0.25, 0.5, 1)\n"
    found = bound(tmp_path, preview(inputs + "float inputs:roughness = 0.25")).specular_glossiness
    assert found and found.specular.factor == (0.25, 0.5, 1) and found.glossiness.factor == (0.75,)
    assert approx(found.diffuse) == (0.18,) * 3
    inputs += "float inputs:roughness.connect = </m/image.outputs:g>"
    found = bound(tmp_path, preview(inputs, image())).specular_glossiness
    assert found and found.glossiness.factor == (-1,) and found.glossiness.offset == (1,)


def test_opacity(tmp_path: Path) -> None:
    found = bound(tmp_path, preview("float inputs:opacity = 0.25"))
    assert found.alpha_mode == "blend" and found.alpha.factor == (0.25,)
    found = bound(tmp_path, preview("float inputs:opacity = 0.25\nfloat inputs:opacityThreshold = 0.5"))
    assert found.alpha_mode == "mask" and found.alpha_cutoff == 0.5
    # What is clear still reflects, unless it is not there.
    found = bound(tmp_path, preview("float inputs:opacity = 0"))
    assert found.transmission.factor == (1,) and found.base_colour.factor == (1, 1, 1) and found.thin
    found = bound(tmp_path, preview('float inputs:opacity = 0\ntoken inputs:opacityMode = "presence"'))
    assert found.alpha_mode == "blend" and found.alpha.factor == (0,) and found.transmission.factor == (0,)
    found = bound(tmp_path, preview("float inputs:opacity.connect = </m/image.outputs:a>", image()))
    assert found.alpha_mode == "blend" and found.alpha.channels == "a" and texture(found.alpha).curve == "linear"


def test_textures(tmp_path: Path) -> None:
    inputs = "color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>\n"
    inputs += (
        "float inputs:roughness.connect = </m/image.outputs:g>\nfloat inputs:metallic.connect = </m/raw.outputs:b>"
    )
    of_image = "float4 inputs:scale = (0.5, 0.25, 1, 1)\nfloat4 inputs:bias = (0, 0.5, 0, 0)\n"
    of_image += 'token inputs:wrapS = "mirror"\ntoken inputs:wrapT = "clamp"'
    raw = image('token inputs:sourceColorSpace = "sRGB"', "raw", "./wood.png")
    found = bound(tmp_path, preview(inputs, image(of_image) + raw))
    assert found.base_colour.factor == (0.5, 0.25, 1) and found.base_colour.offset == (0, 0.5, 0)
    assert found.base_colour.channels == "rgb" and texture(found.base_colour).wrap == ("mirror", "clamp")
    assert texture(found.base_colour).curve == "auto" and texture(found.roughness).curve == "linear"
    assert found.roughness.channels == "g" and found.roughness.factor == (0.25,) and found.roughness.offset == (0.5,)
    assert found.metallic.channels == "b" and texture(found.metallic).curve == "srgb"
    assert texture(found.metallic).wrap == ("repeat", "repeat")
    assert texture(found.base_colour).picture.path == tmp_path / "wood.png"
    assert texture(found.base_colour).picture is texture(found.metallic).picture  # and is read once


def test_textures_that_are_not_there(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "outside.png").write_bytes(b"")
    inputs = "color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>"
    with pytest.warns(SceneWarning, match=r"textures that are not there are left out \(../outside.png\)"):
        found = bound(tmp_path / "sub", preview(inputs, image(file="../outside.png")))
    assert approx(found.base_colour) == (0.18,) * 3
    with pytest.warns(SceneWarning, match="gone.png"):
        found = bound(tmp_path, preview(inputs, image("float4 inputs:fallback = (1, 0, 0.5, 1)", file="gone.png")))
    assert found.base_colour.factor == (1, 0, 0.5)
    found = bound(tmp_path, preview(inputs, image(file="C:/of/others/wood.png")))
    assert texture(found.base_colour).picture.path == tmp_path / "wood.png"


@pytest.mark.parametrize(
    ("scale", "bias", "factor"),
    [
        ("(2, 2, 2, 2)", "(-1, -1, -1, 0)", (1,)),
        ("(2, -2, 2, 2)", "(-1, 1, -1, 0)", (1, -1, 1)),
        ("(1, 1, 1, 1)", "(0, 0, 0, 0)", (1,)),
        ("(4, 4, 4, 1)", "(-2, -2, -2, 0)", (2,)),
    ],
)
def test_maps_of_normals(tmp_path: Path, scale: str, bias: str, factor: tuple[float, ...]) -> None:
    more = image(f"float4 inputs:scale = {scale}\nfloat4 inputs:bias = {bias}")
    found = bound(tmp_path, preview("normal3f inputs:normal.connect = </m/image.outputs:rgb>", more)).normal
    assert found and found.factor == factor and texture(found).curve == "linear" and found.offset == (0,)


def test_coordinates_of_textures(tmp_path: Path) -> None:
    """(0.25, 0.75) of the file, in which v goes up, becomes what the transforms say, and then goes down."""
    inputs = "color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>"
    shift = "float2 inputs:in.connect = </m/reader.outputs:result>\nfloat2 inputs:translation = (0.25, 0)\n"
    move = "float2 inputs:in.connect = </m/shift.outputs:result>\nfloat inputs:rotation = 90\n"
    move += "float2 inputs:scale = (2, 4)\nfloat2 inputs:translation = (0.5, 0.125)"
    more = image("float2 inputs:st.connect = </m/move.outputs:result>")
    more += shader("UsdTransform2d", move, "move", "float2 outputs:result")
    more += shader("UsdTransform2d", shift, "shift", "float2 outputs:result")
    reader = "string inputs:varname.connect = </m.inputs:which>"
    more += shader("UsdPrimvarReader_float2", reader, "reader", "float2 outputs:result")
    text = preview(inputs, more).replace("{\n", '{\nstring inputs:which = "second"\n', 1)
    found = texture(bound(tmp_path, text).base_colour)
    u, v = -0.75 * 4 + 0.5, (0.25 + 0.25) * 2 + 0.125
    np.testing.assert_allclose(np.array(found.transform) @ [0.25, 1 - 0.75, 1], [u, 1 - v])
    assert found.uv_set == 1
    sets = "texCoord2f[] primvars:st = [(0.25, 0.5)]\ntexCoord2f[] primvars:second = [(0.5, 0.125)]"
    part = model(tmp_path, text + mesh("rel material:binding = </m>\n" + sets)).parts[0]
    assert part.uvs[0][0].tolist() == [0.25, 0.5] and part.uvs[1][0].tolist() == [0.5, 0.875]


def test_colours_of_vertices_in_a_material(tmp_path: Path) -> None:
    inputs = "color3f inputs:diffuseColor.connect = </m/reader.outputs:result>"
    more = shader(
        "UsdPrimvarReader_float3", 'string inputs:varname = "displayColor"', "reader", "float3 outputs:result"
    )
    colours = "rel material:binding = </m>\ncolor3f[] primvars:displayColor = [(0, 1, 0)]"
    part = model(tmp_path, preview(inputs, more) + mesh(colours)).parts[0]
    assert part.material and part.material.vertex_colours and part.material.base_colour.factor == (1, 1, 1)
    assert part.colours is not None
    part = model(tmp_path, preview("") + mesh(colours)).parts[0]
    assert part.material and not part.material.vertex_colours and part.colours is None


def test_subsets_have_their_materials(tmp_path: Path) -> None:
    subset = """def GeomSubset "right" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </b>
    }
    rel material:binding = </a>"""
    text = preview("float inputs:roughness = 0", name="a") + preview("", name="b") + mesh(subset)
    first, second, _ = model(tmp_path, text).parts
    assert first.material and second.material and (first.material.name, second.material.name) == ("a", "b")
    assert first.vertices[:, 0].max() == 1 and second.vertices[:, 0].min() == 1
    # With a hole, materials stay with their faces.
    holes = text.replace("def GeomSubset", "int[] holeIndices = [0]\ndef GeomSubset")
    assert [part.material and part.material.name for part in model(tmp_path, holes).parts] == ["b", None]
    # A subset of all faces leaves none to the other material.
    text = text.replace("indices = [1]", "indices = [0, 1]")
    assert [part.material and part.material.name for part in model(tmp_path, text).parts] == ["b", None]


def test_a_package_holds_its_textures(tmp_path: Path) -> None:
    inputs = "color3f inputs:diffuseColor.connect = </m/image.outputs:rgb>"
    text = preview(inputs, image(file="textures/wood.png")) + mesh("rel material:binding = </m>")
    with zipfile.ZipFile(tmp_path / "scene.usdz", "w", zipfile.ZIP_STORED) as package:
        package.writestr("scene.usda", "#usda 1.0\n" + text)
        package.writestr("textures/wood.png", b"an image")
    found = read_stage(tmp_path / "scene.usdz").parts[0].material
    assert found is not None
    picture = texture(found.base_colour).picture
    assert picture.data == b"an image" and picture.name == "wood.png" and picture.path is None


# ------------------------------- Lights -------------------------------


def light(folder: Path, kind: str, inputs: str = "", place: str = "", api: str = "") -> Light:
    apis = f'(prepend apiSchemas = ["{api}"])' if api else ""
    (found,) = model(folder, f'def {kind} "lamp" {apis}\n{{\n{inputs}\n{place}\n}}\n').lights
    assert found.name == "lamp"
    return found


def scaled(x: float, y: float, z: float) -> str:
    return f'float3 xformOp:scale = ({x}, {y}, {z})\nuniform token[] xformOpOrder = ["xformOp:scale"]'


def test_flat_lights(tmp_path: Path) -> None:
    base = "float inputs:intensity = 3\nfloat inputs:exposure = 1\ncolor3f inputs:color = (1, 0.5, 0)\n"
    found = light(tmp_path, "RectLight", base + "float inputs:width = 2\nfloat inputs:height = 4")
    assert found.kind == "rectangle" and found.size == (2, 4) and found.colour == (6, 3, 0)
    sizes = "float inputs:width = 2\nfloat inputs:height = 4\nbool inputs:normalize = 1"
    found = light(tmp_path, "RectLight", base + sizes, scaled(3, 1, 5))
    np.testing.assert_allclose(found.colour, np.array([6, 3, 0]) / 24)
    np.testing.assert_allclose(np.diag(found.matrix), [3, 1, 5, 1])
    found = light(tmp_path, "DiskLight", base + "float inputs:radius = 2\nbool inputs:normalize = 1", scaled(2, 2, 2))
    assert found.kind == "disk" and found.size == (4, 4)
    np.testing.assert_allclose(found.colour, np.array([6, 3, 0]) / (16 * np.pi))


def test_spheres_points_and_spots(tmp_path: Path) -> None:
    found = light(tmp_path, "SphereLight", "float inputs:radius = 0.25\nfloat inputs:intensity = 4")
    assert found.kind == "sphere" and found.size == (0.5, 0.5) and found.colour == (4, 4, 4)
    normalised = "bool inputs:normalize = 1\nfloat inputs:radius = 0.25\nfloat inputs:intensity = 4\n"
    found = light(tmp_path, "SphereLight", normalised, scaled(2, 2, 2))
    np.testing.assert_allclose(found.colour, [4 / (4 * np.pi * 0.5**2)] * 3)
    # From afar, the same light as that of the sphere: its radiance on a disk.
    point = "bool treatAsPoint = 1\n"
    found = light(tmp_path, "SphereLight", normalised + point, scaled(2, 2, 2))
    assert found.kind == "point" and found.colour == (1, 1, 1)
    found = light(tmp_path, "SphereLight", point + "float inputs:radius = 0.5\nfloat inputs:intensity = 4")
    np.testing.assert_allclose(found.colour, [np.pi] * 3)
    cone = "float inputs:shaping:cone:angle = 60\nfloat inputs:shaping:cone:softness = 0.25\n"
    found = light(tmp_path, "SphereLight", normalised + point + cone, api="ShapingAPI")
    assert found.kind == "spot"
    np.testing.assert_allclose(found.cone, np.radians([45, 60]))
    with pytest.warns(SceneWarning, match="the cones of lights that are no points are not shown"):
        assert light(tmp_path, "SphereLight", cone, api="ShapingAPI").kind == "sphere"


def test_the_sun(tmp_path: Path) -> None:
    found = light(tmp_path, "DistantLight")
    assert found.kind == "distant" and found.angle == pytest.approx(np.radians(0.53))
    np.testing.assert_allclose(found.colour, [50000 * np.pi * np.sin(np.radians(0.265)) ** 2] * 3, rtol=1e-5)
    found = light(tmp_path, "DistantLight", "float inputs:intensity = 2\nbool inputs:normalize = 1")
    assert found.colour == (2, 2, 2)
    found = light(tmp_path, "DistantLight", "float inputs:intensity = 2\nfloat inputs:angle = 0")
    assert found.colour == (2, 2, 2) and found.angle == 0


def test_the_temperature_of_a_light(tmp_path: Path) -> None:
    warm = "float inputs:colorTemperature = 3000\nbool inputs:enableColorTemperature = "
    assert light(tmp_path, "RectLight", warm + "0").colour == (1, 1, 1)
    r, g, b = light(tmp_path, "RectLight", warm + "1").colour
    assert r > 1 > g > b


def seen(found: Light, u: float, v: float) -> np.ndarray:
    """The direction in which the scene sees a place of the map: in the light's frame, its middle is along -z."""
    phi, theta = 2 * np.pi * (u - 0.5), np.pi * v
    local = np.array([np.sin(phi) * np.sin(theta), np.cos(theta), -np.cos(phi) * np.sin(theta)])
    return np.asarray(np.round(found.matrix[:3, :3] @ local, 9))


def test_a_dome_is_turned_as_openexr_says(tmp_path: Path) -> None:
    """Its "Latitude-Longitude Map": longitude 0, in the middle, is along z, and longitude 90, on the left, along x."""
    (tmp_path / "sky.exr").write_bytes(b"")
    found = light(tmp_path, "DomeLight", "asset inputs:texture:file = @sky.exr@\nfloat inputs:intensity = 2")
    assert found.kind == "dome" and found.colour == (2, 2, 2)
    assert found.picture and found.picture.path == tmp_path / "sky.exr"
    assert seen(found, 0.5, 0.5).tolist() == [0, 0, 1]
    assert seen(found, 0.25, 0.5).tolist() == [1, 0, 0]
    assert seen(found, 0.3, 0).tolist() == [0, 1, 0]
    assert light(tmp_path, "DomeLight").picture is None
    with pytest.warns(SceneWarning, match=r"the map of a light is not there, which is shown in one colour \(no.exr\)"):
        assert light(tmp_path, "DomeLight", "asset inputs:texture:file = @no.exr@").picture is None


@pytest.mark.parametrize(
    ("pole", "up", "expected"), [("scene", "Z", "Z"), ("scene", "Y", "Y"), ("Z", "Y", "Z"), ("Y", "Z", "Y")]
)
def test_the_pole_of_a_dome(tmp_path: Path, pole: str, up: str, expected: str) -> None:
    found = model(tmp_path, f'def DomeLight_1 "lamp"\n{{\nuniform token poleAxis = "{pole}"\n}}\n', f'upAxis = "{up}"')
    top, middle = seen(found.lights[0], 0.5, 0), seen(found.lights[0], 0.5, 0.5)
    assert top.tolist() == ([0, 0, 1] if expected == "Z" else [0, 1, 0])
    assert middle.tolist() == ([0, -1, 0] if expected == "Z" else [0, 0, 1])


def test_lights_that_are_not_shown(tmp_path: Path) -> None:
    with pytest.warns(SceneWarning, match="lights of the type CylinderLight are not shown"):
        assert not model(tmp_path, 'def CylinderLight "a"\n{\n}\n').lights
    with pytest.warns(SceneWarning, match="the textures of lights are not shown"):
        light(tmp_path, "RectLight", "asset inputs:texture:file = @a.png@")
    assert not model(tmp_path, 'def RectLight "a"\n{\ntoken visibility = "invisible"\n}\n').lights


# ------------------------------- Cameras -------------------------------


def test_cameras(tmp_path: Path) -> None:
    text = """def Camera "main"
{
    float focalLength = 50
    float horizontalAperture = 40
    float verticalAperture = 20
    float fStop = 2.5
    float focusDistance = 7
    double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Camera "flat"
{
    token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 20
}
"""
    main, flat = model(tmp_path, text).cameras
    assert main.name == "main" and main.height is None and main.aspect == 2 and main.matrix[2, 3] == 9
    assert main.fov == pytest.approx(2 * np.arctan(10 / 50))
    # Tenths of the scene's unit: a lens of 5 with a stop of 2.5 is 2 wide.
    assert main.aperture == pytest.approx(1) and main.focus == 7
    assert flat.height == pytest.approx(2) and flat.aperture == 0 and flat.focus is None
    with pytest.warns(SceneWarning, match=r"cameras without a film or a focal length are left out \(/bad\)"):
        assert not model(tmp_path, 'def Camera "bad"\n{\nfloat focalLength = 0\n}\n').cameras
