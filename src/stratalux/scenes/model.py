"""What a file says: shapes and where they stand, what they are made of, lights and cameras. Readers make it of files.

Numbers are those of the file: its lengths, its coordinates. Colours are linear Rec. 709.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.floating[Any]]
Indices = npt.NDArray[np.integer[Any]]
Colour = tuple[float, float, float]
Wrap = Literal["repeat", "mirror", "clamp"]

# ------------------------------- What things are made of -------------------------------


@dataclass(frozen=True)
class Picture:
    """The image of a texture: a file at `path`, or the bytes `data` of one. `name`: what messages call it."""

    name: str
    path: Path | None = None
    data: bytes | None = field(default=None, repr=False)


@dataclass(frozen=True)
class Texture:
    """An image on a surface. (0, 0) is the upper left corner of the image, and v goes down (as in glTF).

    `curve`: "srgb" for colours, "linear" for all other numbers; "auto": what the file itself says. `wrap`: what is
    beyond its edges along u, and along v. `nearest`: texels are not interpolated. `uv_set`: the coordinates of the part
    that it uses, and `transform` (2, 3), which is applied to them (u, v, 1) first.
    """

    picture: Picture
    curve: Literal["srgb", "linear", "auto"] = "linear"
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    nearest: bool = False
    uv_set: int = 0
    transform: tuple[tuple[float, float, float], tuple[float, float, float]] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@dataclass(frozen=True)
class Value:
    """A number or a colour that may differ from place to place: `factor` * texels, + `offset`.

    `factor` and `offset` have one number, or three for a colour. `channels` of the texture that are taken: "rgb", or
    one of "r", "g", "b" and "a". Without a texture, it is `factor` + `offset` everywhere.
    """

    factor: tuple[float, ...] = (1.0,)
    texture: Texture | None = None
    channels: Literal["rgb", "r", "g", "b", "a"] = "rgb"
    offset: tuple[float, ...] = (0.0,)


ONE, NONE = Value((1.0,)), Value((0.0,))
WHITE, BLACK = Value((1.0, 1.0, 1.0)), Value((0.0, 0.0, 0.0))


@dataclass(frozen=True)
class SpecularGlossiness:
    """The older description of a surface: matte colour, colour of the reflection at right angles, 1 - roughness."""

    diffuse: Value = WHITE
    specular: Value = WHITE
    glossiness: Value = ONE


@dataclass(frozen=True)
class Material:
    """What a surface looks like, in the terms of glTF 2.0 and of its KHR_materials extensions.

    `base_colour`, `metallic`, `roughness` (whose square is the α of GGX): section 3.9.2. `specular_glossiness`, where
    the file describes the surface so, takes the place of these three. `vertex_colours`: those of the part are factors
    of the base colour, and of `alpha`. `alpha_mode`: whether `alpha` is ignored, is the share of light that does not
    pass straight through ("blend"), or decides with `alpha_cutoff` whether anything is there ("mask").
    `normal`: a map of normals in the tangent frame, x to the right and y up in its image; its factors scale (x, y).
    `bump`: heights in lengths of the file, of a file that has these instead. `emission`: radiance. `unlit`: what is
    seen is the base colour. `clearcoat_roughness`, `sheen_roughness` and `anisotropy_rotation` (radians, counter-
    clockwise from the tangent) are as in their extensions. `transmission` is what is refracted rather than diffuse,
    `attenuation` the colour that white light has after `attenuation_distance` within, and `thin`, that nothing is bent
    since there is no inside.
    """

    name: str = ""
    base_colour: Value = WHITE
    metallic: Value = ONE
    roughness: Value = ONE
    specular_glossiness: SpecularGlossiness | None = None
    vertex_colours: bool = True
    alpha: Value = ONE
    alpha_mode: Literal["opaque", "mask", "blend"] = "opaque"
    alpha_cutoff: float = 0.5
    double_sided: bool = True
    normal: Value | None = None
    bump: Value | None = None
    emission: Value = BLACK
    unlit: bool = False
    ior: float = 1.5
    specular: Value = ONE
    specular_colour: Value = WHITE
    clearcoat: Value = NONE
    clearcoat_roughness: Value = NONE
    clearcoat_normal: Value | None = None
    sheen_colour: Value = BLACK
    sheen_roughness: Value = NONE
    anisotropy: Value = NONE
    anisotropy_rotation: float = 0.0
    transmission: Value = NONE
    thin: bool = True
    attenuation: Colour = (1.0, 1.0, 1.0)
    attenuation_distance: float = float("inf")


# ------------------------------- Shapes -------------------------------


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles that belong together, of one material, in double precision.

    `vertices` (V, 3) float64 positions, `faces` (F, 3) int64 indices into them, counter-clockwise seen from outside,
    `normals` (V, 3) float64 shading normals of any length, or None where the file brings none. NaN stands for a normal
    that a vertex of the file does not have. `uvs`: coordinates (V, 2) of textures, by the numbers of their sets, in the
    sense of :class:`Texture`. `colours` (V, 4): linear, with alpha. `tangents` (V, 4): the direction of u, and the
    sign of the bitangent, as in glTF. `material`: None where the file says nothing of it. `name`: of messages.
    `flat`: all edges are sharp where there are no normals, instead of those that bend much.
    """

    vertices: Floats
    faces: Indices
    normals: Floats | None = None
    uvs: Mapping[int, Floats] = field(default_factory=dict)
    colours: Floats | None = None
    tangents: Floats | None = None
    material: Material | None = None
    name: str = ""
    flat: bool = False


