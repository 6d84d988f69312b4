"""A partition of an environment map into rectangles, and what the rectangles contain."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .envmap import EnvironmentMap
from .geometry import cell_solid_angle, direction, row_weights


@dataclass(frozen=True)
class Regions:
    """N rectangles Ω_1 … Ω_N that tile the cells of an H x W map without gap or overlap.

    ``bounds`` (N, 4) int64: y0, y1, x0, x1 in cells, upper ends exclusive. Cell row i lies between texel rows i and
    i + 1 (v from i / (H − 1)); cell column j between the centres of texel columns j and j + 1 (u from (j + ½) / W).
    ``energy`` (N,): integral of luminance over solid angle. ``shape``: (H, W) of the map in texels.
    """

    bounds: NDArray[np.int64]
    energy: NDArray[np.float64]
    shape: tuple[int, int]

    def __len__(self) -> int:
        return len(self.bounds)

    @cached_property
    def solid_angle(self) -> NDArray[np.float64]:
        """Steradians of each region, (N,); their sum is 4π."""
        rows = np.concatenate([[0.0], np.cumsum(cell_solid_angle(*self.shape))])
        y0, y1, x0, x1 = self.bounds.T
        return (rows[y1] - rows[y0]) * (x1 - x0)

    @cached_property
    def centre(self) -> NDArray[np.float64]:
        """Unit direction of the middle of each rectangle, (N, 3)."""
        height, width = self.shape
        y0, y1, x0, x1 = self.bounds.T
        return direction(((x0 + x1) / 2 + 0.5) / width, (y0 + y1) / 2 / (height - 1))

    def index_map(self) -> NDArray[np.int32]:
        """Index of the region that owns each cell, (H − 1, W)."""
        index = np.empty((self.shape[0] - 1, self.shape[1]), dtype=np.int32)
        for i, (y0, y1, x0, x1) in enumerate(self.bounds.tolist()):
            index[y0:y1, x0:x1] = i
        return index


@dataclass(frozen=True)
class RegionContent:
    """What each of N regions contains.

    ``flux`` (N, 3): ∫ L dω in RGB, exact for the bilinear radiance. ``direction`` (N, 3): unit energy centroid
    (Debevec 2005), the middle of the rectangle where a region has no energy.
    """

    flux: NDArray[np.float64]
    direction: NDArray[np.float64]


def region_content(environment: EnvironmentMap, regions: Regions) -> RegionContent:
    """Integrate the map over each region."""
    height, width = regions.shape
    upper, lower = row_weights(height)
    texels = np.concatenate([environment.texels, environment.texels[:, :1]], axis=1)
    luminance = np.concatenate([environment.luminance, environment.luminance[:, :1]], axis=1)
    phi = 2 * np.pi * (np.arange(width + 1) + 0.5) / width
    theta = np.linspace(0, np.pi, height)
    flux = np.empty((len(regions), 3))
    centroid = np.empty((len(regions), 3))
    for i, (y0, y1, x0, x1) in enumerate(regions.bounds.tolist()):
        rows, columns = slice(y0, y1 + 1), slice(x0, x1 + 1)
        row = np.zeros(y1 - y0 + 1)
        row[:-1] += upper[y0:y1]
        row[1:] += lower[y0:y1]
        column = np.full(x1 - x0 + 1, 2 * np.pi / width)
        column[[0, -1]] /= 2
        flux[i] = row @ np.matmul(column, texels[rows, columns])
        waves = np.stack([column * np.sin(phi[columns]), column, -column * np.cos(phi[columns])], axis=1)
        sin_theta, cos_theta = np.sin(theta[rows]), np.cos(theta[rows])
        moments = luminance[rows, columns] @ waves
        centroid[i] = row @ (moments * np.stack([sin_theta, cos_theta, sin_theta], axis=1))
    length = np.linalg.norm(centroid, axis=1, keepdims=True)
    unit = np.divide(centroid, length, out=regions.centre.copy(), where=length > 0)
    return RegionContent(flux, unit)


def describe_regions(environment: EnvironmentMap, regions: Regions) -> dict[str, Any]:
    """The partition as plain numbers, ready for JSON.

    For each region: ``texels`` x and y, first and last texel whose centres bound the rectangle (neighbours share them;
    x = W is column 0 again); ``u`` and ``v``, the same in map coordinates; ``solid_angle`` in steradians; ``energy``,
    ∫ luminance dω; ``mean_colour``, the mean radiance in linear RGB; ``direction``, the unit energy centroid in the
    map's frame, y up.
    """
    height, width = regions.shape
    content = region_content(environment, regions)
    described = [
        {
            "texels": {"x": [x0, x1], "y": [y0, y1]},
            "u": [(x0 + 0.5) / width, (x1 + 0.5) / width],
            "v": [y0 / (height - 1), y1 / (height - 1)],
            "solid_angle": float(regions.solid_angle[i]),
            "energy": float(regions.energy[i]),
            "mean_colour": (content.flux[i] / regions.solid_angle[i]).tolist(),
            "direction": content.direction[i].tolist(),
        }
        for i, (y0, y1, x0, x1) in enumerate(regions.bounds.tolist())
    ]
    return {"width": width, "height": height, "regions": described}
