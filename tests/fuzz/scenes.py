"""Mitsuba scenes of every kind, and what damage may make of them: always the same of the same number."""

from __future__ import annotations

import random
import re
from pathlib import Path

import mitsuba as mi
import numpy as np

from tests.helpers import hall_map
from tests.images.make import write

_INTEGERS = (
    "0",
    "-1",
    "1",
    "2",
    "3",
    "17",
    "65536",
    "100000",
    "2147483647",
    "-2147483648",
    "4294967296",
    "0x10",
    "9" * 30,
)
_NUMBERS = (
    "0",
    "-1",
    "1",
    "2",
    "1e300",
    "-1e300",
    "nan",
    "inf",
    "-inf",
    "1e-300",
    "1e9",
    "1e38",
    "1e20",
    "1e-40",
    "0.5",
    "",
)
_TEXTS = ("", " ", "x" * 300, "a b c", "true", "\u00e9\u4e2d", "$missing", "${", "%s%n", "../..", "/", "folder", "1 2")
_FILES = (
    "none.exr",
    "folder",
    "text.png",
    "empty.exr",
    "map.exr",
    "texture.png",
    "/dev/null",
    "x" * 300,
    "",
    "mesh.ply",
)
_FILES += (
    "ellipsoids.ply",
    "broken.ply",
    "broken.obj",
    "curve.txt",
    "broken.txt",
    "grid.vol",
    "broken.vol",
    "none\u4e2d.ply",
    "scene.xml",
    "cut.exr",
    "cut.png",
    "window.exr",
    "half.exr",
)
_NAMES = ("value", "x", "y", "z", "origin", "target", "up", "type", "name", "id", "version", "angle", "filename")
_ATTRIBUTE = re.compile(rf'\b({"|".join(_NAMES)})="([^"]*)"')
_TAG = re.compile(r"<(\w+)[^<>]*/>")


def _(tag: str, kind: str, *inside: str) -> str:
    return f'<{tag} type="{kind}">{"".join(inside)}</{tag}>'


def _p(tag: str, name: str, value: object) -> str:
    return f'<{tag} name="{name}" value="{value}"/>'


def _texture(kind: str, *inside: str, name: str = "reflectance") -> str:
    return f'<texture type="{kind}" name="{name}">{"".join(inside)}</texture>'


_MAP = '<string name="filename" value="map.exr"/>'
_PICTURE = '<string name="filename" value="texture.png"/>'
_TURN = '<transform name="to_world"><rotate y="1" angle="40"/></transform>'
_LOOK = '<transform name="to_world"><lookat origin="0, 1, -6" target="0, 0, 0" up="0, 1, 0"/></transform>'
_RGB = '<rgb name="reflectance" value="0.7, 0.5, 0.3"/>'
_DIFFUSE = _("bsdf", "diffuse", _RGB)
_CAMERA = _p("float", "near_clip", 0.1) + _p("float", "far_clip", 100)

