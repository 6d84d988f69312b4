"""The materials of a stage that are a UsdPreviewSurface.

Source: OpenUSD, "UsdPreviewSurface Specification", version 2.6.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from pxr import Gf, Sdf, Usd, UsdShade

from ...model import NONE, ONE, WHITE, Material, SpecularGlossiness, Texture, Value, Wrap
from .assets import Assets
from .notes import Notes

_Matrix = tuple[tuple[float, float, float], tuple[float, float, float]]
_WRAPS: dict[str, Wrap] = {"repeat": "repeat", "mirror": "mirror", "clamp": "clamp", "black": "clamp"}
"""How a texture goes on beyond its edges; by default it repeats, as in most programs."""
_FLIP = np.array([[1.0, 0, 0], [0, -1, 1], [0, 0, 1]])
"""v goes up in USD, and down in a model."""


class Sets:
    """The numbers of sets of coordinates, by the names that they have in a file."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {"st": 0}

    def number(self, name: str) -> int:
        """That of a name, which is a new one for a new name."""
        return self._numbers.setdefault(name, len(self._numbers))


@dataclass(frozen=True)
class Materials:
    """Makes materials of those of a stage, each of them once."""

    time: Usd.TimeCode
    assets: Assets
    sets: Sets
    notes: Notes
    known: dict[str, Material | None]

    def bound(self, prim: Usd.Prim) -> Material | None:
        """The material of a prim, a part of a mesh or a whole one; None where it has none that can be read."""
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(UsdShade.Tokens.full)
        if not material:
            return None
        own = material.GetPrim()
        path = str((own.GetPrimInPrototype() if own.IsInstanceProxy() else own).GetPath())
        if path not in self.known:
            self.known[path] = self._material(material, own.GetName())
        return self.known[path]

    def _material(self, material: UsdShade.Material, name: str) -> Material | None:
        shader, _, _ = material.ComputeSurfaceSource()
        if not shader or shader.GetShaderId() != "UsdPreviewSurface":
            self.notes.add("materials without a UsdPreviewSurface are not shown", material.GetPath())
            return None
        return _Surface(self, shader, name).material()


