"""What a file of shapes holds: parts in coordinates of their own, and where each of them stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.floating[Any]]
Indices = npt.NDArray[np.integer[Any]]


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles that belong together, in double precision.

    `vertices` (V, 3) float64 positions, `faces` (F, 3) int64 indices into them, counter-clockwise seen from outside,
    `normals` (V, 3) float64 shading normals of any length, or None where the file brings none. NaN stands for a normal
    that a vertex of the file does not have.
    """

    vertices: Floats
    faces: Indices
    normals: Floats | None = None


@dataclass(frozen=True, eq=False)
class Instance:
    """One place of a part in the scene: the `part`'s index, and the affine (4, 4) `matrix` that takes it there."""

    part: int
    matrix: Floats


@dataclass(frozen=True, eq=False)
class Model:
    """All shapes of a file. A part may have several instances, and all of them share its triangles."""

    parts: Sequence[Part]
    instances: Sequence[Instance]

    @classmethod
    def of(cls, part: Part) -> Model:
        """A single part that stands where its own coordinates say."""
        return cls([part], [Instance(0, np.eye(4))])
