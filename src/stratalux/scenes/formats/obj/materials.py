"""MTL: the materials of an OBJ file.

Sources: Wavefront, "The MTL Material Format" (1995); the terms of physically based shading (Pr, Pm, Ps, Pc, Pcr, aniso,
anisor and norm) are those of Exocortex, "Extending the Wavefront MTL Format" (2015). What Phong's terms mean for GGX is
as in Blender's importer (wavefront_obj/importer): roughness = 1 - √(Ns/1000), and Ks = 0.5 is the reflection of a plain
dielectric, 4 % at right angles for an index of 1.5. Colours are linear, as there.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from ....errors import SceneWarning
from ...model import NONE, ONE, WHITE, Colour, Material, Picture, SpecularGlossiness, Value
from ..text import plain_text, word
from .textures import Map, texture_map

_PHYSICAL = ("Pr", "Pm", "Ps", "Pc", "Pcr", "aniso", "anisor", "map_Pr", "map_Pm", "map_Ps")
_OF_PHONG = ("Kd", "Ks", "Ke", "Ns", "Ni", "Tf", "d", "Tr", "illum", "bump", "norm")
_MAPS = ("map_Kd", "map_Ks", "map_Ke", "map_Ns", "map_d", "map_Tr", "map_Bump")
_NOT_OF_LIGHT = ("Ka", "map_Ka", "sharpness", "map_aat")
"""There is no light that comes from nowhere; the others are about how an image is filtered."""
_SPELLING = {key.lower(): key for key in (*_PHYSICAL, *_OF_PHONG, *_MAPS, *_NOT_OF_LIGHT)}
"""What is read. Programs differ in which letters they write large."""
_MIRRORS, _GLASS, _REFRACTING = (3, 5, 8), (4, 6, 7, 9), (6, 7)
"""Values of illum. Of those of glass, 4 says nothing by itself: Maya writes it for everything."""
_GREY = 0.8
"""The colour of what has none, Blender's."""


def read_materials(path: Path, folder: Path) -> dict[str, Material]:
    """The materials of a file by their names. Images are looked for below a `folder`.

    What is not shown is told in a :class:`SceneWarning`, one for each thing. Raises OSError.
    """
    notes: dict[str, list[str]] = {}
    found: dict[str, Material] = {}
    pictures: dict[Path, Picture] = {}
    for name, said in _statements(path, notes):
        found[name] = _Terms(name, said, path.parent, folder, notes, pictures).material()
    for note, names in notes.items():
        names = list(dict.fromkeys(names))
        more = f" and {len(names) - 3} others" if len(names) > 3 else ""
        warnings.warn(f"{path}: {note} ({', '.join(names[:3])}{more})", SceneWarning, stacklevel=3)
    return found


def _statements(path: Path, notes: dict[str, list[str]]) -> Iterator[tuple[str, dict[str, str]]]:
    """The names of the materials, with what follows each of their statements, by its first word in small letters."""
    name: str | None = None
    said: dict[str, str] = {}
    for line in plain_text(path.read_bytes()).split(b"\n"):
        words = word(line).strip().split(None, 1)
        if not words or words[0].startswith("#"):
            continue
        key, rest = words[0].lower(), words[1] if len(words) > 1 else ""
        if key == "newmtl":
            if name is not None:
                yield name, said
            name, said = rest, {}
        elif name is None:
            notes.setdefault("statements before the first 'newmtl' are ignored", []).append(words[0])
        else:
            said[key] = rest
            if key not in _SPELLING:
                notes.setdefault(f"'{words[0][:20]}' is not shown", []).append(name)
    if name is not None:
        yield name, said


