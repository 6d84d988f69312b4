"""Image sets: stills that any browser shows, and the linear pixels that ``viewer.js`` makes a viewer of."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..images.tonemap import tonemap
from ..images.writing import jpeg
from .encode import encode_pixels, encode_unit
from .model import ImageSet, Picture
from .text import Identifiers, paragraphs, script_json


@dataclass(frozen=True)
class EncodedSet:
    """An image set as text. ``data``: text of each payload by name, which tells its content; some sets share some."""

    block: ImageSet
    stills: tuple[str, ...]
    pictures: tuple[dict[str, Any], ...]
    data: Mapping[str, str]

    @cached_property
    def still_size(self) -> int:
        """Characters that the stills take."""
        return sum(map(len, self.stills))


def pictures_of(block: ImageSet) -> tuple[Picture, ...]:
    """All pictures to flip through; the reference is the last if it is not among them."""
    listed = any(picture is block.reference for picture in block.pictures)
    return block.pictures if block.reference is None or listed else (*block.pictures, block.reference)


def encode_set(block: ImageSet) -> EncodedSet:
    """Raises :class:`ValueError` for pictures that are not of one size, or no linear RGB."""
    pictures = pictures_of(block)
    if not pictures:
        raise ValueError(f"image set '{block.title}': no picture")
    shape = pictures[0].image.shape
    for picture in pictures:
        if picture.image.shape != shape or len(shape) != 3 or shape[2] != 3 or 0 in shape:
            raise ValueError(f"picture '{picture.name}': shape {picture.image.shape}, not {(*shape[:2], 3)}")
        if picture.flip is not None and picture.flip.shape != shape[:2]:
            raise ValueError(f"picture '{picture.name}': FLIP of shape {picture.flip.shape}, not {shape[:2]}")
    data: dict[str, str] = {}
    described = []
    for picture in pictures:
        pixels, scale = encode_pixels(np.asarray(picture.image, dtype=np.float32))
        flip = None if picture.flip is None else _keep(data, encode_unit(picture.flip))
        described.append(
            {
                "name": picture.name,
                "facts": picture.facts,
                "pixels": _keep(data, pixels, f"{scale}"),
                "scale": scale,
                "flip": flip,
            }
        )
    stills = tuple(_still(picture.image, block.exposure) for picture in pictures)
    return EncodedSet(block, stills, tuple(described), data)


def set_markup(encoded: EncodedSet, identifiers: Identifiers, *, stills: bool, viewer: bool) -> str:
    """The stills, and what the viewer has to know. Without ``viewer``, or even ``stills``, it says what is missing."""
    block = encoded.block
    title = identifiers.new("images")
    missing = ""
    if not stills:
        missing = '<p class="aside">These pictures are left out: the page would be larger than it may.</p>'
    elif not viewer:
        missing = '<p class="aside">Stills, without linear pixels: the page would be larger than it may.</p>'
    figures = "".join(
        f'<figure><img src="{still}" alt="{escape(picture.name)}" width="{picture.image.shape[1]}" '
        f'height="{picture.image.shape[0]}" loading="lazy"><figcaption>{escape(picture.name)}{_facts(picture.facts)}'
        "</figcaption></figure>"
        for picture, still in zip(pictures_of(block), encoded.stills, strict=True)
    )
    gallery = f'<div class="stills">{figures}</div>' if stills else ""
    return (
        f'<section class="block images" aria-labelledby="{title}"><h3 id="{title}">{escape(block.title)}</h3>'
        f"{paragraphs(block.text)}{missing}"
        f"{gallery}{_description(encoded, title) if stills and viewer else ''}</section>"
    )


def _description(encoded: EncodedSet, title: str) -> str:
    block = encoded.block
    pictures = pictures_of(block)
    height, width, _ = pictures[0].image.shape
    content = {
        "titleId": title,
        "width": width,
        "height": height,
        "exposure": block.exposure,
        "reference": next((k for k, picture in enumerate(pictures) if picture is block.reference), None),
        "pictures": encoded.pictures,
        "crops": [vars(crop) for crop in block.crops],
    }
    return f'<script type="application/json" class="viewer-data">{script_json(content)}</script>'


def _facts(facts: Mapping[str, str]) -> str:
    return "".join(f"<small>{escape(name)}: {escape(value)}</small>" for name, value in facts.items())


def _still(image: NDArray[np.float32], exposure: float) -> str:
    return "data:image/jpeg;base64," + base64.b64encode(jpeg(tonemap(image, exposure))).decode("ascii")


def _keep(data: dict[str, str], text: str, how: str = "") -> str:
    """Put a payload into ``data``; its name tells its content, and how it is to be read."""
    name = "pixels-" + hashlib.sha256(f"{how} {text}".encode("ascii")).hexdigest()[:16]
    data[name] = text
    return name