class _Surface:
    """A shader, and what becomes of its inputs."""

    def __init__(self, context: Materials, shader: UsdShade.Shader, name: str) -> None:
        self._context, self._shader, self._name = context, shader, name
        self._shows_colours = False

    def material(self) -> Material:
        base, rough = self._colour("diffuseColor", 0.18), self._scalar("roughness", 0.5)
        found = Material(
            self._name,
            base_colour=base,
            metallic=self._scalar("metallic", 0.0),
            roughness=rough,
            vertex_colours=self._shows_colours,
            normal=self._normal(),
            emission=self._colour("emissiveColor", 0.0),
            ior=float(self._constant("ior", 1.5)),
            clearcoat=self._scalar("clearcoat", 0.0),
            clearcoat_roughness=self._scalar("clearcoatRoughness", 0.01),
        )
        if self._constant("useSpecularWorkflow", 0):
            inverse = replace(
                rough, factor=tuple(-f for f in rough.factor), offset=tuple(1 - each for each in rough.offset)
            )
            glossiness = inverse if rough.texture else Value((1 - rough.factor[0],))
            specular = self._colour("specularColor", 0.0)
            found = replace(found, metallic=NONE, specular_glossiness=SpecularGlossiness(base, specular, glossiness))
        displacement = self._scalar("displacement", 0.0)
        if displacement.texture or displacement.factor[0]:
            self._context.notes.add("displacement is not shown", self._shader.GetPath())
        return self._transparent(found)

    def _transparent(self, found: Material) -> Material:
        alpha = self._scalar("opacity", 1.0)
        cutoff = float(self._constant("opacityThreshold", 0.0))
        is_opaque = not alpha.texture and alpha.factor[0] >= 1
        if is_opaque and not self._shows_colours:
            return found
        if cutoff > 0:
            return replace(found, alpha=alpha, alpha_mode="mask", alpha_cutoff=cutoff)
        if not alpha.texture and alpha.factor[0] <= 0 and self._constant("opacityMode", "transparent") != "presence":
            # What does not scatter still reflects.
            clear = None if found.specular_glossiness is None else replace(found.specular_glossiness, diffuse=WHITE)
            return replace(found, base_colour=WHITE, specular_glossiness=clear, transmission=ONE)
        return found if is_opaque else replace(found, alpha=alpha, alpha_mode="blend")

    def _colour(self, name: str, default: float) -> Value:
        source = self._source(self._shader, name)
        if source is None:
            return Value((default,) * 3)
        if isinstance(source, tuple):
            return self._connected(source[0], source[1], (default,) * 3, name)
        return Value(tuple(float(each) for each in source))

    def _scalar(self, name: str, default: float) -> Value:
        source = self._source(self._shader, name)
        if source is None:
            return Value((default,))
        if isinstance(source, tuple):
            return self._connected(source[0], source[1], (default,), name)
        return Value((float(source),))

    def _normal(self) -> Value | None:
        """A map of normals: twice its texels less 1, up to a scale."""
        source = self._source(self._shader, "normal")
        if not isinstance(source, tuple):
            return None
        value = self._connected(source[0], "rgb", (1.0,) * 3, "normal")
        if value.texture is None:
            return None
        # Files that leave scale and bias out mean the usual ones.
        scale = value.factor if value.offset != (0.0,) * 3 else (2.0,) * 3
        x, y, z = (each / 2 for each in scale)
        return Value((x,) if x == y == z else (x, y, z), value.texture)

    def _connected(self, shader: UsdShade.Shader, output: str, default: tuple[float, ...], name: str) -> Value:
        """What a shader gives to an input of that `name`."""
        kind = str(shader.GetShaderId())
        if kind == "UsdUVTexture":
            return self._texture(shader, output, default, name)
        if kind.startswith("UsdPrimvarReader"):
            variable = str(self._value(shader, "varname", ""))
            if variable in ("displayColor", "displayOpacity"):
                self._shows_colours = True
                return Value((1.0,) * len(default))
        self._context.notes.add(f"the shader {kind or 'without a name'} is not supported", shader.GetPath())
        return Value(default)

    def _texture(self, shader: UsdShade.Shader, output: str, default: tuple[float, ...], name: str) -> Value:
        asset = self._value(shader, "file", None)
        picture = self._context.assets.picture(asset) if isinstance(asset, Sdf.AssetPath) else None
        fallback = self._value(shader, "fallback", None)
        channel = output if output in ("r", "g", "b", "a") else "rgb" if len(default) == 3 else "r"
        at = range(3) if channel == "rgb" else ["rgba".index(channel)] * len(default)
        if picture is None:
            missing = getattr(asset, "path", shader.GetPath())
            self._context.notes.add("textures that are not there are left out", missing)
            return Value(default if fallback is None else tuple(float(fallback[each]) for each in at))
        scale, bias = self._value(shader, "scale", Gf.Vec4f(1)), self._value(shader, "bias", Gf.Vec4f(0))
        space = str(self._value(shader, "sourceColorSpace", "auto"))
        curve: Literal["srgb", "linear", "auto"] = "srgb" if space == "sRGB" else "linear"
        if space == "auto" and len(default) == 3 and name != "normal":
            curve = "auto"
        wraps = [str(self._value(shader, each, "useMetadata")) for each in ("wrapS", "wrapT")]
        if "black" in wraps:
            self._context.notes.add("textures that end in black are continued by their edges", shader.GetPath())
        set_, transform = self._coordinates(shader)
        texture = Texture(
            picture,
            curve,
            (_WRAPS.get(wraps[0], "repeat"), _WRAPS.get(wraps[1], "repeat")),
            uv_set=set_,
            transform=transform,
        )
        return Value(
            tuple(float(scale[each]) for each in at),
            texture,
            channel,  # type: ignore[arg-type]
            tuple(float(bias[each]) for each in at),
        )

    def _coordinates(self, shader: UsdShade.Shader) -> tuple[int, _Matrix]:
        """The set of coordinates that a texture uses, and what is done with them first."""
        total = np.eye(3)
        for _ in range(16):
            source = self._source(shader, "st" if shader.GetShaderId() == "UsdUVTexture" else "in")
            if not isinstance(source, tuple):
                break
            shader = source[0]
            if shader.GetShaderId() != "UsdTransform2d":
                break
            angle = math.radians(float(self._value(shader, "rotation", 0.0)))
            scale = self._value(shader, "scale", Gf.Vec2f(1))
            move = self._value(shader, "translation", Gf.Vec2f(0))
            turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
            step = np.eye(3)
            step[:2, :2] = turn * np.array(scale)
            step[:2, 2] = move
            total = total @ step
        name = "st"
        if str(shader.GetShaderId()).startswith("UsdPrimvarReader"):
            name = str(self._value(shader, "varname", "") or "st")
        rows = (_FLIP @ total @ _FLIP)[:2].tolist()
        return self._context.sets.number(name), (tuple(rows[0]), tuple(rows[1]))

    def _constant(self, name: str, default: Any) -> Any:
        """An input that does not vary."""
        return self._value(self._shader, name, default)

    def _value(self, shader: UsdShade.Shader, name: str, default: Any) -> Any:
        source = self._source(shader, name)
        return default if source is None or isinstance(source, tuple) else source

    def _source(self, shader: UsdShade.Shader, name: str) -> Any:
        """A value; or a shader, and which of its outputs an input is connected to; None if it has neither."""
        given = shader.GetInput(name)
        attributes = given.GetValueProducingAttributes() if given else []
        for attribute in attributes:
            output, kind = UsdShade.Utils.GetBaseNameAndType(attribute.GetName())
            if kind == UsdShade.AttributeType.Output:
                return UsdShade.Shader(attribute.GetPrim()), str(output)
            return attribute.Get(self._context.time)
        return None
