"""Lights by Lloyd relaxation (Kollig and Keller 2003)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..maps.envmap import EnvironmentMap
from ..maps.geometry import texel_solid_angle
from .rig import LightRig, check_count, importance, rig_from_labels
from .voronoi import COINCIDENT, centroids, nearest, texel_directions


def lloyd(
    environment: EnvironmentMap,
    n: int,
    *,
    insert: str = "brightest",
    weight: str = "energy",
    iterations: int = 3,
    growth: float = 2.0,
) -> LightRig:
    """Grow a Voronoi diagram to ``n`` cells by splitting the cell with the most energy, relaxing it on the way.

    ``insert``: where a cell gets its new generator, at its ``brightest`` texel (the one with the most energy) or at
    the lit one ``farthest`` from its generator. ``weight``: what Lloyd relaxation takes the centroid of a cell with,
    ``energy`` or ``solid-angle``. ``iterations``: rounds of relaxation, each time that the number of cells has grown
    by the factor ``growth`` and at the end. Lights are at the energy centroids of the cells.

    Assumed, as the publication leaves it open: all of these defaults, one generator to begin with, and that relaxation
    need not follow every single insertion (in between, the diagram is kept exact by giving each new generator the
    texels nearest to it). There are fewer than ``n`` lights if cells with two lit texels run out. Raises
    :class:`InputError` if ``n`` is less than 1 or more than the number of texels, or if an option is unknown.
    """
    check_count(environment, n)
    if insert not in ("brightest", "farthest"):
        raise InputError(f"insert: {insert!r} is unknown; give 'brightest' or 'farthest'")
    if weight not in ("energy", "solid-angle"):
        raise InputError(f"weight: {weight!r} is unknown; give 'energy' or 'solid-angle'")
    if iterations < 0 or growth <= 1:
        raise InputError(f"lloyd: {iterations} iterations, growth {growth}; give at least 0 and more than 1")
    height, width = environment.height, environment.width
    solid_angle = np.ravel(texel_solid_angle(height, width))
    energy = importance(environment)
    diagram = _Diagram(texel_directions(height, width), energy, n)
    mass = energy if weight == "energy" else solid_angle
    relax_at = 2.0
    while diagram.count < n and diagram.split(insert):
        if diagram.count >= relax_at and diagram.count < n:
            diagram.relax(mass, solid_angle, iterations)
            relax_at = diagram.count * growth
    diagram.relax(mass, solid_angle, iterations)
    # Relaxation can leave a cell without a texel: replace those, and let the substitutes stay where they are.
    while diagram.count < n and diagram.split(insert):
        pass
    return rig_from_labels(environment, diagram.owner.reshape(height, width), "lloyd")


class _Diagram:
    """A Voronoi diagram of weighted points on the sphere to which generators are added one at a time."""

    def __init__(self, points: NDArray[np.float64], energy: NDArray[np.float64], capacity: int) -> None:
        self.points, self.energy = points, energy
        self.owner: NDArray[np.integer] = np.zeros(len(points), dtype=np.int64)
        self.sites = np.empty((capacity, 3))
        self.sites[:1] = centroids(points, energy, energy, self.owner, 1)
        self.count = 1
        self._refresh()

    def _refresh(self) -> None:
        self.cosine = np.einsum("pc,pc->p", self.points, self.sites[self.owner])
        self.cell_energy = np.bincount(self.owner, self.energy, len(self.sites))

    def split(self, insert: str) -> bool:
        """Add a generator to the cell with the most energy of those that can be split; False if there is none."""
        while True:
            cell = int(np.argmax(self.cell_energy))
            if self.cell_energy[cell] <= 0:
                return False
            texels = np.flatnonzero(self.owner == cell)
            # The generator's own texel is no place for another one.
            distance = 1 - self.cosine[texels]
            free = (self.energy[texels] > 0) & (distance > COINCIDENT)
            if free.any():
                rank = np.where(free, self.energy[texels] if insert == "brightest" else distance, 0)
                texel = texels[np.argmax(rank)]
                if np.any(1 - self.points[texels] @ self.points[texel] > COINCIDENT):
                    break
            # One lit texel, or none but a rest of rounding: closed until the next relaxation.
            self.cell_energy[cell] = 0
        site = self.points[texel]
        cosine = self.points @ site
        won = np.flatnonzero(cosine > self.cosine)
        gain = np.bincount(self.owner[won], self.energy[won], len(self.sites))
        self.cell_energy = np.maximum(self.cell_energy - gain, 0)
        self.cell_energy[self.count] = gain.sum()
        self.owner[won], self.cosine[won], self.sites[self.count] = self.count, cosine[won], site
        self.count += 1
        return True

    def relax(self, mass: NDArray[np.float64], fallback: NDArray[np.float64], iterations: int) -> None:
        """Lloyd's algorithm; cells that become empty are dropped."""
        for _ in range(iterations):
            self._drop_empty()
            sites = centroids(self.points, mass, fallback, self.owner, self.count)
            self.sites[: self.count] = sites
            self.owner = nearest(sites, self.points)
        self._drop_empty()
        self._refresh()

    def _drop_empty(self) -> None:
        used = np.bincount(self.owner, minlength=self.count) > 0
        if not used.all():
            self.owner = (np.cumsum(used) - 1)[self.owner]
            self.sites[: used.sum()] = self.sites[: self.count][used]
            self.count = int(used.sum())