class _Terms:
    """What is said of one material."""

    def __init__(
        self,
        name: str,
        said: dict[str, str],
        base: Path,
        folder: Path,
        notes: dict[str, list[str]],
        pictures: dict[Path, Picture],
    ) -> None:
        self._name, self._said, self._base, self._folder = name, said, base, folder
        self._notes, self._pictures = notes, pictures

    def material(self) -> Material:
        """The material that these terms are closest to."""
        physical = any(key.lower() in self._said for key in _PHYSICAL)
        illum = self._number("illum")
        illum = 2.0 if illum is None else illum
        base = self._colour("kd", "map_kd", _GREY)
        shininess = min(max(self._number("ns") or 0.0, 0.0), 1000.0)
        gloss = self._scalar(math.sqrt(shininess / 1000) if "ns" in self._said else None, "map_ns", 0.0)
        material = Material(
            self._name,
            base_colour=base,
            metallic=NONE,
            roughness=_inverse(gloss),
            # Colours of vertices beside an image are the same once more.
            vertex_colours=base.texture is None,
            emission=self._colour("ke", "map_ke", 0.0),
            ior=self._ior(),
        )
        material = self._bumpy(material)
        if illum in _MIRRORS and not physical:
            material = self._mirror(material, gloss)
        else:
            material = self._highlight(material, physical, illum)
        if physical:
            material = self._physical(material)
        return self._transparent(material, illum)

    def _highlight(self, material: Material, physical: bool, illum: float) -> Material:
        """The reflection of a surface that is no mirror: none without Ks, or where illum says so."""
        colour = self._colour("ks", "map_ks", 0.0)
        if physical and not {"ks", "map_ks"} & self._said.keys():
            return material
        if (illum < 2 and not physical) or (not colour.texture and not any(colour.factor)):
            return replace(material, specular=NONE)
        twice = replace(colour, factor=tuple(2 * f for f in colour.factor), offset=tuple(2 * o for o in colour.offset))
        return replace(material, specular_colour=twice)

    def _mirror(self, material: Material, gloss: Value) -> Material:
        """Ks is what a mirror reflects. Blender, however, writes how metallic something is into Ka, as a grey."""
        tint, ambient = self._triple("ks"), self._triple("ka")
        is_grey = ambient is not None and ambient[0] == ambient[1] == ambient[2] > 0
        if (tint is None and "map_ks" not in self._said) or (is_grey and any(material.base_colour.factor)):
            return replace(material, metallic=Value((ambient[0] if ambient and is_grey else 1.0,)))
        if "ns" not in self._said and "map_ns" not in self._said:
            gloss = ONE
        return replace(
            material,
            specular_glossiness=SpecularGlossiness(material.base_colour, self._colour("ks", "map_ks", 0.0), gloss),
        )

    def _physical(self, material: Material) -> Material:
        sheen = self._scalar(self._number("ps"), "map_ps", 0.0)
        rough = {"pr", "map_pr"} & self._said.keys()
        return replace(
            material,
            roughness=self._scalar(self._number("pr"), "map_pr", 1.0) if rough else material.roughness,
            metallic=self._scalar(self._number("pm"), "map_pm", 0.0),
            sheen_colour=replace(sheen, factor=sheen.factor * 3, offset=sheen.offset * 3),
            # Not said by the format; Blender's own.
            sheen_roughness=Value((0.5,)) if sheen != NONE else NONE,
            clearcoat=Value((self._number("pc") or 0.0,)),
            clearcoat_roughness=Value((self._number("pcr") or 0.0,)),
            anisotropy=Value((self._number("aniso") or 0.0,)),
            anisotropy_rotation=2 * math.pi * (self._number("anisor") or 0.0),
        )

    def _transparent(self, material: Material, illum: float) -> Material:
        """What is not opaque: glass where illum says so, and otherwise a share of the light that passes straight."""
        opacity = self._opacity()
        image = self._map("map_d", colour=False)
        inverse = None if image else self._map("map_tr", colour=False)
        found = image or inverse
        if found:
            factor = 1.0 if opacity in (None, 0.0) else float(opacity or 0.0)
            same = found.texture.picture == getattr(material.base_colour.texture, "picture", None)
            channel = found.channel or ("a" if same else "g")
            gain, base = (found.gain, found.base) if image else (-found.gain, 1 - found.base)
            alpha = Value((factor * gain,), found.texture, channel, (factor * base,))
            return replace(material, alpha=alpha, alpha_mode="blend")
        clear = 0.0 if opacity is None else 1 - opacity
        if illum in _GLASS and (clear > 0 or illum != 4):
            filtered = self._triple("tf")
            if not clear:
                clear = 1.0 if filtered is None else max(filtered)
            colour = material.base_colour
            if filtered and (clear == 1 or (not colour.texture and not any(colour.factor))):
                colour = Value(filtered)
            elif clear == 1 and not colour.texture:
                colour = WHITE
            return replace(material, base_colour=colour, transmission=Value((clear,)), thin=illum not in _REFRACTING)
        if clear > 0:
            return replace(material, alpha=Value((1 - clear,)), alpha_mode="blend")
        return material

    def _opacity(self) -> float | None:
        """1 is opaque."""
        if "d" in self._said:
            found = self._number("d")
            return None if found is None else min(max(found, 0.0), 1.0)
        clear = self._number("tr")
        if clear is None:
            return None
        if clear >= 1:
            # MeshLab, for instance, has it the other way round, and nobody describes what cannot be seen.
            self._note("'Tr 1' without 'd' is taken for opaque")
            return 1.0
        return 1 - max(clear, 0.0)

    def _ior(self) -> float:
        """Many write 1 who do not know, or mean a surface that reflects nothing by Ks 0."""
        found = self._number("ni")
        return found if found is not None and found > 1 else 1.5

    def _bumpy(self, material: Material) -> Material:
        if image := self._map("norm", colour=False):
            material = replace(material, normal=Value((image.bump,), image.texture))
        key = "map_bump" if "map_bump" in self._said else "bump"
        if image := self._map(key, colour=False):
            if re.search(r"norm|nrm", image.texture.picture.name, re.IGNORECASE):
                # Blender's exporter and its kin have no other word for them.
                self._note(f"'{_SPELLING[key]}' is taken for a map of normals, as its name says")
                return replace(material, normal=material.normal or Value((image.bump,), image.texture))
            channel = image.channel or "g"
            bump = Value((image.bump * image.gain,), image.texture, channel, (image.bump * image.base,))
            return replace(material, bump=bump)
        return material

    def _colour(self, key: str, map_key: str, default: float) -> Value:
        """A colour, with the image that it multiplies."""
        given, image = self._triple(key), self._map(map_key, colour=True)
        if image is None:
            return Value((default,) * 3 if given is None else given)
        factor = self._with_map(given, (1.0,) * 3, key, map_key)
        offset = tuple(f * image.base for f in factor)
        return Value(tuple(f * image.gain for f in factor), image.texture, image.channel or "rgb", offset)

    def _scalar(self, factor: float | None, map_key: str, default: float) -> Value:
        """A number, with the image that it multiplies."""
        image = self._map(map_key, colour=False)
        if image is None:
            return Value((default if factor is None else factor,))
        (factor,) = self._with_map(None if factor is None else (factor,), (1.0,), map_key[4:], map_key)
        return Value((factor * image.gain,), image.texture, image.channel or "g", (factor * image.base,))

    def _with_map(
        self, factor: tuple[float, ...] | None, ones: tuple[float, ...], key: str, map_key: str
    ) -> tuple[float, ...]:
        """The factor of an image. Nobody names an image to multiply it by 0."""
        if factor is None or any(factor):
            return factor or ones
        self._note(f"'{_SPELLING[key]}' is 0 beside '{_SPELLING[map_key]}', and taken for 1")
        return ones

    def _map(self, key: str, colour: bool) -> Map | None:
        if not self._said.get(key):
            return None
        found = texture_map(self._said[key], self._base, self._folder, colour, self._pictures)
        if isinstance(found, str):
            self._note(f"the texture {found!r} is not there, and left out")
            return None
        return found

    def _triple(self, key: str) -> Colour | None:
        """A colour of three numbers, or of one for all of them; None where it is not given."""
        words = self._said.get(key, "").split()
        if not words:
            return None
        if words[0] in ("spectral", "xyz"):
            self._note(f"'{_SPELLING[key]} {words[0]}' is not supported, and ignored")
            return None
        numbers = [self._float(key, each) for each in words[:3]]
        r, g, b = numbers if len(numbers) == 3 else numbers[:1] * 3
        return None if r is None or g is None or b is None else (max(r, 0.0), max(g, 0.0), max(b, 0.0))

    def _number(self, key: str) -> float | None:
        words = self._said.get(key, "").split()
        if words[:1] == ["-halo"]:
            self._note("'d -halo' is taken for 'd'")
            words = words[1:]
        return self._float(key, words[0]) if words else None

    def _float(self, key: str, text: str) -> float | None:
        try:
            found = float(text)
        except ValueError:
            found = math.nan
        if math.isfinite(found):
            return found
        self._note(f"'{_SPELLING[key]} {text[:20]}' is not a number, and ignored")
        return None

    def _note(self, note: str) -> None:
        self._notes.setdefault(note, []).append(self._name)


def _inverse(value: Value) -> Value:
    """1 - a number."""
    (factor,), (offset,) = value.factor, value.offset
    return replace(value, factor=(-factor,), offset=(1 - offset,)) if value.texture else Value((1 - factor - offset,))
