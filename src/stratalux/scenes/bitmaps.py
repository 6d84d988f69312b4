"""From the values of a model to textures of Mitsuba: images are read, decoded and multiplied with their factors."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SceneWarning
from ..images.colour import decode
from ..images.reader import Reader
from ..images.texels import Texels, read_texels
from .album import Album
from .model import Picture, Texture, Value
from .textures import elsewhere

_LARGEST_HALF = 65504.0
_KEPT = 3
"""Images whose texels are kept at hand: several values are often read from the channels of one."""


class Bitmaps:
    """Makes textures, each of them once. A context manager: images are read by a process of their own.

    `path`: the file that messages speak of. `max_memory`: bytes that the texels of one image may take.
    """

    def __init__(self, path: Path, max_memory: int | None = None) -> None:
        self._path, self._max_memory = path, max_memory
        self._reader = Reader()
        self._texels: dict[int, Texels | None] = {}
        self._made: dict[Any, Any] = {}
        self._pictures: list[Picture] = []  # so that no other gets the identity of one
        self._album: Album | None = None

    def __enter__(self) -> Bitmaps:
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.close()
        self._texels.clear()

    def album(self, pictures: Sequence[Picture]) -> Album:
        """An array of those of the pictures that have 8 bits; it is made once, and from then on these are there."""
        assert self._album is None
        self._album = Album(pictures, self._path, self._max_memory, self._warn)
        self._pictures += pictures
        return self._album

    def colour(self, value: Value, sets: Mapping[int, str | None], largest: float | None = 1.0) -> Any:
        """A colour as what a plugin takes for one. `sets`: the mesh attribute of each set of coordinates, None for the
        mesh's own. What is above `largest` is clipped: no surface reflects more than it gets."""
        texture = self._image(value, "rgb", sets, largest)
        if texture is not None:
            return texture
        factor, offset = np.broadcast_to(value.factor, 3), np.broadcast_to(value.offset, 3)
        if value.texture is not None:  # it could not be read
            return {"type": "rgb", "value": _clipped(factor, largest)}
        return {"type": "rgb", "value": _clipped(factor + offset, largest)}

    def number(self, value: Value, sets: Mapping[int, str | None]) -> Any:
        """A number in [0, 1] as what a plugin takes for one."""
        texture = self._image(value, value.channels, sets, 1.0)
        if texture is not None:
            return texture
        return float(np.clip(value.factor[0] + (0.0 if value.texture is not None else value.offset[0]), 0, 1))

    def mean(self, value: Value) -> float:
        """The mean of a number or a colour over its image, for plugins that take one number for all of a surface."""
        factor, offset = np.mean(value.factor), np.mean(value.offset)
        texels = None if value.texture is None else self._read(value.texture.picture)
        if texels is None:
            return float(factor + offset)
        assert value.texture is not None
        return float(_decoded(texels, value.texture, value.channels).mean() * factor + offset)

    def raw(self, texture: Texture, channels: str = "rgb") -> NDArray[np.float32] | None:
        """The decoded texels (H, W) or (H, W, 3), or None if the image cannot be read."""
        texels = self._read(texture.picture)
        return None if texels is None else _decoded(texels, texture, channels)

    def brightest(self, texture: Texture) -> float | None:
        """The largest number that the image has for a colour, as it is stored, or None if it cannot be read."""
        texels = self._read(texture.picture)
        return None if texels is None else float(texels.colours().max(initial=0))

    def of_pixels(self, pixels: NDArray[Any], texture: Texture, sets: Mapping[int, str | None], colour: bool) -> Any:
        """A texture of given pixels (H, W) or (H, W, 3) that lies as `texture` does.

        `colour`: whether they are colours rather than numbers; of 8 bits, colours follow the curve of sRGB.
        """
        if pixels.dtype.kind == "f" and np.abs(pixels).max(initial=0) < _LARGEST_HALF:
            pixels = pixels.astype(np.float16)
        same = texture.wrap[0] == texture.wrap[1]
        (a, b, c), (d, e, f) = texture.transform
        made = mi.load_dict(
            {
                "type": "bitmap",
                "bitmap": mi.Bitmap(np.ascontiguousarray(pixels)),
                "raw": not colour,
                "format": "variant" if pixels.dtype == np.float32 else "fp16",
                "filter_type": "nearest" if texture.nearest else "bilinear",
                "wrap_mode": texture.wrap[0] if same else "repeat",
                "to_uv": mi.ScalarTransform3f([[a, b, c], [d, e, f], [0, 0, 1]]),
            }
        )
        attribute = sets.get(texture.uv_set)
        if not same and (a, b, c, d, e, f) != (1, 0, 0, 0, 1, 0):
            self._warn(f"{texture.picture.name}: is repeated along one axis only, and moved: it is repeated along both")
        elif not same:
            return elsewhere(made, attribute, texture.wrap, (pixels.shape[1], pixels.shape[0]))
        return made if attribute is None else elsewhere(made, attribute, None, (1, 1))

    def _image(self, value: Value, channels: str, sets: Mapping[int, str | None], largest: float | None) -> Any:
        """The texture of a value that has an image that can be read, else None."""
        texture = value.texture
        if texture is None:
            return None
        if texture.uv_set not in sets:
            self._warn(
                f"{texture.picture.name}: belongs on coordinates that the mesh does not have; its factor is taken alone"
            )
            return None
        how = (id(texture.picture), texture.curve, texture.wrap, texture.nearest, texture.transform)
        key = (*how, sets[texture.uv_set], value.factor, value.offset, channels, largest)
        if key not in self._made:
            texels = self._read(texture.picture)
            if texels is None:
                return None
            curved = _is_curved(texels, texture, channels)
            plain = set(value.factor) == {1.0} and set(value.offset) == {0.0} and texels.pixels.dtype == np.uint8
            if plain and (curved or channels != "rgb" or not mi.is_spectral):
                codes = texels.colours() if channels == "rgb" else texels.channel(channels)
                self._made[key] = self.of_pixels(codes, texture, sets, curved)
            else:
                pixels = _decoded(texels, texture, channels)
                factor, offset = (np.asarray(x, dtype=np.float32) for x in (value.factor, value.offset))
                pixels = np.clip(pixels * factor + offset, 0, largest)
                self._made[key] = self.of_pixels(pixels, texture, sets, channels == "rgb")
        return self._made[key]

    def _read(self, picture: Picture) -> Texels | None:
        key = id(picture)
        if self._album is not None:
            if key in self._album.lost:
                return None
            if (kept := self._album.read(picture)) is not None:
                return kept
        if key not in self._texels:
            while len(self._texels) >= _KEPT:
                self._texels.pop(next(iter(self._texels)))
            self._pictures.append(picture)
            source = picture.data if picture.data is not None else picture.path
            assert source is not None
            try:
                self._texels[key] = read_texels(picture.name, source, self._max_memory, self._reader)
            except InputError as error:
                self._warn(f"{error}; the surface is shown without it")
                self._texels[key] = None
        return self._texels[key]

    def _warn(self, text: str) -> None:
        warnings.warn(f"{self._path}: {text}", SceneWarning, stacklevel=3)


def _decoded(texels: Texels, texture: Texture, channels: str) -> NDArray[np.float32]:
    """Numbers (H, W), or linear colours (H, W, 3), of what an image holds."""
    chosen = texels.colours() if channels == "rgb" else texels.channel(channels)
    curved = _is_curved(texels, texture, channels)
    if chosen.dtype == np.uint8:
        table: NDArray[np.float32] = np.linspace(0, 1, 256, dtype=np.float32)[:, None, None]
        if curved:
            decode(table, "srgb")
        decoded: NDArray[np.float32] = table[:, 0, 0][chosen]
        return decoded
    pixels = chosen.astype(np.float32)
    if chosen.dtype == np.uint16:
        pixels /= 65535
    if curved:
        decode(pixels, "srgb")
    return pixels


def _is_curved(texels: Texels, texture: Texture, channels: str) -> bool:
    """Whether the channels of an image follow the curve of sRGB."""
    return channels != "a" and (texture.curve == "srgb" or (texture.curve == "auto" and texels.srgb))


def _clipped(colour: NDArray[Any], largest: float | None) -> list[float]:
    return [float(x) for x in np.clip(colour, 0, largest)]