@dataclass(frozen=True, eq=False)
class Instance:
    """One place of a part in the scene: the `part`'s index, and the affine (4, 4) `matrix` that takes it there."""

    part: int
    matrix: Floats


# ------------------------------- Lights and cameras -------------------------------


@dataclass(frozen=True, eq=False)
class Light:
    """A lamp. Its `matrix` (4, 4) takes it to the scene; it shines along its own -z, and x is to its right.

    `colour` (3,): of a "point" or a "spot" its intensity in W/sr; of a "distant" light its irradiance in W/m² on what
    faces it; of a "rectangle" (of `size`: width and height), a "disk" and a "sphere" (of `size`: its diameter, twice)
    its radiance; of a "dome" a factor of the map `picture`, whose y is up and whose middle is along -z. Of a "spot"
    `cone` is the angle, in radians from the axis, up to which it is as bright as on the axis, and the one at which
    nothing is left. Of a "distant" light `angle` is the diameter in radians that it has in the sky.
    """

    kind: Literal["point", "spot", "distant", "rectangle", "disk", "sphere", "dome"]
    matrix: Floats
    colour: Colour
    name: str = ""
    size: tuple[float, float] = (1.0, 1.0)
    cone: tuple[float, float] = (0.0, np.pi / 4)
    angle: float = 0.0
    picture: Picture | None = None


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera that looks along its own -z, with y up. Its `matrix` (4, 4) takes it to the scene.

    `fov`: vertical, in radians; or `height`, of what an orthographic camera sees. `aspect`: width over height, None
    where the film decides. `aperture`: radius of the lens, and `focus`: distance of what is sharp.
    """

    matrix: Floats
    name: str = ""
    fov: float = np.radians(30.0)
    height: float | None = None
    aspect: float | None = None
    aperture: float = 0.0
    focus: float | None = None


@dataclass(frozen=True, eq=False)
class Model:
    """All that a file holds. A part may have several instances, and all of them share its triangles.

    `up`: the axis that points up. `metres`: the length of a unit, None where nobody says.
    """

    parts: Sequence[Part]
    instances: Sequence[Instance]
    lights: Sequence[Light] = ()
    cameras: Sequence[Camera] = ()
    up: str = "y"
    metres: float | None = None

    @classmethod
    def of(cls, *parts: Part, **more: Any) -> Model:
        """Parts that stand where their own coordinates say; `more` as the fields are called."""
        return cls(parts, [Instance(index, np.eye(4)) for index in range(len(parts))], **more)
