"""The textures of glTF: images, how they are repeated, and where they lie on a surface.

Sources: Khronos Group, "glTF 2.0 Specification", sections 3.8 and 5.30, and the extensions KHR_texture_transform,
KHR_texture_basisu, EXT_texture_webp and MSFT_texture_dds.
"""

from __future__ import annotations

import math
import warnings
from typing import Any, Literal

from ....errors import InputError, SceneWarning
from ...model import Picture, Texture, Wrap
from . import basisu
from .container import Document, item
from .files import data_of, file_of, is_data
from .numbers import Numbers

_WRAPS: dict[Any, Wrap] = {33071: "clamp", 33648: "mirror"}
_NEAREST = 9728
_AS_THEY_ARE = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
_PREFERRED = "EXT_texture_webp"
"""An extension whose image is better than the one to fall back to."""
_OTHERS = ("MSFT_texture_dds", "KHR_texture_basisu")
"""Extensions whose images are the same as the one to fall back to, or worse."""


class Textures:
    """The textures of a document. Those that are equal are the same object, and so are their pictures."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._pictures: dict[int, Picture | None] = {}
        self._equal_pictures: dict[Picture, Picture] = {}
        self._equal: dict[Texture, Texture] = {}

    def texture(self, info: dict[str, Any] | None, curve: Literal["srgb", "linear"]) -> Texture | None:
        """What a material says of a texture, None where it says nothing or where the image is not to be had."""
        if info is None:
            return None
        texture = item(self._document.list("textures"), info["index"])
        self._document.left_out.extensions_of(info, texture)
        picture = self._picture(texture)
        if picture is None:
            return None
        sampler = item(self._document.list("samplers"), texture["sampler"]) if "sampler" in texture else {}
        transform = info.get("extensions", {}).get("KHR_texture_transform", {})
        found = Texture(
            picture,
            curve,
            (_WRAPS.get(sampler.get("wrapS"), "repeat"), _WRAPS.get(sampler.get("wrapT"), "repeat")),
            sampler.get("magFilter") == _NEAREST,
            int(transform.get("texCoord", info.get("texCoord", 0))),
            _matrix(Numbers(transform, self._document.left_out)) if transform else _AS_THEY_ARE,
        )
        return self._equal.setdefault(found, found)

    def _picture(self, texture: dict[str, Any]) -> Picture | None:
        extensions = texture.get("extensions", {})
        places = [extensions.get(_PREFERRED, {}), texture, *(extensions.get(name, {}) for name in _OTHERS)]
        index = next((place["source"] for place in places if "source" in place), None)
        if index is None and not extensions:
            self._document.left_out.add("a texture that has no image")
            return None
        if index is None:
            named = ", ".join(extensions)
            raise InputError(f"{self._document.path}: a texture has no image that can be read ({named}); export others")
        if index not in self._pictures:
            found = self._read(index)
            self._pictures[index] = None if found is None else self._equal_pictures.setdefault(found, found)
        return self._pictures[index]

    def _read(self, index: int) -> Picture | None:
        """The picture of an image, decoded where no library of images does it; None with a warning for a lost one."""
        document = self._document
        image = item(document.list("images"), index)
        uri = image.get("uri")
        name = str(image.get("name") or f"image {index}")
        if uri is None:
            found = Picture(name, data=bytes(document.view(image["bufferView"])[0]))
        elif is_data(uri):
            found = Picture(name, data=data_of(uri))
        else:
            try:
                path = file_of(document.path, uri)
            except InputError as error:
                warnings.warn(f"{error}; what it is on is shown without", SceneWarning, stacklevel=4)
                return None
            found = Picture(path.name, path)
        return self._decoded(found)

    def _decoded(self, picture: Picture) -> Picture:
        data = picture.data
        if picture.path is not None:
            with picture.path.open("rb") as file:
                data = file.read(len(basisu.BEGINNING))
                if data == basisu.BEGINNING:
                    data += file.read()
        if data is None or not data.startswith(basisu.BEGINNING):
            return picture
        return Picture(picture.name, data=basisu.png_of(self._document.path, picture.name, data))


def _matrix(said: Numbers) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """The affine map (2, 3) of KHR_texture_transform.

    Its matrices are those that the specification's examples are computed with, and viewers use: as v goes down, a
    rotation that is counter-clockwise on the image takes u to -v.
    """
    (x, y), (width, height) = said.some("offset", (0.0, 0.0)), said.some("scale", (1.0, 1.0))
    angle = said.one("rotation", 0.0)
    c, s = math.cos(angle), math.sin(angle)
    return (c * width, s * height, x), (-s * width, c * height, y)