RFILTERS = (
    *(_("rfilter", kind) for kind in ("box", "tent", "mitchell", "catmullrom", "lanczos")),
    _("rfilter", "gaussian", _p("float", "stddev", 0.5)),
)
FILMS = (
    ("hdrfilm", _p("string", "pixel_format", "rgba")),
    ("hdrfilm", _p("string", "pixel_format", "luminance") + _p("string", "component_format", "float32")),
    ("hdrfilm", _p("string", "file_format", "openexr") + _p("boolean", "sample_border", "true")),
    (
        "hdrfilm",
        _p("integer", "crop_width", 4)
        + _p("integer", "crop_height", 3)
        + _p("integer", "crop_offset_x", 2)
        + _p("integer", "crop_offset_y", 1),
    ),
    ("hdrfilm", ""),
    ("specfilm", '<spectrum name="band1" value="500:0.5, 600:1"/>'),
)
SAMPLERS = tuple(
    _("sampler", kind, _p("integer", "sample_count", count))
    for kind, count in (
        ("independent", 1),
        ("stratified", 4),
        ("multijitter", 4),
        ("orthogonal", 4),
        ("ldsampler", 4),
    )
)
SENSORS = (
    ("perspective", _LOOK + _CAMERA + _p("float", "fov", 40) + _p("string", "fov_axis", "smaller")),
    ("perspective", _LOOK + _p("string", "focal_length", "50mm") + _p("float", "principal_point_offset_x", 0.1)),
    ("thinlens", _LOOK + _CAMERA + _p("float", "aperture_radius", 0.1) + _p("float", "focus_distance", 6)),
    ("orthographic", _LOOK + _CAMERA),
    ("batch", '<sensor type="perspective"><film type="hdrfilm"/></sensor>'),
)
BSDFS = (
    _DIFFUSE,
    _("bsdf", "diffuse", _texture("bitmap", _PICTURE, _p("string", "filter_type", "nearest"))),
    _("bsdf", "diffuse", _texture("checkerboard", '<rgb name="color0" value="0.2"/>')),
    _("bsdf", "diffuse", _texture("mesh_attribute", _p("string", "name", "vertex_color"))),
    _(
        "bsdf",
        "diffuse",
        _texture("volume", f'<volume type="constvolume" name="volume">{_p("float", "value", 0.5)}</volume>'),
    ),
    _("bsdf", "conductor", _p("string", "material", "Au")),
    _("bsdf", "roughconductor", _p("float", "alpha", 0.2) + _p("string", "distribution", "ggx")),
    _("bsdf", "roughconductor", _p("spectrum", "eta", "400:1.5, 700:0.3") + _p("spectrum", "k", 3)),
    _("bsdf", "dielectric", _p("string", "int_ior", "bk7") + _p("float", "ext_ior", 1)),
    _("bsdf", "thindielectric", _p("float", "int_ior", 1.5)),
    _("bsdf", "roughdielectric", _p("float", "alpha", 0.2)),
    _("bsdf", "plastic", _p("float", "int_ior", 1.9) + '<rgb name="diffuse_reflectance" value="0.1, 0.4, 0.2"/>'),
    _("bsdf", "roughplastic", _p("float", "alpha", 0.3) + _p("boolean", "nonlinear", "true")),
    _("bsdf", "principled", _p("float", "roughness", 0.4) + _p("float", "metallic", 0.5) + _p("float", "clearcoat", 1)),
    _("bsdf", "principledthin", _p("float", "spec_trans", 0.4) + _p("float", "eta", 1.4)),
    _("bsdf", "twosided", _DIFFUSE),
    _("bsdf", "mask", _p("float", "opacity", 0.5) + _DIFFUSE),
    _("bsdf", "blendbsdf", _p("float", "weight", 0.3) + _DIFFUSE + _("bsdf", "conductor")),
    _("bsdf", "bumpmap", _texture("bitmap", _PICTURE, name="arbitrary") + _p("float", "scale", 2) + _DIFFUSE),
    _("bsdf", "normalmap", _texture("bitmap", _PICTURE, _p("boolean", "raw", "true"), name="normalmap") + _DIFFUSE),
    _("bsdf", "pplastic", _p("float", "alpha", 0.2)),
    _("bsdf", "null"),
    '<ref id="material"/>',
)
SHAPES = (
    ("sphere", '<point name="center" x="0" y="0" z="0"/>' + _p("float", "radius", 1)),
    ("cube", '<transform name="to_world"><scale value="0.7"/><rotate y="1" angle="30"/></transform>'),
    ("rectangle", '<transform name="to_world"><rotate x="1" angle="-90"/><scale x="4" y="4" z="4"/></transform>'),
    ("disk", _p("boolean", "flip_normals", "true")),
    (
        "cylinder",
        '<point name="p0" x="0" y="-1" z="0"/><point name="p1" x="0" y="1" z="0"/>' + _p("float", "radius", 1),
    ),
    ("ply", '<string name="filename" value="mesh.ply"/>' + _p("boolean", "face_normals", "true")),
    ("obj", '<string name="filename" value="mesh.obj"/>' + _p("boolean", "flip_tex_coords", "true")),
    ("linearcurve", '<string name="filename" value="curve.txt"/>'),
    ("bsplinecurve", '<string name="filename" value="curve.txt"/>'),
    ("ellipsoids", '<string name="filename" value="ellipsoids.ply"/>'),
    ("sdfgrid", '<string name="filename" value="grid.vol"/>' + _p("string", "normals", "smooth")),
    ("instance", '<ref id="group"/><transform name="to_world"><translate x="1"/></transform>'),
    ("merge", _("shape", "cube") + _("shape", "cube")),
)
EMITTERS = (
    _("emitter", "envmap", _MAP, _TURN, _p("float", "scale", 2)),
    _(
        "emitter",
        "envmap",
        _MAP,
        '<transform name="to_world"><matrix value="1 0 0 0 0 0 1 0 0 -1 0 0 0 0 0 1"/></transform>',
    ),
    _("emitter", "envmap", _MAP, _p("boolean", "mis_compensation", "true")),
    _("emitter", "constant", '<rgb name="radiance" value="1, 2, 3"/>'),
    _("emitter", "sunsky", _p("float", "turbidity", 3), '<vector name="sun_direction" x="0.3" y="0.8" z="0.1"/>'),
    _("emitter", "point", '<point name="position" x="1" y="3" z="-2"/>', '<rgb name="intensity" value="5"/>'),
    _("emitter", "spot", _p("float", "cutoff_angle", 30), _LOOK, '<rgb name="intensity" value="9"/>'),
    _(
        "emitter",
        "directional",
        '<vector name="direction" x="0" y="-1" z="0.2"/>',
        '<rgb name="irradiance" value="2"/>',
    ),
    _("emitter", "directionalarea", '<rgb name="radiance" value="2"/>'),
    _("emitter", "projector", _LOOK, _texture("bitmap", _PICTURE, name="irradiance")),
    _(
        "shape",
        "sphere",
        '<point name="center" x="0" y="4" z="0"/>',
        _("emitter", "area", '<rgb name="radiance" value="9"/>'),
    ),
    _("shape", "sphere", _("emitter", "area", _p("float", "sampling_weight", 0) + _p("spectrum", "radiance", 3)))
    + _("emitter", "constant"),
    "",
)
INTEGRATORS = (
    _("integrator", "path", _p("integer", "max_depth", 5) + _p("boolean", "hide_emitters", "true")),
    _("integrator", "direct", _p("integer", "emitter_samples", 2)),
    _("integrator", "direct_stratified", _p("integer", "strata", 4) + _p("integer", "proposals", 2)),
    _("integrator", "volpath", ""),
    _("integrator", "aov", _p("string", "aovs", "dd:depth,nn:sh_normal") + _("integrator", "direct")),
    _("integrator", "depth", ""),
    "",
)
MORE = (
    "",
    '<default name="spp" value="4"/>',
    '<include filename="more.xml"/>',
    '<include filename="scene.xml"/>',
    '<alias id="material" as="other"/>',
    '<path value="folder"/>',
    _("medium", "homogeneous", _p("float", "scale", 2)),
    _(
        "medium",
        "heterogeneous",
        '<volume type="gridvolume" name="albedo"><string name="filename" value="grid.vol"/></volume>',
    ),
    _("texture", "bitmap", _PICTURE),
    _("shape", "instance"),
    "<!-- words -->",
    "words",
    _("phase", "hg", _p("float", "g", 0.3)),
)


