"""Lights by k-means clustering, as in LightGen (Cohen and Debevec 2001)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..maps.envmap import EnvironmentMap
from .rig import LightRig, check_count, importance, rig_from_labels
from .voronoi import TexelDirections, centroids, nearest


def kmeans(
    environment: EnvironmentMap,
    n: int,
    *,
    restarts: int = 4,
    iterations: int = 30,
    resolution: tuple[int, int] = (64, 128),
    seed: int = 0,
) -> LightRig:
    """Cluster the map's energy into ``n`` lights, each at the energy centroid of its stratum.

    The map is first reduced to at most ``resolution`` (rows, columns) points, each with the energy of the texels
    nearest to it, at their energy centroid; black ones are left out. Then, ``restarts`` times, k-means minimises
    :func:`cost` from random points, drawn by energy, in at most ``iterations`` rounds; the best result counts. Strata
    are the Voronoi cells of its centres, at full resolution.

    There are fewer than ``n`` lights if the reduced map has fewer points with energy. LightGen is published as a
    program, without its algorithm: the distance (chords between unit vectors), the initial points and the reseeding of
    empty clusters are ours. Raises :class:`InputError` if ``n`` is less than 1 or more than the number of
    texels, or if an option is less than 1.
    """
    check_count(environment, n)
    if min(restarts, iterations, *resolution) < 1:
        raise InputError(
            f"kmeans: {restarts} restarts, {iterations} iterations, {resolution} points; give at least 1 each"
        )
    texels = TexelDirections(environment.height, environment.width)
    points, weight = reduced_points(environment, resolution)
    n = min(n, len(points))
    rng = np.random.default_rng(seed)
    best, lowest = points[:n], np.inf
    for _ in range(restarts):
        start = rng.choice(len(points), n, replace=False, p=weight / weight.sum())
        centres = _relax(points, weight, points[start], iterations)
        error = cost(points, weight, centres)
        if error < lowest:
            best, lowest = centres, error
    label = nearest(best, texels).reshape(environment.height, environment.width)
    return rig_from_labels(environment, label, "kmeans")


def cost(points: NDArray[np.float64], weight: NDArray[np.float64], centres: NDArray[np.float64]) -> float:
    """Weighted squared error: Σ weight · |point − nearest centre|², for unit vectors (P, 3) and (N, 3)."""
    return float(weight @ np.sum((points - centres[nearest(centres, points)]) ** 2, axis=1))


def reduced_points(
    environment: EnvironmentMap, resolution: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The map as fewer weighted points: unit vectors (P, 3) and their energies (P,), none of them 0.

    A map that is smaller than ``resolution`` (rows, columns) in one direction keeps its own rows or columns there.
    """
    points, label = blocks(environment, resolution)
    return points, np.bincount(label, importance(environment), len(points)).astype(np.float64)


def blocks(environment: EnvironmentMap, resolution: tuple[int, int]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """The points (P, 3) of :func:`reduced_points`, and that of each texel (H · W,): any one where it is black."""
    height, width = environment.height, environment.width
    rows, columns = min(resolution[0], height), min(resolution[1], width)
    row, column = np.arange(height) * rows // height, np.arange(width) * columns // width
    weight = importance(environment)
    cell = (row[:, None] * columns + column).astype(np.int32).ravel()
    lit = np.bincount(cell, weight) > 0
    label = np.maximum(np.cumsum(lit) - 1, 0).astype(np.int32)[cell]
    return centroids(TexelDirections(height, width), weight, weight, label, int(lit.sum())), label


def _relax(
    points: NDArray[np.float64], weight: NDArray[np.float64], centres: NDArray[np.float64], iterations: int
) -> NDArray[np.float64]:
    """Lloyd's iterations until no point changes its cluster."""
    previous = None
    for _ in range(iterations):
        label = nearest(centres, points)
        empty = np.flatnonzero(np.bincount(label, minlength=len(centres)) == 0)
        if len(empty):  # reseed at the points that cost most
            error = weight * np.sum((points - centres[label]) ** 2, axis=1)
            label[np.argsort(-error, kind="stable")[: len(empty)]] = empty
        if previous is not None and np.array_equal(label, previous):
            break
        counts = np.bincount(label, minlength=len(centres))
        moved = centroids(points, weight, weight, label, len(centres))
        centres = np.where(counts[:, None] > 0, moved, centres)
        previous = label
    return centres
