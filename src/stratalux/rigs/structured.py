"""Structured importance sampling (Agarwal, Ramamoorthi, Belongie and Jensen 2003)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..maps.envmap import EnvironmentMap
from ..maps.geometry import texel_solid_angle
from .rig import LightRig, check_count, rig_from_labels
from .voronoi import COINCIDENT, centroids, nearest, texel_directions


def structured(
    environment: EnvironmentMap,
    n: int,
    *,
    levels: int = 6,
    cap: float = 0.01,
    placement: str = "centre",
    seed: int = 0,
) -> LightRig:
    """Spread ``n`` lights over nested components of the bright parts of the map.

    The luminance is thresholded at i · σ, i = ``levels`` − 1 … 0, with σ its standard deviation over the sphere. A
    component C of a level is worth

        Γ = L · min(Δω, Δω0)^¼,   L = ∫_C Y dω,   Δω its solid angle,   Δω0 = ``cap`` in steradians,

    and gets ⌊n Γ / Γ(sphere)⌋ lights, including those that its parts got at higher levels. These are placed by the
    farthest-point heuristic for the k-centre problem (Hochbaum and Shmoys 1985): starting from the inherited ones, or
    from a random texel (``seed``), the texel of the component farthest from all lights so far is next. Strata are
    Voronoi cells inside components: a texel belongs to the nearest of the lights in the smallest component that
    contains the texel and a light. A light is

    - ``placement="centre"``: in the middle (solid-angle centroid) of the part of its stratum that lies in the component
      that it was placed in;
    - ``placement="energy"``: at the energy centroid of its stratum;
    - ``placement="site"``: at the texel that k-centre chose.

    L includes the solid angle of each texel, as follows from the method's statement that Γ = L^a Δω^b is sampling by
    illumination for a = 1, b = 0. Because Γ of parts never adds up to more than Γ of the whole, and Γ(sphere) is that
    of the lowest level, of which the sphere is the one component, all ``n`` lights are used: what rounding leaves over
    at a level goes to the component around, in the end to the largest. Components are 8-connected, around the seam and
    across the poles. There are fewer than ``n`` lights if the map has fewer distinct texel directions.

    Raises :class:`InputError` if ``n`` is less than 1 or more than the number of texels, or if an option is unknown.
    """
    check_count(environment, n)
    if placement not in ("centre", "energy", "site"):
        raise InputError(f"placement: {placement!r} is unknown; give 'centre', 'energy' or 'site'")
    if levels < 1 or cap <= 0:
        raise InputError(f"structured: {levels} levels and a cap of {cap} sr; give at least 1 level and a positive cap")
    height, width = environment.height, environment.width
    points = texel_directions(height, width)
    solid_angle = np.ravel(texel_solid_angle(height, width))
    luminance = np.ravel(environment.luminance).astype(np.float64)
    sphere = gamma(luminance @ solid_angle, 4 * np.pi, cap)
    rng = np.random.default_rng(seed)

    layers = []
    sites: NDArray[np.int64] = np.empty(0, dtype=np.int64)  # texels
    home = np.empty(0, dtype=np.int64)  # the layer that each was placed in
    for i, threshold in enumerate(thresholds(environment, levels)):
        layer = components(environment.luminance >= threshold)
        layers.append(layer)
        inside = layer.ravel()
        flux = np.bincount(inside, luminance * solid_angle)
        value = gamma(flux, np.bincount(inside, solid_angle), cap)
        if i == levels - 1:
            quota = np.array([0, n])  # the sphere; said outright, as a black map has Γ = 0
        else:
            quota = np.floor(n * value / sphere if sphere > 0 else 0 * value).astype(np.int64)
        wanted = quota - np.bincount(inside[sites], minlength=len(quota))
        for c in np.flatnonzero(wanted[1:] > 0) + 1:
            texels = np.flatnonzero(inside == c)
            new = k_centre(points[texels], np.searchsorted(texels, sites[inside[sites] == c]), int(wanted[c]), rng)
            sites = np.concatenate([sites, texels[new]])
        home = np.concatenate([home, np.full(len(sites) - len(home), i)])

    label = _strata(points, layers, sites)
    if placement == "site":
        direction = points[sites]
    elif placement == "centre":
        own = np.stack([layer.ravel() for layer in layers])
        in_home = own[home[label], np.arange(len(label))] == own[home, sites][label]
        direction = centroids(points, np.where(in_home, solid_angle, 0), solid_angle, label, len(sites))
    else:
        direction = None
    return rig_from_labels(environment, label.reshape(height, width), "structured", direction)


def gamma(flux: ArrayLike, solid_angle: ArrayLike, cap: float) -> NDArray[np.float64]:
    """Γ = L · min(Δω, Δω0)^¼ of regions with flux L and solid angle Δω in steradians; Δω0 is ``cap``."""
    return np.asarray(flux) * np.minimum(solid_angle, cap) ** 0.25


def thresholds(environment: EnvironmentMap, levels: int) -> NDArray[np.float64]:
    """Luminances that bound the layers from below, brightest first: (``levels`` − 1) · σ, …, σ, 0."""
    solid_angle = texel_solid_angle(environment.height, environment.width) / (4 * np.pi)
    luminance = environment.luminance.astype(np.float64)
    mean = np.sum(luminance * solid_angle)
    deviation = np.sqrt(np.sum((luminance - mean) ** 2 * solid_angle))
    return deviation * np.arange(levels)[::-1]


def components(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Number the 8-connected components of ``mask`` (H, W) from 1; 0 is outside of the mask.

    Columns wrap around. The texels of a polar row are one place and hence connected.
    """
    from scipy.ndimage import label as label_image  # not before it is needed: SciPy takes half a second
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    image, count = label_image(mask, structure=np.ones((3, 3)))
    pairs = [np.stack([image[:, 0], image[:, -1]]), np.stack([image[1:, 0], image[:-1, -1]])]
    pairs.append(np.stack([image[:-1, 0], image[1:, -1]]))
    pairs += [np.stack([np.broadcast_to(row.max(), row.shape), row]) for row in (image[0], image[-1])]
    first, second = np.concatenate(pairs, axis=1)
    joined = (first > 0) & (second > 0)
    first, second = first[joined] - 1, second[joined] - 1
    graph = coo_array((np.ones(len(first), dtype=bool), (first, second)), shape=(count, count))
    if count == 0:
        return np.zeros(mask.shape, dtype=np.int64)
    _, merged = connected_components(graph, directed=False)
    return np.concatenate([[0], merged + 1])[image]


