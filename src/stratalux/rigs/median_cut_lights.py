"""Median cut lights (Debevec 2005)."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..maps.envmap import EnvironmentMap
from ..maps.median_cut import median_cut
from ..maps.regions import region_content
from .rig import LightRig, check_count


def median_cut_lights(environment: EnvironmentMap, n: int, *, placement: str = "centroid") -> LightRig:
    """One light for each of the rectangles of :func:`stratalux.maps.median_cut`.

    ``placement``: ``centroid``, the energy centroid of the rectangle (Debevec 2005), or ``centre``, its middle. There
    are fewer than ``n`` lights if rectangles with energy run out; a black map gets one.

    Rectangles are made of the cells between texels. The colour is the exact integral over the rectangle, to which a
    texel on an edge contributes in part; as a label such a texel, like every other, goes to the rectangle of the cell
    whose upper left corner it is (the last row goes with the cells above it).

    Raises :class:`InputError` if ``n`` is less than 1 or more than the number of texels, or the placement is unknown.
    """
    check_count(environment, n)
    if placement not in ("centroid", "centre"):
        raise InputError(f"placement: {placement!r} is unknown; give 'centroid' or 'centre'")
    regions = median_cut(environment, n)
    content = region_content(environment, regions)
    cells = regions.index_map()
    label = np.concatenate([cells, cells[-1:]])
    direction = content.direction if placement == "centroid" else regions.centre
    return LightRig(direction, content.flux, label, "median-cut")
