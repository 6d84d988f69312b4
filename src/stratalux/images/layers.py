"""Which channels of an image file are the picture, where there are several layers, parts or kinds of channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ..errors import InputError

PICTURES = ("beauty", "rgba", "rgb", "combined", "image", "color", "colour", "main", "composite", "c", "ci", "left")
"""What renderers call the layer that is the picture (Arnold, V-Ray, Blender, Houdini, RenderMan), best first."""
LIGHTS = ("diffuse", "albedo")
"""What is taken for it where none has such a name."""
_COLOURS = ({"R", "r", "red", "Red"}, {"G", "g", "green", "Green"}, {"B", "b", "blue", "Blue"})
_LUMINANCE = ("Y", "y", "L", "luminance")
_ALPHA = ("A", "a", "alpha", "Alpha")
_ALPHAS = (*_ALPHA, "AR", "AG", "AB")
_NAMES = 8
"""Of layers or channels that a message lists, at most."""


@dataclass(frozen=True)
class Choice:
    """``channels`` of the part with that number: three that are red, green and blue, or one that is grey, or luminance,
    RY and BY where ``chroma``. ``said``: what there is to say of the choice, if anything. ``alpha``: the channel that
    is alpha, if there is one."""

    part: int
    channels: list[int]
    chroma: bool = False
    said: str = ""
    alpha: int | None = None


@dataclass
class _Layer:
    part: int
    name: str
    prefix: str
    channels: dict[str, int] = field(default_factory=dict)

    def colours(self) -> list[int]:
        """Red, green and blue; empty where one of them is missing."""
        found = [next((self.channels[name] for name in self.channels if name in names), -1) for names in _COLOURS]
        return found if min(found) >= 0 else []

    def luminance(self) -> list[int]:
        """Luminance alone, or with the two differences that make colours of it; empty where there is none."""
        if "X" in self.channels or "x" in self.channels:
            return []  # of a vector
        found = [self.channels[name] for name in _LUMINANCE if name in self.channels][:1]
        chroma = [self.channels[name] for name in ("RY", "BY") if name in self.channels]
        return found + (chroma if found and len(chroma) == 2 else [])


def choose(parts: Sequence[dict[str, Any]], name: str) -> Choice:
    """The picture among ``parts``, which are those of :meth:`.reader.Reader.parts`.

    Red, green and blue without the name of a layer come first, then the only layer that has them, then one of
    :data:`PICTURES` and :data:`LIGHTS`; luminance where no layer has colours. Raises :class:`InputError`, which names
    what there is, if there is no picture or no telling which. ``name`` is that of the file.
    """
    flat = [number for number, part in enumerate(parts) if not part["deep"]]
    if not flat:
        raise InputError(f"{name}: deep pixels are not read; flatten the image first")
    first = parts[flat[0]]
    if first["format"] != "openexr":
        # Channels of others have no names of their own.
        count = len(first["channels"])
        if count == 0:
            raise InputError(f"{name}: an image without channels; export it again")
        said = f"the first of {len(parts)} images is read" if len(parts) > 1 else ""
        alpha = first.get("alpha", -1)
        channels = [0, 1, 2] if count > 2 else [0]
        return Choice(flat[0], channels, said=said, alpha=alpha if alpha >= len(channels) else None)

    layers = _layers(parts, flat)
    coloured = [layer for layer in layers if layer.colours()]
    candidates = coloured or [layer for layer in layers if layer.luminance()]
    if not candidates:
        names = [label for layer in layers for label in _labels(layer)]
        raise InputError(f"{name}: no R, G and B among the channels {_listed(names)}; name three of them so")
    chosen = _best(candidates)
    if chosen is None:
        names = [layer.name or "without a name" for layer in candidates]
        raise InputError(f"{name}: no telling which of the layers {_listed(names)} is the picture; leave only one")
    channels = chosen.colours() or chosen.luminance()
    others = [layer.name or "the one without a name" for layer in candidates if layer is not chosen]
    left = [
        label
        for layer in layers
        if layer is chosen or layer not in candidates
        for label in _labels(layer, without=channels if layer is chosen else [])
    ]
    left += [part["attributes"].get("name", f"part {number}") for number, part in enumerate(parts) if part["deep"]]
    told = [f"layer {chosen.name} is read"] if chosen.name else []
    if others:
        told.append(f"{'layer' if len(others) == 1 else 'layers'} left out: {_listed(others)}")
    if left:
        told.append(f"{'channel' if len(left) == 1 else 'channels'} left out: {_listed(left)}")
    chroma = not coloured and len(channels) == 3
    alpha = next((chosen.channels[name] for name in _ALPHA if name in chosen.channels), None)
    return Choice(chosen.part, channels, chroma, "; ".join(told), alpha)


def _layers(parts: Sequence[dict[str, Any]], flat: list[int]) -> list[_Layer]:
    layers: dict[tuple[int, str], _Layer] = {}
    for number in flat:
        # The name of a part is that of a layer, where there are several; channels may repeat it.
        part = str(parts[number]["attributes"].get("name", "")) if len(parts) > 1 else ""
        for index, channel in enumerate(parts[number]["channels"]):
            prefix, _, last = channel.rpartition(".")
            label = prefix if prefix.startswith(part) or not prefix else f"{part}.{prefix}"
            layer = layers.setdefault((number, prefix), _Layer(number, label or part, prefix))
            layer.channels.setdefault(last, index)
    return list(layers.values())


def _best(candidates: list[_Layer]) -> _Layer | None:
    """The picture, or None if there is no telling."""
    plain = [layer for layer in candidates if not layer.prefix]
    for layers, names in ((plain, PICTURES), (candidates, (*PICTURES, *LIGHTS))):
        named = [(names.index(last), k) for k, layer in enumerate(layers) if (last := _last(layer)) in names]
        if len(layers) == 1 or named:
            return layers[min(named)[1] if named else 0]
        if layers is plain and plain:
            return plain[0]
    return None


def _last(layer: _Layer) -> str:
    """The last of the names that make up the layer's, in small letters."""
    return layer.name.rpartition(".")[2].lower()


def _labels(layer: _Layer, without: Sequence[int] = ()) -> list[str]:
    """Names of the layer's channels, but for alpha."""
    dot = f"{layer.prefix}." if layer.prefix else ""
    return [dot + last for last, index in layer.channels.items() if index not in without and last not in _ALPHAS]


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _NAMES} more" if len(names) > _NAMES else ""
    return ", ".join(names[:_NAMES]) + more
