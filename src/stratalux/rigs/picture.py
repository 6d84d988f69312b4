"""Pictures of partitions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..images.settings import ViewSettings
from ..images.tonemap import tonemap
from ..maps.envmap import EnvironmentMap
from ..maps.geometry import map_coordinates
from ..maps.regions import Regions
from . import LightRig
from .lights import Lights

DEFAULT_VIEW = ViewSettings()
_BORDER = (120, 255, 90)
_MIN_WIDTH = 1024


def draw_regions(environment: EnvironmentMap, regions: Regions, view: ViewSettings = DEFAULT_VIEW) -> NDArray[np.uint8]:
    """The tone-mapped map with the borders of the regions on it (figure 1), 8-bit sRGB; small maps are enlarged."""
    height, width = regions.shape
    zoom = max(1, -(-_MIN_WIDTH // width))
    picture = np.repeat(np.repeat(tonemap(environment.texels, view.exposure, view.view), zoom, axis=0), zoom, axis=1)
    # A border runs through texel centres, so half a texel in from the corner of its texel.
    for y0, y1, x0, x1 in (regions.bounds * zoom + zoom // 2).tolist():
        picture[y0 : y1 + 1, x0] = picture[y0 : y1 + 1, min(x1, width * zoom - 1)] = _BORDER
        picture[y0, x0 : x1 + 1] = picture[min(y1, height * zoom - 1), x0 : x1 + 1] = _BORDER
    return picture


def draw_rig(environment: EnvironmentMap, rig: LightRig, view: ViewSettings = DEFAULT_VIEW) -> NDArray[np.uint8]:
    """The tone-mapped map with the cells of the lights tinted and the lights on it as dots, 8-bit sRGB."""
    height, width = rig.shape
    zoom = max(1, -(-_MIN_WIDTH // width))
    # Hues a golden angle apart: neighbours in number, which are often neighbours on the map, differ much.
    hue = 2 * np.pi * np.arange(len(rig)) * 0.381966
    tint = 127.5 + 127.5 * np.cos(hue[:, None] + 2 * np.pi / 3 * np.arange(3))
    shown = tonemap(environment.texels, view.exposure, view.view)
    tinted: NDArray[np.uint8] = (0.65 * shown + 0.35 * tint[rig.label]).astype(np.uint8)
    picture = np.repeat(np.repeat(tinted, zoom, axis=0), zoom, axis=1)
    return _dots(picture, rig.direction, height, zoom)


def draw_lights(environment: EnvironmentMap, lights: Lights, view: ViewSettings = DEFAULT_VIEW) -> NDArray[np.uint8]:
    """The tone-mapped map with lights that have no cells on it as dots, 8-bit sRGB."""
    zoom = max(1, -(-_MIN_WIDTH // environment.width))
    shown = tonemap(environment.texels, view.exposure, view.view)
    picture: NDArray[np.uint8] = np.repeat(np.repeat(shown, zoom, axis=0), zoom, axis=1)
    return _dots(picture, lights.direction, environment.height, zoom)


def _dots(picture: NDArray[np.uint8], direction: NDArray[np.float64], height: int, zoom: int) -> NDArray[np.uint8]:
    u, v = map_coordinates(direction)
    x, y = u * picture.shape[1], (v * (height - 1) + 0.5) * zoom
    radius = max(3.0, min(6.0, 0.2 * np.sqrt(picture.shape[0] * picture.shape[1] / len(direction))))
    reach = int(radius) + 2
    offsets = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    for centre_x, centre_y in zip(x, y, strict=True):
        rows, columns = int(centre_y) + offsets[0], int(centre_x) + offsets[1]
        distance = np.hypot(columns + 0.5 - centre_x, rows + 0.5 - centre_y)
        inside = (distance < radius) & (rows >= 0) & (rows < picture.shape[0])
        colour = np.where((distance < radius - 1.2)[..., None], 255, 0)
        picture[rows[inside], columns[inside] % picture.shape[1]] = colour[inside]
    return picture


def mark_lights(texels: NDArray[np.float32], lights: Lights, white: float) -> NDArray[np.float32]:
    """A linear picture (H, W, 3) of a map, with lights on it as discs in their colours within black and white rings.

    ``white``: the radiance that the picture shows as white. Areas of discs are in proportion to the lights, as far as
    they can be seen and do not hide each other.
    """
    picture = texels.copy()
    height, width = picture.shape[:2]
    strength = lights.colour.max(axis=1)
    share = strength / (strength.max() or 1.0)
    largest = min(0.045, 0.25 / np.sqrt(len(lights))) * height
    u, v = map_coordinates(lights.direction)
    for k in np.argsort(-strength, kind="stable").tolist():
        radius = max(largest * np.sqrt(share[k]), 2.5)
        reach = int(radius) + 4
        rows, columns = np.mgrid[-reach : reach + 1, -reach : reach + 1]
        x, y = u[k] * width - 0.5, v[k] * (height - 1)
        rows, columns = rows + round(y), columns + round(x)
        distance = np.hypot(columns - x, rows - y)
        colour = white * lights.colour[k] / (strength[k] or 1.0)
        for ring, within in ((0.0, radius + 2.5), (2 * white, radius + 1.2), (colour, radius)):
            inside = (distance < within) & (rows >= 0) & (rows < height)
            picture[rows[inside], columns[inside] % width] = ring
    return picture
