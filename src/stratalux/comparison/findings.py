"""What a comparison found: data that results, curves and the page are made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..images.metrics import Mask
from ..images.tonemap import auto_exposure
from .records import Entry, Record
from .reference import Reference


@dataclass(frozen=True)
class Findings:
    """All that a comparison found.

    ``equal_rays`` and ``equal_time``: a record for each number of rays and entry, in that order. ``surface``: mask
    (H, W) of the pixels that show nothing but surfaces. ``settings``: what it was run with. ``notes``: lines that a
    reader should see.
    """

    entries: tuple[Entry, ...]
    rays: tuple[int, ...]
    reference: Reference
    surface: Mask
    equal_rays: tuple[Record, ...]
    equal_time: tuple[Record, ...]
    settings: dict[str, Any]
    notes: list[str] = field(default_factory=list)

    @property
    def region(self) -> str:
        """The region whose figures are shown first: the surfaces, unless no pixel is all surface."""
        return "surface" if self.surface.any() else "image"

    def mask(self, region: str) -> Mask | None:
        """Mask of a region for the functions of :mod:`stratalux.images.metrics`."""
        return self.surface if region == "surface" else None

    def relative_to_best(self, record: Record, region: str | None = None) -> float:
        """Efficiency of ``record`` over the best at the same number of rays, in the same part of the comparison."""
        records = self.equal_rays if record.budget_seconds is None else self.equal_time
        region = region or self.region
        best = np.nanmax([other.errors[region].efficiency for other in records if other.rays == record.rays])
        mine = record.errors[region].efficiency
        return 1.0 if mine == best else float(mine / best)

    @property
    def exposure(self) -> float:
        """Exposure in stops that all pictures share: the automatic one of the reference."""
        image = self.reference.image
        return auto_exposure(np.repeat(image, 3, axis=2) if image.shape[2] == 1 else image)
