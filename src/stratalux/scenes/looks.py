"""From the materials of a model to BSDFs and emitters of Mitsuba: `principled`, under a normal map and a mask.

What `principled` has no term for is told in one line for the file. Sources: Khronos Group, "glTF 2.0 Specification",
section 3.9 and appendix B, and its extensions KHR_materials_*; Burley, "Physically Based Shading at Disney" (2012).
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..images.colour import LUMINANCE
from .absorption import absorbing
from .bitmaps import Bitmaps
from .lambert import lambertian
from .layers import coated, sheened
from .model import ONE, WHITE, Material, Texture, Value
from .sharing import Members, bent, has_images, pictures, structure
from .textures import at_least, product
from .varied import Tables

Sets = Mapping[int, str | None]
"""By the numbers of sets of texture coordinates, the attribute of the mesh that has them; None for its own."""

DIELECTRIC = 0.04
"""Reflectance at right angles of an index of refraction of 1.5."""
_CLEAR = 0.1
"""Roughness up to which thin glass is as clear as a window."""


class Looks:
    """Makes BSDFs and emitters of materials; `left_out` names what is not shown of them, or not exactly."""

    def __init__(self, bitmaps: Bitmaps) -> None:
        self.left_out: set[str] = set()
        self._bitmaps = bitmaps
        self._made: dict[Any, Any] = {}
        self._kept: list[Material] = []  # so that no other gets the identity of one
        self._shared: dict[Hashable, Members] = {}
        self._members: Members | None = None
        self._numbers: dict[int, tuple[Any, int]] = {}

    def share(self, uses: Iterable[tuple[Material, Sets, bool]]) -> None:
        """Make one BSDF of those that differ in numbers and images alone, of all the materials that there will be.

        `uses`: the arguments of :meth:`bsdf` of all of them. Afterwards, :meth:`stands` has to be told of each mesh,
        and in the end, :meth:`finish` makes the textures.
        """
        alike: dict[Hashable, dict[int, Material]] = {}
        sets_of: dict[Hashable, Sets] = {}
        for material, sets, colours in uses:
            key = structure(material, sets, colours and material.vertex_colours)
            if key is not None:
                alike.setdefault(key, {})[id(material)] = material
                sets_of[key] = sets
        alike = {key: materials for key, materials in alike.items() if any(map(has_images, materials.values()))}
        album = self._bitmaps.album(pictures(material for each in alike.values() for material in each.values()))
        for key, materials in alike.items():
            there = [each for each in materials.values() if all(map(album.place, pictures([each])))]
            if there:
                self._shared[key] = Members(there, sets_of[key], album, sum(map(len, self._shared.values())))

    def stands(self, mesh: mi.Shape, material: Material, sets: Sets, colours: bool) -> None:
        """Know that a mesh has been given the BSDF of a material."""
        members = self._members_of(material, sets, colours)
        if members is not None:
            self._numbers[id(mesh)] = mesh, members.number(material)

    def finish(self) -> None:
        """Give the BSDFs that are shared what they look up by the mesh that they are on."""
        if self._numbers:
            meshes, numbers = zip(*self._numbers.values(), strict=True)
            identities = dr.reinterpret_array(mi.UInt32, mi.ShapePtr(list(meshes))).numpy()
            table = np.zeros(identities.max() + 1, dtype=np.uint32)
            table[identities] = numbers
            on_device, count, tables = mi.UInt32(table), sum(map(len, self._shared.values())), Tables()
            for members in self._shared.values():
                members.fill(on_device, count, tables)

    def bsdf(self, material: Material, sets: Sets, colours: bool, mirrored: bool) -> Any:
        """The BSDF of a material on a mesh with these `sets` of coordinates.

        `colours`: the mesh has the attributes vertex_colour and vertex_alpha. `mirrored`: its texture coordinates are,
        seen from outside, so that maps of normals are upside down.
        """
        coloured = colours and material.vertex_colours
        members = self._members_of(material, sets, colours)
        key = (id(members or material), tuple(sorted(sets.items())), coloured, mirrored and bends(material))
        if key not in self._made:
            self._kept.append(material)
            self._members = members
            made = self._bsdf(material, sets, coloured, mirrored)
            self._members = None
            self._made[key] = mi.load_dict(made) if isinstance(made, dict) else made
        return self._made[key]

    def _members_of(self, material: Material, sets: Sets, colours: bool) -> Members | None:
        """Those that have one BSDF with a material, or None."""
        if not self._shared:
            return None
        members = self._shared.get(structure(material, sets, colours and material.vertex_colours))
        return members if members is not None and material in members else None

    # ------------------------------- Values -------------------------------

    def _number(self, material: Material, name: str, sets: Sets) -> Any:
        """A number that a material has, as what a plugin takes for one."""
        shared = None if self._members is None else self._members.texture(name)
        return self._bitmaps.number(getattr(material, name), sets) if shared is None else shared

    def emitter(self, material: Material, sets: Sets, colours: bool) -> dict[str, Any] | None:
        """The light that a surface gives off by itself, or None."""
        if material.unlit:
            self.left_out.add("that unlit surfaces do not light others")
            return {"type": "area", "radiance": self._base(material, sets, colours)}
        value = material.emission
        if max(value.factor) <= 0 and max(value.offset) <= 0:
            return None
        if value.texture is not None:
            brightest = self._bitmaps.brightest(value.texture)
            if brightest is None or brightest <= 0 >= max(value.offset):
                return None
        return {"type": "area", "radiance": self._bitmaps.colour(value, sets, None)}

    # ------------------------------- Layers, from the outside in -------------------------------

    def _bsdf(self, material: Material, sets: Sets, colours: bool, mirrored: bool) -> Any:
        if material.unlit:
            black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
            bsdf: Any = {"type": "twosided", "bsdf": black}
        else:
            surface = self._surface(material, sets, colours)
            if surface["type"] == "principled":
                surface = lambertian(surface, *self._reflection(material, sets))
            bsdf = self._layered(material, sets, mirrored, surface)
            if _lets_through(material):
                if not material.thin and min(material.attenuation) < 1 and math.isfinite(material.attenuation_distance):
                    bsdf = absorbing(bsdf, material.attenuation, material.attenuation_distance)
            else:
                bsdf = {"type": "twosided", "front": bsdf}
                # Mitsuba turns what a normal has along z only, and of a dent that is seen from behind, all is turned.
                if material.double_sided and bends(material):
                    bsdf["back"] = self._layered(material, sets, mirrored, surface, -1)
        return self._covered(material, sets, colours, bsdf)

    def _covered(self, material: Material, sets: Sets, colours: bool, bsdf: Any) -> Any:
        """Under a mask, where the material has holes."""
        if material.alpha_mode == "opaque":
            return bsdf
        opacity = self._number(material, "alpha", sets)
        if colours:
            opacity = _times(opacity, {"type": "mesh_attribute", "name": "vertex_alpha"})
        elif isinstance(opacity, float):
            if material.alpha_mode == "mask":
                opacity = float(opacity >= material.alpha_cutoff)
            return bsdf if opacity == 1 else {"type": "mask", "opacity": opacity, "bsdf": bsdf}
        if material.alpha_mode == "mask":
            opacity = at_least(opacity, material.alpha_cutoff)
        return {"type": "mask", "opacity": opacity, "bsdf": bsdf}

    def _layered(self, material: Material, sets: Sets, mirrored: bool, surface: Any, side: int = 1) -> Any:
        """With normals, sheen and a coat. `side`: 1 for its front, -1 for its back."""
        if _is_some(material.sheen_colour):
            colour = self._bitmaps.colour(material.sheen_colour, sets)
            surface = sheened(surface, colour, self._bitmaps.number(material.sheen_roughness, sets))
        bsdf = self._bent(material, sets, mirrored, surface, side)
        if not _is_some(material.clearcoat):
            return bsdf
        normal = material.clearcoat_normal
        return coated(
            bsdf,
            self._number(material, "clearcoat", sets),
            self._bitmaps.number(material.clearcoat_roughness, sets),
            None if normal is None else self._normals(normal, sets, mirrored, side),
        )

    def _bent(self, material: Material, sets: Sets, mirrored: bool, bsdf: Any, side: int = 1) -> Any:
        """With the normals or the bumps that the material has."""
        if material.normal is not None:
            texture = self._normals(material.normal, sets, mirrored, side, self._members)
            return bsdf if texture is None else {"type": "normalmap", "normalmap": texture, "bsdf": bsdf}
        if material.bump is not None:
            height = self._bitmaps.number(Value((1.0,), material.bump.texture, material.bump.channels), sets)
            if not isinstance(height, float):
                scale = side * float(material.bump.factor[0])
                return {"type": "bumpmap", "arbitrary": height, "scale": scale, "bsdf": bsdf}
        return bsdf

    def _normals(self, value: Value, sets: Sets, mirrored: bool, side: int, members: Members | None = None) -> Any:
        """The texture of a map of normals, scaled; None if there is none to be had. `members`: whose it may be."""
        texture = value.texture
        if texture is None or texture.uv_set not in sets:
            return None
        if members is not None:
            return members.texture("normal", lambda each: bent(each, mirrored, side), clipped=False)
        texels = self._bitmaps.raw(texture)
        if texels is None:
            return None
        normals = 2 * texels - 1
        normals[..., :2] *= np.broadcast_to(np.asarray(value.factor, dtype=np.float32)[:2], 2) * side
        if mirrored:
            normals[..., 1] *= -1
        length = np.linalg.norm(normals, axis=2, keepdims=True)
        normals = np.where(length > 0, normals / np.where(length > 0, length, 1), [0, 0, 1])
        return self._bitmaps.of_pixels(((normals + 1) / 2).astype(np.float32), texture, sets, False)

    # ------------------------------- The surface itself -------------------------------

    def _base(self, material: Material, sets: Sets, colours: bool) -> Any:
        shared = None if self._members is None else self._members.texture("base_colour")
        base = self._bitmaps.colour(material.base_colour, sets) if shared is None else shared
        return _times(base, {"type": "mesh_attribute", "name": "vertex_colour"}) if colours else base

    def _surface(self, material: Material, sets: Sets, colours: bool) -> dict[str, Any]:
        if material.specular_glossiness is not None:
            return self._of_specular(material, sets, colours)
        bsdf: dict[str, Any] = {
            "type": "principled",
            "base_color": self._base(material, sets, colours),
            "roughness": self._number(material, "roughness", sets),
            "metallic": self._number(material, "metallic", sets),
            "eta": self._eta(material),
        }
        if _is_some(material.anisotropy):
            self._stretch(material, bsdf)
        if _lets_through(material):
            return self._glass(material, sets, bsdf)
        return {name: value for name, value in bsdf.items() if name != "metallic" or value != 0}

    def _eta(self, material: Material) -> float:
        """The index of refraction; of what lets light through, with the reflectance that it has at right angles."""
        if material.ior <= 0:  # KHR_materials_ior: reflects all
            return 1000.0
        if not _lets_through(material):
            return 1.0 if _is_matte(material) else max(float(material.ior), 1.0)
        reflectance = ((material.ior - 1) / (material.ior + 1)) ** 2
        colour = material.specular_colour
        if colour.texture is not None or np.ptp(np.broadcast_to(colour.factor, 3)) > 0:
            self.left_out.add("the colour of what glass reflects")
        if material.specular.texture is not None:
            self.left_out.add("textures of how much glass reflects (their mean is taken)")
        strength = self._bitmaps.mean(material.specular) * (
            self._bitmaps.mean(colour)
            if colour.texture is not None
            else float(np.broadcast_to(colour.factor, 3) @ LUMINANCE)
        )
        root = math.sqrt(min(max(reflectance * strength, 0.0), 0.99))
        return (1 + root) / (1 - root)

    def _reflection(self, material: Material, sets: Sets) -> tuple[Any, Any, float]:
        """How strong the reflection of what is no metal is, its colour, and a factor of that, for `lambertian`."""
        if material.specular_glossiness is not None or _lets_through(material) or _is_matte(material):
            return None, None, 1.0
        strength = None if material.specular == ONE else self._bitmaps.number(material.specular, sets)
        colour = material.specular_colour
        if colour == WHITE:
            return strength, None, 1.0
        scale = max(1.0, *colour.factor, *colour.offset)
        within = replace(
            colour, factor=tuple(f / scale for f in colour.factor), offset=tuple(o / scale for o in colour.offset)
        )
        return strength, self._bitmaps.colour(within, sets), scale

    def _stretch(self, material: Material, bsdf: dict[str, Any]) -> None:
        """Anisotropy: α is to be α + (1 - α) s² along the tangent and α across; `principled` has α / a and α a with
        a² = 1 - 0.9 anisotropic."""
        strength, roughness = self._bitmaps.mean(material.anisotropy), self._bitmaps.mean(material.roughness)
        across = max(roughness**2, 1e-3)
        along = across + (1 - across) * strength**2
        bsdf["anisotropic"] = min((1 - across / along) / 0.9, 1.0)
        if isinstance(bsdf["roughness"], float):
            bsdf["roughness"] = (along * across) ** 0.25
        if material.anisotropy_rotation or material.anisotropy.texture is not None:
            self.left_out.add("the direction of anisotropy")

    def _glass(self, material: Material, sets: Sets, bsdf: dict[str, Any]) -> dict[str, Any]:
        transmission = self._bitmaps.number(material.transmission, sets)
        if not material.thin:
            return {**bsdf, "spec_trans": transmission}
        ior = min(max(bsdf["eta"], 1.0001), 10.0)
        if self._bitmaps.mean(material.roughness) > _CLEAR:
            thin = {name: bsdf[name] for name in ("base_color", "roughness", "eta")}
            return {**thin, "eta": ior, "type": "principledthin", "spec_trans": transmission}
        clear = {"type": "thindielectric", "int_ior": ior, "specular_transmittance": bsdf["base_color"]}
        if transmission == 1.0:
            return clear
        return {
            "type": "blendbsdf",
            "weight": transmission,
            "first": {"type": "twosided", "bsdf": lambertian(bsdf)},
            "second": clear,
        }

    def _of_specular(self, material: Material, sets: Sets, colours: bool) -> dict[str, Any]:
        """Of the colours of matte and of glossy reflection, texel by texel."""
        given = material.specular_glossiness
        assert given is not None
        matte, glossy = self._texels(given.diffuse), self._texels(given.specular)
        matte, glossy = _same_size(matte, glossy)
        base, metallic = _metal_of_specular(matte, glossy)
        texture = given.diffuse.texture or given.specular.texture
        gloss = given.glossiness
        rough = Value(tuple(-f for f in gloss.factor), gloss.texture, gloss.channels, (1.0 - gloss.offset[0],))
        bsdf: dict[str, Any] = {"type": "principled", "eta": 1.5, "roughness": self._bitmaps.number(rough, sets)}
        if texture is None or texture.uv_set not in sets or base.shape[:2] == (1, 1):
            bsdf["base_color"] = {"type": "rgb", "value": [float(x) for x in base.mean(axis=(0, 1))]}
            bsdf["metallic"] = float(metallic.mean())
        else:
            bsdf["base_color"] = self._bitmaps.of_pixels(base, texture, sets, True)
            bsdf["metallic"] = self._bitmaps.of_pixels(metallic, texture, sets, False)
        if colours:
            bsdf["base_color"] = _times(bsdf["base_color"], {"type": "mesh_attribute", "name": "vertex_colour"})
        return bsdf

    def _texels(self, value: Value) -> NDArray[np.float32]:
        """A colour as an image (H, W, 3), of a single texel where it is the same everywhere."""
        texels = None if value.texture is None else self._bitmaps.raw(value.texture)
        if texels is None:
            texels = np.ones((1, 1, 3), dtype=np.float32)
        factor, offset = (np.broadcast_to(np.asarray(x, dtype=np.float32), 3) for x in (value.factor, value.offset))
        return np.clip(texels * factor + offset, 0, 1)


def _metal_of_specular(
    matte: NDArray[np.float32], glossy: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The base colours (H, W, 3) and how metallic (H, W) surfaces are whose matte and whose glossy colours are given.

    Of the quadratic equation that 0.04 (1 - m) + c m = glossy and c (1 - m) = matte make of brightnesses. Source:
    Khronos Group, "KHR_materials_pbrSpecularGlossiness", appendix.
    """
    weights = np.array([0.299, 0.587, 0.114], dtype=np.float32)
    rest = 1 - glossy.max(axis=2)
    bright, shiny = (np.sqrt(colour**2 @ weights) for colour in (matte, glossy))
    b = bright * rest / (1 - DIELECTRIC) + shiny - 2 * DIELECTRIC
    root = np.sqrt(np.maximum(b * b - 4 * DIELECTRIC * (DIELECTRIC - shiny), 0))
    metallic = np.where(shiny < DIELECTRIC, 0, np.clip((root - b) / (2 * DIELECTRIC), 0, 1))[..., None]
    of_matte = matte * (rest[..., None] / (1 - DIELECTRIC)) / np.maximum(1 - metallic, 1e-4)
    of_glossy = (glossy - DIELECTRIC * (1 - metallic)) / np.maximum(metallic, 1e-4)
    base = np.clip(of_matte + (of_glossy - of_matte) * metallic**2, 0, 1)
    return base.astype(np.float32), metallic[..., 0].astype(np.float32)


