"""What is behind an object and below it: from settings to a property of integrators, and a shape."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from ..errors import InputError, SceneWarning
from ..images.half import single
from ..images.reading import read_image
from ..images.repair import repair
from ..images.strips import strips
from ..integrators.environment import image_emitter, stored_texels
from ..maps.blur import blurred
from .settings import colour_of
from .sources import source

GROUND = "ground"
"""The id of the ground in a scene."""
GROUND_REFLECTANCE = 0.4
GROUND_RADIUS = 100.0
"""In units of half the object's diagonal: the edge is so close to the horizon that it looks like one."""
_ASPECT = 1.01
"""A picture whose sides differ by less from those of the film is stretched."""


def background(scene: mi.Scene, kind: str, camera: int = 0, max_memory: int | None = None) -> Any:
    """The property `background` of our integrators; see :class:`.SceneSettings`. `camera`: the one that is used.

    Raises :class:`InputError` for a picture that cannot be read, and for a map that is to be blurred and is none.
    """
    if kind in ("map", "none"):
        return kind
    if kind.startswith("blur:"):
        return _blurred(scene, float(kind[5:]))
    colour = colour_of(kind)
    if colour is not None:
        return mi.load_dict({"type": "constant", "radiance": {"type": "rgb", "value": list(colour)}})
    return _plate(kind, tuple(scene.sensors()[camera].film().size()), max_memory)


def _blurred(scene: mi.Scene, degrees: float) -> Any:
    emitter = image_emitter(scene)
    if emitter is None:
        raise InputError("background blur: the scene has no environment map; give one with --env MAP")
    params = mi.traverse(emitter)
    texels = blurred(np.ascontiguousarray(single(stored_texels(emitter)[..., :3])), degrees)
    made = mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(texels)})
    turned = mi.traverse(made)
    turned["to_world"], turned["scale"] = params["to_world"], params["scale"]
    turned.update()
    return made


def _plate(path: str, size: tuple[int, int], max_memory: int | None) -> Any:
    """A picture over the film of that `size`; what is too wide or too high is cut off on both sides."""
    image = read_image(source(Path(path)), max_memory)
    pixels, repaired = repair(image.pixels, image.largest, keep_negative=False)
    if repaired:
        warnings.warn(f"{path}: {repaired}", SceneWarning, stacklevel=4)
    height, width = pixels.shape[:2]
    aspect, wanted = width / height, size[0] / size[1]
    if max(aspect / wanted, wanted / aspect) > _ASPECT:
        columns = min(width, round(height * wanted))
        rows = min(height, round(width / wanted))
        left, top = (width - columns) // 2, (height - rows) // 2
        pixels = pixels[top : top + max(rows, 1), left : left + max(columns, 1)]
        warnings.warn(
            f"{path}: {width}x{height} is no shape for a film of {size[0]}x{size[1]}; {columns}x{rows} of it are shown",
            SceneWarning,
            stacklevel=4,
        )
    return mi.load_dict(
        {"type": "bitmap", "bitmap": mi.Bitmap(np.ascontiguousarray(pixels)), "raw": True, "wrap_mode": "clamp"}
    )


def ground(kind: str, bounds: npt.ArrayLike) -> dict[str, Any] | None:
    """The shape below what has these `bounds` (2, 3), as a dictionary, or None; see :class:`.SceneSettings`."""
    if kind == "none":
        return None
    low, high = np.asarray(bounds, dtype=np.float64)
    half = float(np.linalg.norm(high - low) / 2)
    # A hair below, so that an object with a flat bottom does not fight with it for visibility.
    middle = [(low[0] + high[0]) / 2, low[1] - 1e-4 * half, (low[2] + high[2]) / 2]
    flat = mi.ScalarTransform4f().translate(middle).rotate([1, 0, 0], -90).scale(GROUND_RADIUS * half)
    return {"type": "disk", "id": GROUND, "to_world": flat, "bsdf": _surface(kind)}


def object_pixels(scene: mi.Scene, camera: mi.Sensor) -> NDArray[np.bool_]:
    """Pixels (H, W) that show something else than the ground and what is behind; without those at its edges, if any
    others are left."""
    width, height = (int(side) for side in camera.film().crop_size())
    mask = np.empty((height, width), dtype=bool)
    for some in strips(height, width):
        rows = mask[some]
        index = dr.arange(mi.UInt32, rows.size) + dr.opaque(mi.UInt32, some.start * width)
        position = (mi.Vector2f(index % width, index // width) + 0.5) / mi.Vector2f(width, height)
        ray, _ = camera.sample_ray(0, 0.5, mi.Point2f(position), mi.Point2f(0.5))
        si = scene.ray_intersect(ray)
        seen = si.is_valid()
        for shape in scene.shapes():
            if shape.id() == GROUND:
                seen &= si.shape != mi.ShapePtr(shape)
        rows[...] = seen.numpy().reshape(rows.shape)
    inner = shrunk(mask, camera.film())
    return inner if inner.any() else mask


def shrunk(mask: NDArray[np.bool_], film: mi.Film) -> NDArray[np.bool_]:
    """A mask (H, W) of pixels without those to which others add by the film's filter; beyond the edges all is well."""
    reach = int(np.ceil(film.rfilter().radius() - 0.5 - 1e-3))
    if reach <= 0:
        return mask
    padded = np.pad(mask, reach, constant_values=True)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * reach + 1,) * 2)
    return np.asarray(windows.all(axis=(2, 3)))


def _surface(kind: str) -> dict[str, Any]:
    if kind == "mirror":
        return {"type": "conductor", "material": "none"}
    name, _, text = kind.partition(":")
    colour = colour_of(text) if name == "matte" and text else None
    value: Any = GROUND_REFLECTANCE if colour is None else list(colour)
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": value}}