def make_files(folder: Path) -> None:
    """What the scenes name: files that are sound, and some that are not."""
    (folder / "folder").mkdir(exist_ok=True)
    mi.Bitmap(hall_map(8, 16)).write(str(folder / "map.exr"))
    mi.Bitmap(np.arange(4 * 4 * 3, dtype=np.uint8).reshape(4, 4, 3)).write(str(folder / "texture.png"))
    for name in ("map.exr", "texture.png"):
        content = (folder / name).read_bytes()
        (folder / f"cut{name[-4:]}").write_bytes(content[: len(content) * 3 // 4])
    write(folder / "window.exr", hall_map(12, 24), at=(-3, -2), display=(0, 0, 16, 8))
    with np.errstate(over="ignore"):
        write(folder / "half.exr", 1e4 * hall_map(8, 16), type="half")
    (folder / "text.png").write_text("words")
    (folder / "empty.exr").write_bytes(b"")
    (folder / "mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    (folder / "broken.obj").write_text("v 0 0 0\nv nan 0 0\nv 0 1\nf 1 2 9\nf 1 -7 2\n")
    ply = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    ply += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (folder / "mesh.ply").write_text(ply + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    (folder / "broken.ply").write_text(ply + "0 0 0\n1 0 0\n0 inf 0\n3 0 1 7\n")
    names = [*"xyz", "nx", "ny", "nz", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    ellipsoids = "".join(f"property float {name}\n" for name in names)
    ellipsoids = f"ply\nformat ascii 1.0\nelement vertex 1\n{ellipsoids}end_header\n0 0 0 0 0 0 0 0 0 1 0 0 0\n"
    (folder / "ellipsoids.ply").write_text(ellipsoids)
    (folder / "curve.txt").write_text("0 0 0 0.1\n0 1 0 0.1\n1 1 0 0.1\n1 2 0 0.1\n")
    (folder / "broken.txt").write_text("0 0 nan 0.1\n0 1\n1 1 0 -1\n")
    grid = np.linspace(-1, 1, 8, dtype=np.float32).reshape(2, 2, 2, 1)
    mi.VolumeGrid(grid).write(str(folder / "grid.vol"))
    (folder / "broken.vol").write_bytes((folder / "grid.vol").read_bytes()[:40])
    (folder / "more.xml").write_text(f'<scene version="3.0.0">{_("shape", "cube")}</scene>')


def sound_scene(number: int) -> str:
    """A scene as the number says, before anything is done to it."""
    chance = random.Random(number)
    film, about = chance.choice(FILMS if chance.random() < 0.2 else FILMS[:-1])
    size = _p("integer", "width", 12) + _p("integer", "height", 8)
    pick = chance.choice
    sensors = []
    for _number in range(1 if chance.random() < 0.9 else chance.choice((0, 2, 2, 3, 3))):
        kind, inside = pick(SENSORS)
        sensors.append(_("sensor", kind, inside, _("film", film, size, about, pick(RFILTERS)), pick(SAMPLERS)))
    shapes = []
    for _number in range(chance.choice((1, 1, 2, 3))):
        kind, inside = pick(SHAPES)
        shapes.append(_("shape", kind, inside, pick(BSDFS) if kind not in ("instance", "merge") else ""))
    group = '<shape type="shapegroup" id="group"><shape type="sphere"/></shape>'
    material = '<bsdf type="diffuse" id="material"/>'
    parts = [material, *shapes, *(pick(EMITTERS) for _number in range(chance.choice((1, 1, 1, 2)))), *sensors]
    if chance.random() < 0.2:
        parts.append(pick(MORE))
    if any('type="instance"' in shape for shape in shapes):
        parts.insert(0, group)
    return f'<scene version="3.0.0">{pick(INTEGRATORS)}{"".join(parts)}</scene>'


def damaged_scene(number: int) -> bytes:
    """The scene of the number, with one of many kinds of damage."""
    chance = random.Random(-1 - number)
    text = sound_scene(number)
    kind = chance.random()
    if kind < 0.1:
        return text.encode()
    if kind < 0.7:
        for _number in range(chance.choice((1, 1, 1, 2, 3))):
            text = _with_another_value(text, chance)
        return text.encode("utf-8" if chance.random() < 0.97 else "utf-16")
    if kind < 0.85:
        return _with_other_elements(text, chance).encode()
    content = bytearray(text.encode())
    if kind < 0.9:
        return bytes(content[: chance.randrange(len(content))])
    for _number in range(chance.choice((1, 1, 2, 4, 16))):
        at = chance.randrange(len(content))
        content[at] = content[at] ^ (1 << chance.randrange(8)) if chance.random() < 0.5 else chance.randrange(256)
    return bytes(content)


def _with_another_value(text: str, chance: random.Random) -> str:
    place = chance.choice(list(_ATTRIBUTE.finditer(text)))
    name, value = place[1], place[2]
    tag = text[text.rfind("<", 0, place.start()) : place.start()]
    parts = re.split(r"[\s,]+", value)
    if "filename" in tag + name:
        other = chance.choice(_FILES)
    elif name in ("type", "name", "id"):
        others = [match[2] for match in _ATTRIBUTE.finditer(text) if match[1] == name]
        other = chance.choice((chance.choice(others), chance.choice(others), chance.choice(_TEXTS), "nonsense"))
    elif chance.random() < 0.1:
        other = chance.choice((*_TEXTS, *_NUMBERS, *_FILES))
    elif tag.startswith("<boolean"):
        other = chance.choice(("true", "false"))
    elif tag.startswith("<integer"):
        other = chance.choice(_INTEGERS)
    elif re.search(r"[a-df-z]", value):
        other = chance.choice(_TEXTS)
    elif len(parts) > 1 and chance.random() < 0.8:
        parts[chance.randrange(len(parts))] = chance.choice(_NUMBERS[:-1])
        other = ", ".join(parts)
    else:
        other = chance.choice(_NUMBERS)
    return text[: place.start(2)] + other + text[place.end(2) :]


def _with_other_elements(text: str, chance: random.Random) -> str:
    """An element is left out, doubled, moved, or comes under another name."""
    tags = list(_TAG.finditer(text))
    one, two = chance.choice(tags), chance.choice(tags)
    how = chance.random()
    if how < 0.25:
        return text[: one.start()] + text[one.end() :]
    if how < 0.5:
        return text[: one.start()] + one[0] * chance.choice((2, 3, 300)) + text[one.end() :]
    if how < 0.8:
        return text[: one.start()] + two[0] + text[one.end() :]
    kinds = (
        "integer",
        "float",
        "string",
        "boolean",
        "rgb",
        "spectrum",
        "vector",
        "ref",
        "transform",
        "nonsense",
        "shape",
    )
    return text[: one.start(1)] + chance.choice(kinds) + text[one.end(1) :]