def _same_size(a: NDArray[Any], b: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Two images at the size of the larger one, texels repeated."""
    size = [max(x, y) for x, y in zip(a.shape[:2], b.shape[:2], strict=True)]
    rows, columns = np.arange(size[0]), np.arange(size[1])

    def enlarged(image: NDArray[Any]) -> NDArray[Any]:
        height, width = image.shape[:2]
        return image[(rows * height // size[0])[:, None], (columns * width // size[1])[None]]

    return enlarged(a), enlarged(b)


def textures(material: Material) -> list[Texture]:
    """All textures of a material, those that bend its normals first."""
    given = material.specular_glossiness
    values = [
        material.normal,
        material.bump,
        material.clearcoat_normal,
        material.base_colour,
        material.metallic,
        material.roughness,
    ]
    values += [given.diffuse, given.specular, given.glossiness] if given else []
    values += [material.alpha, material.emission, material.clearcoat, material.clearcoat_roughness]
    values += [material.specular, material.specular_colour, material.sheen_colour, material.sheen_roughness]
    values.append(material.transmission)
    return [value.texture for value in values if value is not None and value.texture is not None]


def bends(material: Material) -> bool:
    """Whether its images turn the normals of surfaces."""
    return any(value is not None for value in (material.normal, material.bump, material.clearcoat_normal))


def _lets_through(material: Material) -> bool:
    return _is_some(material.transmission) and material.specular_glossiness is None


def _is_matte(material: Material) -> bool:
    """Whether it reflects nothing, other than metals and what has an infinite index of refraction."""
    return not _is_some(material.specular) and not _is_some(material.metallic)


def _is_some(value: Value) -> bool:
    return max(value.factor) > 0 or max(value.offset) > 0


def _times(a: Any, attribute: dict[str, Any]) -> Any:
    """The product of what a plugin takes for a colour or a number, and an attribute of the mesh."""
    if isinstance(a, float):
        a = {"type": "uniform", "value": a}
    if isinstance(a, dict):
        if np.all(np.asarray(a["value"]) == 1):
            return mi.load_dict(attribute)
        a = mi.load_dict(a)
    return product([a, mi.load_dict(attribute)])