def k_centre(
    points: NDArray[np.float64], inherited: NDArray[np.int64], more: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Indices of ``more`` of the unit vectors ``points`` (P, 3), each the farthest from all before it.

    ``inherited`` (K,) are indices of the first centres; without any, the first is drawn at random. The result is
    shorter if the points run out of distinct directions.
    """
    centres = list(inherited)
    new = []
    if not centres:
        new.append(int(rng.integers(len(points))))
        centres.append(new[0])
    closeness = np.full(len(points), -np.inf)  # cosine of the angle to the nearest centre
    for centre in centres:
        np.maximum(closeness, points @ points[centre], out=closeness)
    while len(new) < more:
        farthest = int(np.argmin(closeness))
        if 1 - closeness[farthest] <= COINCIDENT:
            break
        new.append(farthest)
        np.maximum(closeness, points @ points[farthest], out=closeness)
    return np.array(new, dtype=np.int64)


def _strata(
    points: NDArray[np.float64], layers: list[NDArray[np.int64]], sites: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Index of the site that owns each texel: the nearest in the smallest component with texel and site."""
    owner = np.full(len(points), -1, dtype=np.int64)
    for layer in layers:
        inside = layer.ravel()
        at = inside[sites]
        for c in np.unique(at[at > 0]):
            texels = np.flatnonzero((inside == c) & (owner < 0))
            rivals = np.flatnonzero(at == c)
            if len(texels):
                owner[texels] = rivals[nearest(points[sites[rivals]], points[texels])]
    return owner
