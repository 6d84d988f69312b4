"""The materials of glTF, and of its extensions KHR_materials_*.

Occlusion is left alone: it stands for the shadows that a renderer of rays finds by itself. So are the thickness of
volumes, which is where the surfaces are, and the filters of textures between sizes.

Sources: Khronos Group, "glTF 2.0 Specification", sections 3.9 and 5.19 to 5.24, and the extensions' own documents.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

from ...model import Material, SpecularGlossiness, Texture, Value
from .container import Document, item
from .numbers import Numbers
from .textures import Textures

_DEFAULT = Material(double_sided=False)
_MODES: dict[str, Literal["opaque", "mask", "blend"]] = {"OPAQUE": "opaque", "MASK": "mask", "BLEND": "blend"}


class Materials:
    """The materials of a document. Those that are equal are the same object."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._textures = Textures(document)
        self._made: dict[int, Material] = {}
        self._equal: dict[Material, Material] = {_DEFAULT: _DEFAULT}

    def material(self, index: int | None) -> Material:
        """That of a primitive, which has the default one if it names none."""
        if index is None:
            return _DEFAULT
        if index not in self._made:
            found = self._material(item(self._document.list("materials"), index))
            self._made[index] = self._equal.setdefault(found, found)
        return self._made[index]

    def _material(self, material: dict[str, Any]) -> Material:
        self._document.left_out.extensions_of(material)
        own, surface = self._numbers(material), material.get("pbrMetallicRoughness", {})
        numbers = self._numbers(surface)
        colour, alpha = self._coloured(surface, "baseColorFactor", "baseColorTexture")
        extensions = material.get("extensions", {})
        strength = self._numbers(extensions.get("KHR_materials_emissive_strength", {}))
        mode = material.get("alphaMode", "OPAQUE")
        if mode not in _MODES:
            self._document.left_out.add(f"the alpha mode {str(mode)[:40]!r}")
        light = strength.one("emissiveStrength", 1.0, 0.0)
        glow = own.colour("emissiveFactor", 0.0, math.inf)  # above 1 against the rules, in files that know no strength
        found = Material(
            name=str(material.get("name", "")),
            base_colour=colour,
            alpha=alpha,
            metallic=self._value(surface, "metallicRoughnessTexture", numbers.one("metallicFactor", 1.0, 0, 1), "b"),
            roughness=self._value(surface, "metallicRoughnessTexture", numbers.one("roughnessFactor", 1.0, 0, 1), "g"),
            alpha_mode=_MODES.get(mode, "opaque"),
            alpha_cutoff=own.one("alphaCutoff", 0.5, 0.0),
            double_sided=bool(material.get("doubleSided", False)),
            normal=self._normal(material, "normalTexture"),
            emission=self._colour(material, "emissiveTexture", (light * glow[0], light * glow[1], light * glow[2])),
            unlit="KHR_materials_unlit" in extensions,
        )
        for name, read in _EXTENSIONS.items():
            if name in extensions:
                found = replace(found, **read(self, extensions[name]))
        return found

    # ------------------------------- Extensions: the fields that each of them sets -------------------------------

    def _anisotropy(self, said: dict[str, Any]) -> dict[str, Any]:
        if "anisotropyTexture" in said:
            self._document.left_out.add("the directions in textures of anisotropy")
        numbers = self._numbers(said)
        return {
            "anisotropy": self._value(said, "anisotropyTexture", numbers.one("anisotropyStrength", 0.0, 0, 1), "b"),
            "anisotropy_rotation": numbers.one("anisotropyRotation", 0.0),
        }

    def _clearcoat(self, said: dict[str, Any]) -> dict[str, Any]:
        numbers = self._numbers(said)
        rough = numbers.one("clearcoatRoughnessFactor", 0.0, 0, 1)
        return {
            "clearcoat": self._value(said, "clearcoatTexture", numbers.one("clearcoatFactor", 0.0, 0, 1), "r"),
            "clearcoat_roughness": self._value(said, "clearcoatRoughnessTexture", rough, "g"),
            "clearcoat_normal": self._normal(said, "clearcoatNormalTexture"),
        }

    def _ior(self, said: dict[str, Any]) -> dict[str, Any]:
        # 0 stands for infinity: all is reflected.
        return {"ior": 0.0 if said.get("ior") == 0 else self._numbers(said).one("ior", 1.5, 1.0)}

    def _sheen(self, said: dict[str, Any]) -> dict[str, Any]:
        numbers = self._numbers(said)
        rough = numbers.one("sheenRoughnessFactor", 0.0, 0, 1)
        return {
            "sheen_colour": self._colour(said, "sheenColorTexture", numbers.colour("sheenColorFactor", 0.0)),
            "sheen_roughness": self._value(said, "sheenRoughnessTexture", rough, "a"),
        }

    def _specular(self, said: dict[str, Any]) -> dict[str, Any]:
        numbers = self._numbers(said)
        colour = numbers.colour("specularColorFactor", 1.0, math.inf)
        return {
            "specular": self._value(said, "specularTexture", numbers.one("specularFactor", 1.0, 0, 1), "a"),
            "specular_colour": self._colour(said, "specularColorTexture", colour),
        }

    def _specular_glossiness(self, said: dict[str, Any]) -> dict[str, Any]:
        numbers, name = self._numbers(said), "specularGlossinessTexture"
        diffuse, alpha = self._coloured(said, "diffuseFactor", "diffuseTexture")
        texture = self._textures.texture(said.get(name), "srgb")
        gloss = _of_channel(numbers.one("glossinessFactor", 1.0, 0, 1), texture, "a")
        specular = Value(numbers.colour("specularFactor", 1.0), texture, "rgb")
        return {"alpha": alpha, "specular_glossiness": SpecularGlossiness(diffuse, specular, gloss)}

    def _transmission(self, said: dict[str, Any]) -> dict[str, Any]:
        share = self._numbers(said).one("transmissionFactor", 0.0, 0, 1)
        return {"transmission": self._value(said, "transmissionTexture", share, "r")}

    def _volume(self, said: dict[str, Any]) -> dict[str, Any]:
        numbers = self._numbers(said)
        distance = numbers.one("attenuationDistance", math.inf, 0.0)
        return {
            "thin": numbers.one("thicknessFactor", 0.0, 0.0) == 0,
            "attenuation": numbers.colour("attenuationColor", 1.0),
            "attenuation_distance": distance or math.inf,  # the specification wants more than 0
        }

    # ------------------------------- Values -------------------------------

    def _numbers(self, values: dict[str, Any]) -> Numbers:
        return Numbers(values, self._document.left_out)

    def _value(self, said: dict[str, Any], texture: str, factor: float, channel: Literal["r", "g", "b", "a"]) -> Value:
        """A number, times one channel of a texture."""
        return _of_channel(factor, self._textures.texture(said.get(texture), "linear"), channel)

    def _colour(self, said: dict[str, Any], texture: str, factor: tuple[float, float, float]) -> Value:
        return Value(factor, self._textures.texture(said.get(texture), "srgb"), "rgb")

    def _coloured(self, said: dict[str, Any], factor: str, name: str) -> tuple[Value, Value]:
        """A colour, and the alpha that comes with it."""
        texture = self._textures.texture(said.get(name), "srgb")
        red, green, blue, alpha = self._numbers(said).some(factor, (1.0, 1.0, 1.0, 1.0), 0, 1)
        return Value((red, green, blue), texture, "rgb"), _of_channel(alpha, texture, "a")

    def _normal(self, said: dict[str, Any], name: str) -> Value | None:
        texture = self._textures.texture(said.get(name), "linear")
        if texture is None:
            return None
        scale = self._numbers(said[name]).one("scale", 1.0)
        return Value((scale, scale, 1.0), texture, "rgb")


def _of_channel(factor: float, texture: Texture | None, channel: Literal["r", "g", "b", "a"]) -> Value:
    return Value((factor,)) if texture is None else Value((factor,), texture, channel)


_EXTENSIONS = {
    "KHR_materials_anisotropy": Materials._anisotropy,
    "KHR_materials_clearcoat": Materials._clearcoat,
    "KHR_materials_ior": Materials._ior,
    "KHR_materials_pbrSpecularGlossiness": Materials._specular_glossiness,
    "KHR_materials_sheen": Materials._sheen,
    "KHR_materials_specular": Materials._specular,
    "KHR_materials_transmission": Materials._transmission,
    "KHR_materials_volume": Materials._volume,
}
